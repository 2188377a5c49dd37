#!/usr/bin/env python3
"""Occlusion textures of a model, baked by skylit and by Blender's Cycles: processor seconds at equal samples, and to equal error.

    pip install bpy numpy pillow
    python3 benches/peers/bake_cycles.py target/release/skylit FlightHelmet.gltf --size 512

Both bake one texture for each material of the same glTF, with the same number of samples per texel and no limit of distance, and are
processes of their own. Times are processor seconds of the whole process, since Blender's start, import and bake are all in one program; on a
machine with nothing else to do wall time is about half of it for each. Runs alternate; the first pair is left out.

Errors are RMSE over the texels that Cycles covers, from pairs of images with different seeds, so that they need no reference. Materials
whose texture coordinates overlap are baked by both, but have no error here, since skylit unwraps them; neither have those with alpha, by
which Cycles multiplies. Time to equal error is read off skylit's curve over sample counts."""

from __future__ import annotations

import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np


def bake_with_cycles(model: Path, size: int, spp: int, seed: int, folder: Path) -> None:
    """Runs inside of Blender's module: writes the texture of each material as MATERIAL.npy, top row first, -1 where no chart is."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(model))
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("world")
    scene.world.light_settings.distance = 1e9
    scene.render.engine = "CYCLES"
    scene.render.threads_mode, scene.render.threads = "FIXED", os.cpu_count()
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", spp, seed
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    for mesh in [o for o in scene.objects if o.type == "MESH"]:
        # the texture that is active in each material gets what is baked
        targets = {}
        for material in mesh.data.materials:
            image = bpy.data.images.new(material.name, size, size, alpha=True, float_buffer=True)
            # what no chart covers keeps this
            image.pixels.foreach_set(np.full(size * size * 4, -1, np.float32))
            node = material.node_tree.nodes.new("ShaderNodeTexImage")
            node.image = image
            material.node_tree.nodes.active = node
            targets[material.name] = image
        bpy.ops.object.select_all(action="DESELECT")
        mesh.select_set(True)
        bpy.context.view_layer.objects.active = mesh
        bpy.ops.object.bake(type="AO", margin=0, use_clear=False)
        for name, image in targets.items():
            texels = np.empty(size * size * 4, np.float32)
            image.pixels.foreach_get(texels)
            np.save(folder / f"{name}.npy", texels.reshape(size, size, 4)[::-1, :, 0])


def processor_seconds(command: list[str]) -> float:
    """User and system time of a process and of its children."""
    before = os.times()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def rmse(a: np.ndarray, b: np.ndarray) -> float:
    """Of each of two images with independent noise."""
    return math.sqrt(float(np.mean((a - b) ** 2)) / 2)


def at_error(curve: list[tuple[float, float]], error: float) -> float:
    """Seconds at an error, of a curve of (seconds, error) whose error falls; beyond its ends by the square root law."""
    if error >= curve[0][1]:
        return curve[0][0]
    for (s0, e0), (s1, e1) in zip(curve, curve[1:]):
        if e1 <= error:
            return math.exp(np.interp(-math.log(error), [-math.log(e0), -math.log(e1)], [math.log(s0), math.log(s1)]))
    seconds, last = curve[-1]
    return seconds * (last / error) ** 2


def measure(args: argparse.Namespace, folder: Path) -> None:
    from PIL import Image

    size = args.size

    def ours(spp: int, seed: int) -> tuple[float, dict[str, np.ndarray]]:
        output = folder / f"{spp}-{seed}" / "model.gltf"
        output.parent.mkdir(exist_ok=True)
        command = [args.program, "bake", str(args.model), "-o", str(output), "--size", str(size), "--spp", str(spp), "--seed", str(seed), "--tracer", args.tracer, "--quiet"]
        seconds = processor_seconds(command)
        document = json.loads(output.read_text())
        images = {}
        for material in document["materials"]:
            texture = material.get("occlusionTexture")
            # what is unwrapped lies elsewhere in the texture
            if texture is not None and texture.get("texCoord", 0) == 0 and material.get("alphaMode", "OPAQUE") == "OPAQUE":
                uri = document["images"][document["textures"][texture["index"]]["source"]]["uri"]
                images[material["name"]] = np.asarray(Image.open(output.parent / uri).convert("RGB"), np.float32)[..., 0] / 255
        return seconds, images

    def cycles(spp: int, seed: int) -> tuple[float, dict[str, np.ndarray]]:
        output = folder / f"cycles-{seed}"
        output.mkdir(exist_ok=True)
        worker = [sys.executable, __file__, "--cycles-worker", str(args.model), "--size", str(size), "--spp", str(spp), "--seed", str(seed), str(output)]
        seconds = processor_seconds(worker)
        return seconds, {path.stem: np.load(path) for path in output.glob("*.npy")}

    # runs in turn
    counts = sorted({max(args.spp // 16, 4), max(args.spp // 4, 4), args.spp})
    contestants = {("skylit", spp): (lambda seed, spp=spp: ours(spp, seed)) for spp in counts} | {("cycles", args.spp): lambda seed: cycles(args.spp, seed)}
    seconds: dict[tuple[str, int], list[float]] = {key: [] for key in contestants}
    images: dict[tuple[str, int], list[dict[str, np.ndarray]]] = {key: [] for key in contestants}
    for seed in range(args.repeats + 1):
        for key, bake in contestants.items():
            taken, baked = bake(seed)
            print(f"{key[0]} {key[1]} samples, seed {seed}: {taken:.1f} processor seconds", file=sys.stderr, flush=True)
            if seed > 0:
                seconds[key].append(taken)
            if seed < 2:
                images[key].append(baked)

    # errors over the texels of all materials that both have
    names = sorted(set(images["skylit", args.spp][0]) & set(images["cycles", args.spp][0]))
    errors, means = {}, {}
    for key, pair in images.items():
        values = [[], []]
        for name in names:
            covered = images["cycles", args.spp][0][name] >= 0
            for side, baked in zip(values, pair):
                side.append(baked[name][covered])
        flat = [np.concatenate(side) for side in values]
        errors[key] = rmse(*flat)
        means[key] = float(np.mean(flat))

    # the table
    medians = {key: statistics.median(values) for key, values in seconds.items()}
    peer = ("cycles", args.spp)
    curve = [(medians["skylit", spp], errors["skylit", spp]) for spp in counts]
    print(f"| {args.model.stem}, {size}x{size}, {len(names)} materials compared | samples | processor seconds | RMSE | mean | Cycles' time / this |")
    print("|---|---|---|---|---|---|")
    for key in contestants:
        low, high = min(seconds[key]), max(seconds[key])
        ratio = medians[peer] / medians[key]
        print(f"| {key[0]} | {key[1]} | {medians[key]:.1f} ({low:.1f} to {high:.1f}) | {errors[key]:.4f} | {means[key]:.4f} | {ratio:.2f} |")
    print(f"\nTo the error of Cycles: {at_error(curve, errors[peer]):.1f} processor seconds, {medians[peer] / at_error(curve, errors[peer]):.1f} times as fast")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=Path)
    parser.add_argument("model", type=Path)
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--tracer", default="compute")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        measure(args, Path(folder))


def worker() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--cycles-worker", type=Path)
    parser.add_argument("--size", type=int)
    parser.add_argument("--spp", type=int)
    parser.add_argument("--seed", type=int)
    parser.add_argument("folder", type=Path)
    args = parser.parse_args()
    bake_with_cycles(args.cycles_worker, args.size, args.spp, args.seed, args.folder)


if __name__ == "__main__":
    if "--cycles-worker" in sys.argv:
        worker()
    else:
        main()
