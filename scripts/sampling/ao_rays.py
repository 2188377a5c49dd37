"""How many occlusion rays for a camera ray: error and time of --ao-rays 1, 2, 4 and 8, relative to 1. docs/notebook/2026-11-29-occlusion-rays-for-a-camera-ray.md has what it prints.

    python3 scripts/sampling/ao_rays.py target/release/skylit SCENE [OPTION...]

Errors are RMSE over seeds against an image of 2048 samples: over all pixels, over those at edges (their neighbours differ in the normal or, by a
twentieth, in depth) and over the others. Times are device seconds of camera and occlusion rays at 1280x720, the median of alternating runs.
Needs numpy and OpenEXR."""
import json
import statistics
import subprocess
import sys
import tempfile

import numpy as np
import OpenEXR

RAYS = (1, 2, 4, 8)
SEEDS, RUNS = 4, 3
SMALL, LARGE = "240x135", "1280x720"


def render(program, scene, output, *options):
    command = [program, "render", scene, "--integrator", "ao", "-o", output, "--json", "--no-config", *map(str, options)]
    return json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def channels(path):
    with OpenEXR.File(path) as file:
        return {name: np.array(channel.pixels, float) for name, channel in file.channels().items()}


def edges(image):
    """Pixels of which a neighbour has another normal or depth."""
    normal = np.stack([image[f"Ns.{axis}"] for axis in "XYZ"], -1)
    depth = np.where(np.isfinite(image["depth.Z"]) & (image["depth.Z"] > 0), image["depth.Z"], 1e9)
    found = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        for step in (1, -1):
            other, beyond = np.roll(normal, step, axis), np.roll(depth, step, axis)
            found |= ((normal * other).sum(-1) < 0.95) | (abs(depth - beyond) > 0.05 * np.minimum(depth, beyond))
    return found


def errors(program, scene, folder, spp, rays, reference, at_edges, options):
    squares = np.zeros(at_edges.shape)
    for seed in range(SEEDS):
        output = f"{folder}/image.exr"
        render(program, scene, output, "--size", SMALL, "--spp", spp, "--seed", seed, "--ao-rays", rays, *options)
        squares += (channels(output)["Y"] - reference) ** 2 / SEEDS
    return [squares.mean() ** 0.5, squares[at_edges].mean() ** 0.5, squares[~at_edges].mean() ** 0.5]


def seconds(report):
    return sum(time for name, time in report["device_seconds"].items())


def main():
    program, scene, *options = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/reference.exr"
        render(program, scene, path, "--size", SMALL, "--spp", 2048, "--seed", 99, "--ao-rays", 1, "--aov", "ns,depth", *options)
        reference = channels(path)
        at_edges = edges(reference)
        for spp in (16, 64):
            found = {n: errors(program, scene, folder, spp, n, reference["Y"], at_edges, options) for n in RAYS if 8 * n <= spp}
            for n, all_ in found.items():
                ratios = ", ".join(f"{a / b:.3f}" for a, b in zip(all_, found[1]))
                print(f"{scene} {spp} spp, {n} rays: RMSE {all_[0]:.5f}; all, edges, others relative to 1 ray: {ratios}", flush=True)
        times = {n: [] for n in RAYS}
        for _ in range(RUNS):
            for n in RAYS:
                times[n].append(seconds(render(program, scene, f"{folder}/image.exr", "--size", LARGE, "--spp", 64, "--ao-rays", n, *options)))
        for n in RAYS:
            print(f"{scene} 64 spp, {n} rays: {statistics.median(times[n]):.2f} device seconds, "
                  f"{statistics.median(times[n]) / statistics.median(times[1]):.3f} of 1 ray", flush=True)


main()
