#!/usr/bin/env python3
"""Similarity of real-time to offline ambient occlusion as Larsen (2019) measured it, as a table: his two measures over
whole 8-bit grey images on white.

    python3 scripts/results/larsen_similarity.py [--skylit PROGRAM] [--size 480x270] [--spp 1024] SCENE:RADIUS...

RADIUS is the distance in scene units at which a hit counts 1/255. Python's own library is enough."""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

VIEWS = ["front", "iso"]
# his pipeline, the same with correct sampling and filter, and ours
ROWS = {
    "`larsen`": ["--preset", "larsen"],
    "`larsen-fixed`": ["--preset", "larsen-fixed"],
    "`fast`": ["--preset", "fast"],
    "`balanced`": ["--preset", "balanced"],
    "`balanced`, `gtao`": ["--preset", "balanced", "--technique", "gtao"],
}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--skylit", default="target/release/skylit")
    parser.add_argument("--size", default="480x270")
    parser.add_argument("--spp", default="1024")
    parser.add_argument("scenes", nargs="+")
    options = parser.parse_args()
    print("| scene, view | | Tanimoto | minimum ratio |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for scene, radius in (name.rsplit(":", 1) for name in options.scenes):
            for view in VIEWS:
                similarity(options, Path(folder), scene, float(radius), view)


def similarity(options: argparse.Namespace, folder: Path, scene: str, radius: float, view: str) -> None:
    falloff = repr(255 ** (1 / radius))
    shared = [scene, "--no-config", "--quiet", "--size", options.size, "--view", view, "--ao-falloff", falloff, "--png-encoding", "linear"]

    def render(name: str, *settings: str) -> Path:
        file = folder / f"{name}.png"
        subprocess.run([options.skylit, "render", *shared, "--background", "1,1,1", *settings, "-o", file], check=True)
        return file

    def row(name: str, image: Path) -> None:
        out = subprocess.run([options.skylit, "diff", image, truth, "--json"], capture_output=True, check=True, text=True)
        metrics = json.loads(out.stdout)["compared"]
        print(f"| {Path(scene).stem}, {view} | {name} | {metrics['tanimoto']:.6f} | {metrics['minimum_ratio']:.6f} |", flush=True)

    # frames of `larsen` sample pixel centres, antialiased ones the whole area: each is compared with a still of its own filter
    for pixel_filter, presets in (("centre", ["larsen", "larsen-fixed"]), ("box", ["fast", "balanced"])):
        # another seed: frames have the sequences of stills, and `larsen-fixed` the image of one to the bit
        truth = render("truth", "--spp", options.spp, "--pixel-filter", pixel_filter, "--seed", "77")
        if pixel_filter == "centre":
            # nothing at all where there should be ambient occlusion
            row("all white", render("white", "--spp", "1", "--pixel-filter", pixel_filter, "--ao-radius", repr(radius / 1e6)))
        for number, (name, settings) in enumerate(ROWS.items()):
            if settings[1] in presets:
                row(name, render(f"frame{number}", *settings))


if __name__ == "__main__":
    main()
