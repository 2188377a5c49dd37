#!/usr/bin/env python3
"""Images of ambient occlusion beside Mitsuba 3: seconds at equal samples, and to equal error.

    pip install mitsuba==3.9.1 numpy      # and LLVM's shared library: DRJIT_LIBLLVM_PATH names it where it is not found
    python3 benches/peers/ao_images.py target/release/skylit
    python3 benches/peers/ao_images.py target/release/skylit room dragon --repeats 3

Mitsuba has no integrator for ambient occlusion; the one here traces what ours does, a ray through the pixel and one from its hit, distributed by the cosine about the
geometric normal, no longer than the radius. Its time is that of `mi.render` and the array, after a first image that compiles. Ours is that of the whole process, with
loading, building the hierarchy and writing the file, after a first one that fills the driver's cache; both load the same triangles, so a scene here must have no alpha. Images alternate.

Errors are RMSE over covered pixels, from pairs of images with different seeds, so that they need no reference. Time to equal error is read off our
curve of error over sample counts, logarithmically between its points, at the error of Mitsuba's `multijitter` with --spp samples."""

from __future__ import annotations

import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import mitsuba as mi

mi.set_variant("llvm_ad_rgb")
mi.set_log_level(mi.LogLevel.Error)

import drjit as dr  # noqa: E402

SHARED = Path(os.environ.get("SKYLIT_SHARED_SCENES", "../shared/scenes"))
SAMPLERS = ["independent", "multijitter"]
# scene, eye, target, vertical field of view in degrees, radius
SCENES: dict[str, tuple[str, tuple[float, ...], tuple[float, ...], float, float]] = {
    "room": ("builtin:room:40000", (-3.4, 1.6, 2.5), (1.2, 0.9, -1.0), 65.0, 1.9),
    "dragon": (str(SHARED / "dragon/dragon.glb"), (0.065, 0.1857, 0.198), (-0.0059, 0.125, -0.0046), 45.0, math.inf),
}


class Occlusion(mi.SamplingIntegrator):
    """One minus occlusion in red, and in green whether there is a surface."""

    def __init__(self, properties):
        super().__init__(properties)
        self.radius = properties["radius"]

    def sample(self, scene, sampler, ray, medium=None, active=True):
        hit = scene.ray_intersect(ray, mi.RayFlags.Minimal, coherent=True, active=mi.Bool(active))
        active = mi.Bool(active) & hit.is_valid()
        normal = dr.mulsign(hit.n, -dr.dot(hit.n, ray.d))
        away = mi.Frame3f(normal).to_world(mi.warp.square_to_cosine_hemisphere(sampler.next_2d(active)))
        ray = hit.spawn_ray(away)
        ray.maxt = dr.minimum(ray.maxt, self.radius)
        occluded = scene.ray_test(ray, coherent=False, active=active)
        return mi.Color3f(dr.select(active & ~occluded, 1.0, 0.0), dr.select(active, 1.0, 0.0), 0.0), active, []


mi.register_integrator("occlusion", lambda properties: Occlusion(properties))


def mesh(path: Path) -> mi.Mesh:
    """Triangles that `skylit export FILE.bin` wrote: u32 vertices, u32 triangles, f32 xyz[], u32 abc[]."""
    data = path.read_bytes()
    vertices, triangles = np.frombuffer(data, "<u4", 2)
    loaded = mi.Mesh("mesh", vertices, triangles)
    parameters = mi.traverse(loaded)
    parameters["vertex_positions"] = np.frombuffer(data, "<f4", vertices * 3, 8).copy()
    parameters["faces"] = np.frombuffer(data, "<u4", triangles * 3, 8 + int(vertices) * 12).copy()
    parameters.update()
    return loaded


def pixels(path: Path) -> np.ndarray:
    bitmap = mi.Bitmap(str(path))
    names = [c.name for c in bitmap.struct_()]
    # images of one channel call it Y
    channel = next(k for k, name in enumerate(names) if name.split(".")[-1] in ("R", "Y"))
    return np.array(bitmap).reshape(*reversed(bitmap.size()), -1)[..., [channel]]


def rmse(pair: list[np.ndarray], covered: np.ndarray) -> float:
    """Of each of two images with independent noise."""
    return math.sqrt(float(np.mean((pair[0] - pair[1])[covered] ** 2)) / 2)


