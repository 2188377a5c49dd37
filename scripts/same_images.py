#!/usr/bin/env python3
"""Do two builds of skylit make the same images, to the last bit?

    python3 scripts/same_images.py OLD NEW                 # both are programs: target/release/skylit, and one built before a change
    python3 scripts/same_images.py OLD NEW --only path     # cases whose names contain this
    python3 scripts/same_images.py OLD NEW --list

For changes that move and rename and are not to change any image. Small images of every integrator, preset, tracer and option, and of the glTF features that
the scenes of tests/mitsuba have; tracers that the device lacks are skipped, and said. Images of one driver and CPU can be compared: rounding differs between
drivers. A case fails where a channel is missing on one side, where any value differs, or where one of the programs ends with an error and the other does not."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
JUDGE = "tests/mitsuba/scenes"

# (name, scene, options); a case is rendered by each tracer where it says so
STILLS: list[tuple[str, str, str]] = [
    ("ao", "builtin:stairs", "--spp 8"),
    ("ao-radius", "builtin:stairs", "--spp 8 --ao-radius 0.5 --ao-falloff 2"),
    ("ao-shading-normals", "builtin:spheres:50", "--spp 8 --ao-normal shading"),
    ("ao-instances", "builtin:grid:3", "--spp 4 --aov all"),
    ("ao-leaves", "builtin:leaf-cards", "--spp 4 --aov all"),
    ("ao-far-away", "builtin:far-away", "--spp 4"),
    ("ao-terrain", "builtin:terrain:20000", "--spp 4"),
    ("path-cornell", "builtin:cornell-box", "--integrator path --spp 8"),
    ("path-glass", "builtin:cornell-glass-sphere", "--integrator path --spp 8"),
    ("path-spheres", "builtin:cornell-spheres", "--integrator path --spp 8"),
    ("path-courtyard", "scenes/courtyard.gltf", "--integrator path --spp 4 --environment 1,1.1,1.3"),
    ("direct", "builtin:cornell-box", "--integrator direct --spp 8"),
    ("ao-sky", "builtin:stairs", "--integrator ao-sky --spp 8"),
    ("lit", "builtin:cornell-spheres", "--integrator lit --spp 4 --ao-radius 2 --ao-falloff 1.5"),
]
COMPUTE_ONLY: list[tuple[str, str, str]] = [
    *[(f"traversal-{k}", "builtin:stairs", f"--spp 4 --traversal {k}") for k in ["wide", "packet", "nearest", "direction", "brute"]],
    ("triangle-test", "builtin:stairs", "--spp 4 --triangle-test moller-trumbore"),
    ("build-best", "builtin:terrain:5000", "--spp 4 --build best"),
    ("normals", "scenes/courtyard.gltf", "--integrator normals --spp 4"),
    ("albedo", "scenes/courtyard.gltf", "--integrator albedo --spp 4"),
    ("depth", "scenes/courtyard.gltf", "--integrator depth --spp 4"),
    *[(f"sampling-{k}", "builtin:cornell-box", f"--integrator path --spp 4 --sampling {k}") for k in ["bsdf", "light", "cosine", "uniform"]],
    ("bounces", "builtin:cornell-box", "--integrator path --spp 4 --max-depth 2"),
    ("clamp", "builtin:cornell-box", "--integrator path --spp 4 --firefly-clamp 2"),
    ("lens", "builtin:cornell-box", "--integrator path --spp 4 --f-number 0.5 --focus-distance 3"),
    ("filter-tent", "builtin:cornell-box", "--integrator path --spp 4 --pixel-filter tent"),
    ("ray-cone", "scenes/courtyard.gltf", "--integrator path --spp 4 --environment 1,1,1 --texture-filter ray-cone"),
    ("denoise", "builtin:cornell-box", "--integrator path --spp 8 --denoise filter"),
    ("light-disk", "builtin:stairs", "--integrator path --spp 4 --light|disk position=0,4,0 direction=0,-1,0 radius=0.5 radiance=20"),
    ("sun", "builtin:stairs", "--integrator path --spp 4 --light|sun direction=-1,-2,-1 irradiance=3 angle=2"),
]
# real-time frames; the last one is compared
FRAMES: list[tuple[str, str, str]] = [
    *[(f"preset-{k}", "builtin:stairs", f"--preset {k} --frames 0..6") for k in ["larsen", "larsen-fixed", "fast", "balanced", "quality"]],
    ("preset-reference", "builtin:stairs", "--preset reference --frames 0..1"),
    ("orbit", "builtin:stairs", "--preset balanced --orbit 8"),
    ("parade", "builtin:parade", "--preset fast --animate --frames 0..8"),
    ("gtao", "builtin:stairs", "--preset fast --technique gtao --frames 0..4"),
    ("checkerboard", "builtin:stairs", "--preset fast --resolution checkerboard --frames 0..6"),
    ("half", "builtin:stairs", "--preset fast --resolution half --frames 0..6"),
    ("sequence-blue", "builtin:stairs", "--preset fast --sequence blue --frames 0..4"),
    *[(f"filter-{k}", "builtin:stairs", f"--preset fast --filter {k} --frames 0..4") for k in ["none", "atrous"]],
    ("bent", "builtin:stairs", "--preset fast --aov bent --frames 0..4"),
    ("raster", "builtin:stairs", "--preset fast --primary raster --frames 0..4"),
    ("at-rest", "builtin:stairs", "--preset balanced --antialias on --at-rest converge --frames 0..24"),
    ("frames-path", "builtin:cornell-glass-sphere", "--integrator path --preset balanced --frames 0..6"),
    ("frames-lit", "builtin:cornell-spheres", "--integrator lit --ao-radius 2 --preset fast --frames 0..4"),
    ("frames-moving", "builtin:parade", "--integrator path --preset fast --animate --frames 0..4"),
]


def judged() -> list[tuple[str, str, str]]:
    """A few of the scenes that tests/mitsuba/main.rs renders: a glTF feature each."""
    names = ["emitter-alpha", "metal-ramp", "normal-map", "nested", "thin", "layers", "anisotropy", "sheen", "texture-transform", "vertex-colors", "lights-all", "light-many"]
    return [(f"gltf-{n}", f"{JUDGE}/{n}.gltf", "--integrator path --spp 4") for n in names if (ROOT / JUDGE / f"{n}.gltf").exists()]


def cases() -> list[tuple[str, str, list[str]]]:
    everything = []
    for tracer in ["compute", "query", "pipeline"]:
        for name, scene, options in STILLS + (COMPUTE_ONLY + judged() if tracer == "compute" else []) + FRAMES:
            if tracer != "compute" and name not in ["preset-balanced", "orbit", "parade"] and (name, scene, options) in FRAMES:
                continue
            text, _, light = options.partition("--light|")
            arguments = text.split() + (["--light", light] if light else [])
            everything.append((f"{name} {tracer}", scene, [*arguments, "--tracer", tracer]))
    return everything


def render(program: Path, scene: str, options: list[str], folder: Path) -> tuple[int, str, list[Path]]:
    """Exit code, last line of what it says, and the images."""
    folder.mkdir()
    frames = any(o in options for o in ["--frames", "--orbit"])
    output = folder / ("image_####.exr" if frames else "image.exr")
    command = [str(program), "render", scene, "--size", "96x64", "-o", str(output), *options]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    said = (done.stderr.strip().splitlines() or [""])[-1]
    return done.returncode, said, sorted(folder.glob("*.exr"))


def differences(program: Path, old: Path, new: Path) -> list[str]:
    """What differs, in words."""
    done = subprocess.run([str(program), "diff", str(old), str(new), "--json"], capture_output=True, text=True)
    if not done.stdout:
        return [done.stderr.strip()]
    report = json.loads(done.stdout.splitlines()[-1])
    return [f"{c['channel']}: {c['differing']} of {c['pixels']}" for c in report["channels"] if c.get("differing") or c.get("broken")]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    parser.add_argument("--only", default="", help="cases whose names contain this")
    parser.add_argument("--list", action="store_true", help="name the cases, and end")
    args = parser.parse_args()
    chosen = [c for c in cases() if args.only in c[0]]
    if args.list:
        print("\n".join(f"{name}: {scene} {' '.join(options)}" for name, scene, options in chosen))
        return
    programs = [args.old.resolve(), args.new.resolve()]
    same, failed, skipped = 0, [], []
    for k, (name, scene, options) in enumerate(chosen):
        print(f"\r{k + 1} of {len(chosen)}: {name:40}", end="", file=sys.stderr, flush=True)
        with tempfile.TemporaryDirectory() as folder:
            results = [render(p, scene, options, Path(folder) / side) for p, side in zip(programs, ["old", "new"])]
            (old_code, old_said, old_images), (new_code, new_said, new_images) = results
            if old_code != 0 or new_code != 0:
                (skipped if old_code == new_code else failed).append(f"{name}: exit codes {old_code} and {new_code}: {old_said or new_said}")
                continue
            what = [] if len(old_images) == len(new_images) and old_images else ["numbers of images differ"]
            for old, new in zip(old_images[-1:], new_images[-1:]):
                what += differences(programs[1], old, new)
            if what:
                failed.append(f"{name}: {'; '.join(what)}")
            else:
                same += 1
    print(file=sys.stderr)
    for line in skipped:
        print(f"skipped {line}")
    for line in failed:
        print(f"DIFFERS {line}")
    print(f"{same} cases are bit-equal, {len(failed)} differ, {len(skipped)} were skipped")
    sys.exit(1 if failed or not same else 0)


if __name__ == "__main__":
    main()
