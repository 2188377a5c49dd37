#!/usr/bin/env python3
"""The pages of docs/results, made from the records in docs/results/data.

    python3 scripts/results.py                          # writes the pages
    python3 scripts/results.py --check                  # are the pages what the records give? renders nothing
    python3 scripts/results.py measure [PAGE...]        # measures, keeps the records, writes the pages: two hours
    python3 scripts/results.py measure --quick          # fewer scenes, samples and repeats: 12 minutes on two cores
    python3 scripts/results.py add PAGE RECORD.json...  # takes records that were made elsewhere, as of another driver

Measure with a release program on a machine that does nothing else. Scenes are those of SKYLIT_SHARED_SCENES, a folder,
../shared/scenes unless it is set; missing ones are left out. docs/results/gpu.md is written by scripts/gpu.sh."""

from __future__ import annotations

import argparse
import datetime
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts/results"))
import ao_versus_path  # noqa: E402
import mitsuba_scenes  # noqa: E402
from pages import PAGES, pages  # noqa: E402

DATA = PAGES / "data"
Record = dict[str, Any]

ROOM, TERRAIN = "builtin:room:40000", "builtin:terrain"
SPONZA, DRAGON, HELMET = "sponza/sponza.glb", "dragon/dragon.glb", "flight_helmet/FlightHelmet.gltf"
# page: arguments of the program, of all and of `--quick`; files are in the folder of shared scenes
COMMANDS: dict[str, tuple[str, str]] = {
    "rays": (
        f"bench rays {ROOM} {TERRAIN}:10000 {TERRAIN}:1000000 {DRAGON} {HELMET} {SPONZA} --kernels wide,packet,nearest",
        f"bench rays {ROOM} {TERRAIN}:10000 {TERRAIN}:1000000 {DRAGON} {HELMET} {SPONZA} --kernels wide,packet"
        " --rays 230400 --repeats 5 --time-limit 130",
    ),
    "frames": (
        "bench frames --parts still,moving,sun,animation --frames 32",
        f"bench frames builtin:cornell-box builtin:cornell-mirror builtin:parade {HELMET} {SPONZA} --parts still,moving"
        " --presets fast,balanced --frames 16 --reference-paths 256 --peers none --time-limit 120",
    ),
    "ao": (
        "bench ao --size 320x180 --frames 64 --reference-rays 512",
        f"bench ao builtin:stairs {DRAGON} {HELMET} {SPONZA} --views near --parts still,moving --size 320x180"
        " --presets larsen,balanced,quality --frames 24 --reference-rays 256 --time-limit 100",
    ),
    "path": (
        "bench path",
        "bench path --strategies mis,bsdf --size 128x128 --seconds 0.7 --reference-seconds 6 --repeats 2"
        " --time-limit 80",
    ),
    "builders": (
        "bench builders --counts",
        f"bench builders {SPONZA} builtin:atrium --counts --width 128 --time-limit 60",
    ),
    "stress": ("stress", "stress"),
    "ao-versus-path": (
        "compare ao-vs-path --size 320x180 --spp 32 --ao-samples 64",
        "compare ao-vs-path --size 128x72 --spp 16 --ao-samples 32",
    ),
    # the images of the tests, by cargo: not of the program, and not in `--quick`
    "mitsuba": ("nextest run --locked --test mitsuba --success-output immediate", ""),
}
# pages whose records have curves
PLOTTED = {"rays", "frames", "ao", "path"}
# quantities of `skylit bench` that pages or plots have; passes are left out
KEPT = {
    "rays": {"rate", "nodes a ray", "leaves a ray", "build", "bytes a primitive", "SAH cost"},
    "frames": {"time", "wall time", "RMSE", "corrected RMSE", "plain RMSE", "over plain", "plain paths", "flicker"},
    "ao": {"time", "wall time", "rays", "RMSE", "corrected RMSE", "plain RMSE", "unfiltered RMSE", "bias"},
    "builders": {"cost", "his", "whole tree", "his whole tree", "default", "Pearson", "Spearman", "mean ratio to his"},
}


# what a record has in any case
NEEDED = {page: {"device", "driver", "checks" if page == "stress" else "measurements"} for page in COMMANDS}


def load_all() -> dict[str, Record]:
    return {page: data for page in COMMANDS if (data := load(page))}


def load(page: str) -> Record | None:
    path = DATA / f"{page}.json"
    return read(path) if path.is_file() else None


def read(path: Path) -> Record:
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError) as error:
        sys.exit(f"results: error: {path}: {error}")


