#!/usr/bin/env python3
"""The AO radius at which `lit` is closest to `path`, by rendering an image for each radius: checks skylit compare ao-vs-path with nothing of its own.

    pip install numpy OpenEXR
    python3 scripts/dense_search.py SCENE --about RADIUS [--program target/release/skylit] [--size WxH] [--spp N] [--steps N] [--ratio X] -- [OPTION...]

OPTIONs are those of `skylit render`: camera, lights. There are 2 N + 1 radii about RADIUS, each X times the one before. The ambient colour is fitted to each by least squares, over
two halves of other seeds, whose products noise does not bias."""

import argparse
import pathlib
import subprocess
import tempfile

import numpy as np
import OpenEXR


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--about", type=float, required=True)
    parser.add_argument("--program", default="target/release/skylit")
    parser.add_argument("--size", default="160x90")
    parser.add_argument("--spp", default="128")
    parser.add_argument("--steps", type=int, default=10)
    parser.add_argument("--ratio", type=float, default=1.035)
    parser.add_argument("options", nargs="*")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        image = pathlib.Path(folder) / "image.exr"

        def render(integrator, seed, *options):
            command = [arguments.program, "render", arguments.scene, "--quiet", "--size", arguments.size, "--spp", arguments.spp, "--seed", str(seed)]
            subprocess.run([*command, "--integrator", integrator, "-o", image, *arguments.options, *options], check=True)
            with OpenEXR.File(str(image), separate_channels=True) as file:
                channels = {name: channel.pixels for name, channel in file.channels().items()}
            covered = channels["A"] > 0
            return np.stack([np.where(covered, channels[c], 0) for c in "RGB"], -1).astype(np.float64).reshape(-1, 3)

        def lit(seed, ambient, radius):
            return render("lit", seed, "--ambient", ambient, "--environment-light", "traced", "--ao-radius", radius)

        targets = [render("path", seed) - lit(seed, "0,0,0", "inf") for seed in (900, 901)]
        zero = [lit(seed, "0,0,0", "inf") for seed in (950, 951)]
        mean_square = (targets[0] * targets[1]).sum()
        found = []
        for k in range(-arguments.steps, arguments.steps + 1):
            radius = arguments.about * arguments.ratio**k
            signal = [lit(seed, "1,1,1", repr(radius)) - none for seed, none in zip((950, 951), zero, strict=True)]
            squares = (signal[0] * signal[1]).sum(0)
            products = 0.5 * (signal[0] * targets[1] + signal[1] * targets[0]).sum(0)
            found.append(((products**2 / squares).sum() / mean_square, radius))
            print(f"radius {radius:.4g}: {100 * found[-1][0]:.2f} % explained, ambient radiance {products / squares}", flush=True)
    print(f"best: {max(found)[1]:.4g}")


if __name__ == "__main__":
    main()
