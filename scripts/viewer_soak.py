#!/usr/bin/env python3
"""Uses the viewer without a display for a long time, by a random script, and says whether its memory grows.

    python3 scripts/viewer_soak.py PROGRAM [--minutes 30] [--seed 1] [--validation] [SCENE...]

PROGRAM is built with the feature `probes`, whose programs run scripts.

Opens each scene in turn, again and again: orbits, flies, drags sliders, numbers and dividers, plays and scrubs animations, resizes, drops files, goes through all techniques and
tracers, splits, compares, saves, writes settings. Prints the memory of each visit and times of the interface's frames, and a verdict. Exit code 1 if the viewer fails or shows an
error, if the Vulkan validation layer has a message (--validation), or if scenes take more memory in later visits than in earlier ones, the first left out. Three minutes are one scene,
visited three times.
"""

import argparse
import json
import random
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PARADE = str(ROOT / "scenes/parade.glb")
SCENES = [PARADE, "builtin:stairs", "builtin:cornell-box", "builtin:cornell-spheres", "builtin:atrium"]
TECHNIQUES = [
    "AO fast", "AO balanced", "AO quality", "AO larsen", "AO larsen fixed", "GTAO (screen space)", "path, real time", "direct, real time", "lit, real time",
    "whitted, real time", "ao sky, real time", "AO converged", "AO still", "AO truth (ao-sky)", "path", "direct", "lit", "whitted", "depth", "normal", "ids", "motion", "rays",
    "samples", "variance", "unfiltered", "albedo",
]  # fmt: skip
TRACERS = ["compute", "query", "pipeline"]
# what later visits may take more than earlier ones, MiB: caches of the driver fill for some time
GROWTH = 200
# seconds of script a visit, on two cores
VISIT = 38
# visits of a scene at least: the first fills caches, the others are compared
VISITS = 3


class Deck:
    """Hands out items in random order, and each as often as every other."""

    def __init__(self, rng: random.Random, items: list[str]):
        self.rng, self.items, self.rest = rng, items, []

    def next(self) -> str:
        if not self.rest:
            self.rest = self.rng.sample(self.items, len(self.items))
        return self.rest.pop()


def visit(rng: random.Random, techniques: Deck, tracers: Deck, folder: Path, number: int, has_animation: bool, shown: int) -> list[str]:
    """Commands while a scene is open."""
    x, y = lambda: rng.randint(120, 420), lambda: rng.randint(120, 400)
    slide = lambda label: [f"drag-control {label} {rng.choice([-50, -20, 20, 50])} 0 0.3", "wait 0.5"]  # noqa: E731
    drag = lambda button: [f"drag {x()} {y()} {x()} {y()} {rng.uniform(0.3, 1.2):.2f} {button}"]  # noqa: E731
    path = lambda: f"{folder}/{number}.{rng.choice(['png', 'exr'])}"  # noqa: E731
    parts = [
        *(drag(button) for button in ["left", "left", "left", "right", "middle", "shift"]),
        [f"wheel {x()} {y()} {rng.randint(-4, 4)}", f"key {rng.choice('WASDQE')} {rng.uniform(0.2, 1):.2f}"],
        [f"press {x()} {y()}", "key F", "key B", f"press {x()} {y()} left 2", "wait 1"],
        ["key U", "wait 1", "key U"],
        # the panel
        # Enter ends the edit of the number, which would take the next keys
        ["click Radius", "wait 1", *slide("Radius"), "set Radius = 0.7", "wait 1", "click Radius", "key Enter"],
        ["click Light", *slide("Exposure"), "click Light"],
        ["key X", "wait 1", "drag-control Line between the images -60 0 0.3", "wait 0.5", "key X"],
        ["key T", "wait 5", "key Space", "wait 0.5", "key Space", "key T"],
        [f"resize {rng.randint(500, 1300)} {rng.randint(420, 900)}", "wait 0.5", "resize 1000 700"],
        ["wait picture 120", "key Ctrl+S", "wait text:Save the image", "key Ctrl+A", f"type {path()}", "key Enter", "wait text:saved"],
        ["key ?", "wait 0.3", "key Escape", "key N", "wait 0.3", "key N"],
        *(["click Show", f"click {techniques.next()}", "wait 1.5"] for _ in range(shown)),
        ["key X", "click Comparison", "click Second image", f"click {techniques.next()}", "wait 2", "click Comparison", "key X"],
    ]
    if has_animation:
        parts.append(["click Animation", "key P", "wait 1.5", "key P", *slide("Time"), "wait 0.5", *slide("Speed"), "click Animation"])
    rng.shuffle(parts)
    tracer = ["resize 1000 700", "click Device", "click Tracer", f"click {tracers.next()}", "wait 2", "wait picture 120", "click Device"]
    return ["resize 1000 700", *(line for part in parts for line in part), *tracer]


def script(seed: int, minutes: float, scenes: list[str], folder: Path) -> str:
    rng = random.Random(seed)
    visits = max(VISITS, round(60 * minutes / VISIT))
    scenes = scenes[: max(1, visits // VISITS)]
    visits -= visits % len(scenes)
    techniques, tracers = Deck(rng, TECHNIQUES), Deck(rng, TRACERS)
    # all of them, however short it is
    shown = max(3, -(-len(TECHNIQUES) // visits) - 1)
    lines = ["wait picture 120"]
    for number in range(visits):
        scene = scenes[number % len(scenes)]
        lines += [f"mark {number} {scene}", f"drop {scene}", "wait 3", "wait picture 120"]
        lines += visit(rng, techniques, tracers, folder, number, scene == PARADE, shown)
    return "\n".join([*lines, "expect-no-errors", ""])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=Path)
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("--minutes", type=float, default=30)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--validation", action="store_true", help="run with Vulkan's validation layer")
    args = parser.parse_intermixed_args()
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
            print("verdict: FAILED, the message is above", file=sys.stderr)
            return 1
    record = json.loads(run.stdout)
    visits: dict[str, list[float]] = {}
    elapsed = 0.0
    for section in record["sections"]:
        name = section["name"].partition(" ")[2] or section["name"]
        visits.setdefault(name, []).append(section["memory_mib"])
        elapsed += section["seconds"]
        median, p95, _ = section["ui_frame_ms"]
        print(
            f"{elapsed / 60:6.1f} min  {Path(section['name']).name if '/' in name else section['name']:<32} {section['pictures']:6} pictures  "
            f"interface {median:5.1f} ms (95 %: {p95:.1f})  memory {section['memory_mib']:6.0f} MiB"
        )
    # single visits differ by what was shown last: of all after the first, the median of the later half less that of the earlier one
    halves = {name: (of[1 : (len(of) + 1) // 2], of[(len(of) + 1) // 2 :]) for name, of in visits.items() if len(of) >= VISITS}
    grown = {name: statistics.median(later) - statistics.median(earlier) for name, (earlier, later) in halves.items()}
    print(f"growth from the earlier visits to the later ones, MiB: {', '.join(f'{Path(n).name} {g:+.0f}' for n, g in grown.items())}")
    too_much = [name for name, g in grown.items() if g > GROWTH]
    layer = "no validation message" if args.validation else "the validation layer was off"
    print(f"verdict: {'FAILED, memory grows: ' + ', '.join(too_much) if too_much else 'passed'}; no error, {layer}, {elapsed / 60:.1f} minutes")
    return int(bool(too_much))


if __name__ == "__main__":
    sys.exit(main())