def rounded(x: Any) -> Any:
    """Five digits of each number, and counts as they are."""
    if isinstance(x, float):
        return int(x) if x.is_integer() and abs(x) < 2**53 else float(f"{x:.5g}")
    if isinstance(x, dict):
        return {k: rounded(v) for k, v in x.items()}
    return [rounded(v) for v in x] if isinstance(x, list) else x


def compact(page: str, record: Record) -> Record:
    """What pages and plots need of a record."""
    if page == "stress":
        fails = lambda c: {"sentence": c["sentence"]} if c["verdict"] == "fails" else {}
        kept = ("section", "name", "tracer", "verdict", "value", "unit", "bound")
        checks = [{**{k: c[k] for k in kept}, **fails(c)} for c in record["checks"]]
        return {**{k: record[k] for k in ("device", "driver", "sections")}, "checks": checks}
    wanted = KEPT.get(page)

    def is_kept(m: Record) -> bool:
        # of single placements the mean is enough
        single = m["scene"].startswith("Falcone: ") and m["scene"] != "Falcone: all placements"
        named = wanted is None or m["quantity"] in wanted or m["contestant"] == "reference"
        return named and not single and not m["part"].endswith("passes")

    return {**record, "measurements": [m for m in record["measurements"] if is_kept(m)]}


def save(page: str, data: Record, folder: Path) -> None:
    """A line for each measurement or check, without the folder of the scenes in any name."""
    text = json.dumps(rounded(data), ensure_ascii=False, separators=(",", ":"))
    text = text.replace(f"{folder}/", "")
    text = re.sub(r'(?<=[\[,])(?=\{"(scene|section|name|tracer)":|\["\w)', "\n", text)
    DATA.mkdir(parents=True, exist_ok=True)
    (DATA / f"{page}.json").write_text(text + "\n")


def output(command: list[str]) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else ""


def envelope(program: str, quick: bool, note: str | None) -> Record:
    """The machine, the day and the program."""
    doctor = json.loads(output([program, "doctor", "--json"]) or "{}")
    device = next((d for d in doctor.get("devices", []) if d["index"] == doctor.get("device")), {})
    info = Path("/proc/cpuinfo")
    cpu = re.search(r"^model name\s*:\s*(.+)$", info.read_text() if info.exists() else "", re.M)
    machine = {"cpu": cpu[1] if cpu else "", "threads": os.cpu_count()}
    return {
        "machine": {**machine, "device": device.get("name", ""), "driver": device.get("driver", "")},
        "version": (output([program, "--version"]).split() or ["", ""])[1],
        "commit": output(["git", "-C", str(ROOT), "rev-parse", "--short=8", "HEAD"]),
        "date": datetime.date.today().isoformat(),
        "quick": quick,
        "note": note,
    }


def run(command: list[str], folder: Path) -> None:
    """Runs a benchmark in the repository, where its peers are; a failure has its last line."""
    environment = {**os.environ, "SKYLIT_SHARED_SCENES": str(folder)}
    done = subprocess.run(command, cwd=ROOT, env=environment, stderr=subprocess.PIPE, text=True, check=False)
    if done.returncode not in (0, 1):
        raise RuntimeError((done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1])


def measure_page(page: str, arguments: argparse.Namespace) -> Record | None:
    """The record of a page; None where `--quick` leaves it out."""
    program, folder = arguments.program, arguments.scenes
    words = shlex.split(COMMANDS[page][arguments.quick])
    if not words:
        return None
    data = envelope(program, arguments.quick, arguments.note)
    command = ("cargo " if page == "mitsuba" else "skylit ") + shlex.join(words)
    if page == "mitsuba":
        return {**data, "commands": [command], "records": [mitsuba_scenes.measure(words)]}
    if page == "ao-versus-path":
        records, notes = ao_versus_path.measure(program, folder, words[2:])
        commands = [command.replace("ao-vs-path", "ao-vs-path SCENE")]
        return {**data, "commands": commands, "records": records, "notes": notes}
    with tempfile.TemporaryDirectory() as temporary:
        file = Path(temporary) / "record.json"
        if page == "stress":
            with file.open("w") as out:
                subprocess.run([program, *words, "--json"], stdout=out, check=False)
            return {**data, "commands": [command], "records": [compact(page, json.loads(file.read_text()))]}
        existing = [str(folder / w) if "/" in w and (folder / w).is_file() else w for w in words]
        # files that are not there were not found in the folder
        present = [w for w in existing if not re.search(r"\.(glb|gltf)$", w) or Path(w).is_file()]
        run([program, *present, f"--json={file}", "-q"], folder)
        return {**data, "commands": [command], "record": compact(page, json.loads(file.read_text()))}


