#!/usr/bin/env python3
"""Uses the viewer without a display for a long time, by a random script, and says whether its memory grows.

    python3 scripts/viewer_soak.py PROGRAM [--minutes 30] [--seed 1] [--validation] [SCENE...]

Opens each scene in turn, again and again: orbits, flies, resizes, changes techniques, tracers and settings, splits, compares, saves. Fails if the viewer fails or shows an error,
if the Vulkan validation layer has a message (--validation), or if a scene takes more memory the last time than the second time it is open.
"""

import argparse
import json
import random
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SCENES = ["builtin:stairs", "builtin:cornell-box", str(ROOT / "scenes/parade.glb"), "builtin:cornell-spheres", "builtin:atrium"]
TECHNIQUES = [
    "AO fast", "AO balanced", "AO quality", "AO larsen", "AO larsen fixed", "GTAO (screen space)", "path, real time", "direct, real time", "lit, real time",
    "whitted, real time", "AO converged", "AO still", "AO truth (ao-sky)", "path", "direct", "lit", "depth", "normals", "motion", "rays", "history", "variance", "albedo",
]  # fmt: skip
TRACERS = ["compute", "query", "pipeline"]
# what a visit may take more than the second one, MiB: caches of the driver fill for some time
GROWTH = 200
# seconds of script a scene, on two cores
VISIT = 75


def visit(rng: random.Random, folder: Path, number: int) -> list[str]:
    """Commands while a scene is open."""
    x, y = lambda: rng.randint(120, 420), lambda: rng.randint(120, 400)
    button = lambda: rng.choice(["left", "right", "middle", "shift"])  # noqa: E731
    lines = []
    for _ in range(rng.randint(18, 26)):
        lines += rng.choice([
            lambda: [f"drag {x()} {y()} {x()} {y()} {rng.uniform(0.3, 1.5):.2f} {button()}"],
            lambda: [f"drag {x()} {y()} {x()} {y()} {rng.uniform(0.3, 1.5):.2f} left"],
            lambda: [f"wheel {x()} {y()} {rng.randint(-4, 4)}"],
            lambda: [f"key {rng.choice('WASDQE')} {rng.uniform(0.2, 1):.2f}"],
            lambda: [f"key {rng.choice('12345')}", "wait 1.5"],
            lambda: ["click First image", f"click {rng.choice(TECHNIQUES)}", "wait 2"],
            lambda: ["click Second image", f"click {rng.choice(TECHNIQUES)}", "wait 2"],
            lambda: ["key X", "wait 1"],
            lambda: ["key T", "wait 4"],
            lambda: ["key Space"],
            lambda: ["key F"],
            lambda: ["key B"],
            lambda: ["key P", "wait 1.5"],
            lambda: ["key U", "wait 1", "key U"],
            lambda: [f"press {x()} {y()}"],
            lambda: [f"press {x()} {y()} left 2", "wait 1"],
            lambda: [f"resize {rng.randint(500, 1300)} {rng.randint(420, 900)}", "wait 0.5"],
            lambda: ["key Ctrl+S", "wait text:Save the image", "key Ctrl+A", f"type {folder}/{number}.{rng.choice(['png', 'exr'])}", "key Enter", "wait text:saved"],
        ])()  # fmt: skip
    if rng.random() < 0.7:
        lines += ["resize 1000 700", "click Device", "click Tracer", f"click {rng.choice(TRACERS)}", "wait 4", "wait picture 120", "click Device"]
    return ["resize 1000 700", *lines, "resize 1000 700"]


def script(seed: int, minutes: float, scenes: list[str], folder: Path) -> str:
    rng = random.Random(seed)
    lines, number = ["wait picture 120"], 0
    while number * VISIT < 60 * minutes or number < 3 * len(scenes):
        scene = scenes[number % len(scenes)]
        lines += [f"mark {number} {scene}", f"drop {scene}", "wait 3", "wait picture 120", *visit(rng, folder, number)]
        number += 1
    return "\n".join([*lines, "expect-no-errors", ""])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=Path)
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("--minutes", type=float, default=30)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--validation", action="store_true", help="run with Vulkan's validation layer")
    args = parser.parse_args()
    scenes = args.scenes or SCENES
    with tempfile.TemporaryDirectory() as temporary:
        file = Path(temporary) / "script.txt"
        file.write_text(script(args.seed, args.minutes, scenes, Path(temporary)))
        command = [args.program, "view", scenes[0], "--no-config", "--size", "1000x700", "--headless-script", file, "--json"]
        command += ["--validation"] if args.validation else []
        run = subprocess.run(command, stdout=subprocess.PIPE, text=True, cwd=ROOT)
        if run.returncode != 0:
            print(run.stdout[-2000:], file=sys.stderr)
            shown = file.read_text().splitlines()
            print("the script:", *(f"{k + 1}: {line}" for k, line in enumerate(shown)), sep="\n", file=sys.stderr)
            return 1
    record = json.loads(run.stdout)
    visits: dict[str, list[float]] = {}
    for section in record["sections"]:
        name = section["name"].partition(" ")[2] or section["name"]
        visits.setdefault(name, []).append(section["memory_mib"])
        print(f"{section['name']:<40} {section['seconds']:7.1f} s {section['pictures']:6} pictures {section['memory_mib']:8.0f} MiB")
    seconds = sum(s["seconds"] for s in record["sections"])
    grown = {name: of[-1] - of[1] for name, of in visits.items() if len(of) > 2}
    print(f"{seconds / 60:.1f} minutes; growth from the second visit to the last, MiB: {', '.join(f'{n} {g:+.0f}' for n, g in grown.items())}")
    return int(any(g > GROWTH for g in grown.values()))


if __name__ == "__main__":
    sys.exit(main())