def at_error(curve: list[tuple[float, float]], error: float) -> float:
    """Seconds at an error, of a curve of (seconds, error) whose error falls; beyond its end by the square root law."""
    for (s0, e0), (s1, e1) in zip(curve, curve[1:]):
        if e1 <= error:
            return s0 if error >= e0 else math.exp(np.interp(-math.log(error), [-math.log(e0), -math.log(e1)], [math.log(s0), math.log(s1)]))
    seconds, last = curve[-1]
    return seconds * (last / error) ** 2


def measure(name: str, args: argparse.Namespace, folder: Path) -> None:
    source, eye, target, fov, radius = SCENES[name]
    width, height = map(int, args.size.split("x"))
    triangles = folder / "triangles.bin"
    subprocess.run([args.program, "export", source, triangles, "--quiet"], check=True)
    film = {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb", "component_format": "float32", "rfilter": {"type": "box"}}
    sensor = {
        "type": "perspective", "fov": fov, "fov_axis": "y", "near_clip": 1e-4, "far_clip": 1e7, "film": film,
        "to_world": mi.ScalarTransform4f().look_at(origin=list(eye), target=list(target), up=[0, 1, 0]),
    }
    scene = mi.load_dict({"type": "scene", "mesh": mesh(triangles), "sensor": sensor})
    properties = mi.Properties()
    properties["radius"] = radius
    integrator = Occlusion(properties)

    def theirs(kind: str, seed: int) -> tuple[float, np.ndarray]:
        camera = mi.load_dict(sensor | {"sampler": {"type": kind, "sample_count": args.spp}})
        start = time.perf_counter()
        image = np.array(mi.render(scene, sensor=camera, integrator=integrator, spp=args.spp, seed=seed))
        return time.perf_counter() - start, image

    def ours(spp: int, seed: int) -> tuple[float, np.ndarray]:
        output = folder / f"{spp}-{seed}.exr"
        view = [f"--eye={','.join(map(str, eye))}", f"--target={','.join(map(str, target))}", f"--fov-y={fov}"]
        command = [args.program, "render", source, *view, "--size", args.size, "--spp", str(spp), "--seed", str(seed)]
        start = time.perf_counter()
        subprocess.run([*command, f"--ao-radius={radius}", "--tracer", args.tracer, "--quiet", "-o", output], check=True)
        return time.perf_counter() - start, pixels(output)

    contestants = {("skylit", spp): (lambda seed, spp=spp: ours(spp, seed)) for spp in sorted({args.spp // 16, args.spp // 4, args.spp})}
    contestants |= {(kind, args.spp): (lambda seed, kind=kind: theirs(kind, seed)) for kind in SAMPLERS}
    seconds = {key: [] for key in contestants}
    images, covered = {}, None
    for seed in range(args.repeats + 1):
        for key, render in contestants.items():
            taken, image = render(seed)
            # the first one compiles
            if seed > 0:
                seconds[key].append(taken)
            if seed < 2:
                images.setdefault(key, []).append(image[..., 0])
                covered = image[..., 1] > 0 if key[0] == "independent" else covered
    medians = {key: statistics.median(values) for key, values in seconds.items()}
    errors = {key: rmse(pair, covered) for key, pair in images.items()}
    means = {key: float(np.mean([image[covered].mean() for image in pair])) for key, pair in images.items()}
    curve = sorted((medians[key], errors[key]) for key in contestants if key[0] == "skylit")
    mine, best = ("skylit", args.spp), ("multijitter", args.spp)
    ratios = [a / b for a, b in zip(seconds[mine], seconds["independent", args.spp])]
    to_error = at_error(curve, errors[best])
    cells = [name, *(f"{medians[k, args.spp]:.2f} s, {errors[k, args.spp]:.4f}" for k in ["skylit", *SAMPLERS])]
    cells += [f"{statistics.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})", f"{to_error / medians[best]:.2f}"]
    print("| " + " | ".join(cells) + " |", flush=True)
    print(json.dumps({"scene": name, "means": {f"{k[0]} {k[1]}": round(m, 5) for k, m in means.items()}}), file=sys.stderr, flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("scenes", nargs="*", default=list(SCENES), help=f"of {', '.join(SCENES)} (default: all)")
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--tracer", default="compute")
    args = parser.parse_args()
    print(f"| scene, {args.size}, {args.spp} samples | skylit: process, RMSE | independent: seconds, RMSE | multijitter | time at equal samples | time to multijitter's error |")
    print("|---|---|---|---|---|---|")
    for name in args.scenes:
        with tempfile.TemporaryDirectory() as folder:
            measure(name, args, Path(folder))


if __name__ == "__main__":
    main()