def draw(page: str, data: Record, program: str) -> None:
    """The charts of a benchmark, by the program."""
    with tempfile.TemporaryDirectory() as temporary:
        file, image = Path(temporary) / "record.json", PAGES / f"{page}.svg"
        file.write_text(json.dumps(data["record"]))
        subprocess.run([program, "bench", "report", file, "--plot", image, "-q"], stdout=subprocess.DEVNULL, check=True)
        # coordinates to a hundredth of a pixel, and texts as they are
        tag = re.compile(r"<[^<>]*>")
        image.write_text(tag.sub(lambda t: re.sub(r"(\d+\.\d\d)\d+", r"\1", t[0]), image.read_text()))


def measure(arguments: argparse.Namespace) -> int:
    failed = 0
    for page in arguments.pages or COMMANDS:
        begin = time.monotonic()
        try:
            data = measure_page(page, arguments)
        except (RuntimeError, OSError, ValueError) as error:
            print(f"results: {page}: {error}", file=sys.stderr)
            failed += 1
            continue
        if data is None:
            print(f"results: {page}: left out, it needs the tests: measure it without --quick", file=sys.stderr)
            continue
        save(page, data, arguments.scenes)
        if page in PLOTTED:
            draw(page, load(page), arguments.program)
        print(f"results: {page}: {time.monotonic() - begin:.0f} s", file=sys.stderr)
    write()
    return min(failed, 1)


def add(arguments: argparse.Namespace) -> int:
    """Records of another machine or driver in place of a page's own; those of `stress` beside them."""
    page = arguments.page
    records = [read(f) for f in arguments.records]
    wrong = next((f for f, r in zip(arguments.records, records, strict=True) if not NEEDED[page] <= r.keys()), None)
    if wrong:
        sys.exit(f"results: error: {wrong}: no record of this benchmark: make one with `--json`")
    own = envelope(arguments.program, False, arguments.note) if os.path.exists(arguments.program) else {}
    machine = {k: records[0][k] for k in ("cpu", "threads", "device", "driver") if k in records[0]}
    # a record of stress does not name the CPU: it is this machine's where the device is
    here = own.get("machine", {})
    machine = {**(here if here.get("device") == machine["device"] else {"cpu": ""}), **machine}
    data = load(page) if page == "stress" else None
    if data is None or "tables" in data:
        version = records[0].get("version", own.get("version", ""))
        data = {**own, "machine": machine, "version": version, "commands": [arguments.command_line]}
    if page == "stress":
        data["records"] = [*data.get("records", []), *(compact(page, r) for r in records)]
    else:
        data["record"] = compact(page, records[0])
    save(page, data, arguments.scenes)
    if page in PLOTTED and os.path.exists(arguments.program):
        draw(page, load(page), arguments.program)
    write()
    return 0


def write() -> int:
    for page, text in pages(load_all()).items():
        page.write_text(text)
        print(page.relative_to(ROOT))
    return 0


def check() -> int:
    stale = [p for p, text in pages(load_all()).items() if not p.is_file() or p.read_text() != text]
    remedy = "is not what docs/results/data gives: run python3 scripts/results.py"
    for page in stale:
        print(f"results: {page.relative_to(ROOT)} {remedy}", file=sys.stderr)
    return 1 if stale else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="compare the pages with what the records give")
    commands = parser.add_subparsers(dest="command")
    shared = argparse.ArgumentParser(add_help=False)
    shared.add_argument("--program", default="target/release/skylit")
    scenes = os.environ.get("SKYLIT_SHARED_SCENES", ROOT / "../shared/scenes")
    shared.add_argument("--scenes", type=Path, default=Path(scenes))
    shared.add_argument("--note", help="a line at the top of the page, as on a busy machine")
    measuring = commands.add_parser("measure", parents=[shared])
    measuring.add_argument("pages", nargs="*", metavar="PAGE", choices=[*COMMANDS, []])
    measuring.add_argument("--quick", action="store_true")
    adding = commands.add_parser("add", parents=[shared])
    adding.add_argument("page", choices=["rays", "frames", "ao", "path", "builders", "stress"])
    adding.add_argument("records", nargs="+", type=Path)
    adding.add_argument("--command-line", default="", help="the command that made the record")
    arguments = parser.parse_args()
    if arguments.command:
        arguments.program, arguments.scenes = os.path.abspath(arguments.program), arguments.scenes.resolve()
    if arguments.command == "measure":
        return measure(arguments)
    if arguments.command == "add":
        return add(arguments)
    return check() if arguments.check else write()


if __name__ == "__main__":
    sys.exit(main())
