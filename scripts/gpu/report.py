#!/usr/bin/env python3
"""The page of what skylit did on a GPU, from the folder that the kit of scripts/gpu.sh wrote there.

    python3 scripts/gpu/report.py RESULTS docs/results/gpu.md   # RESULTS: the folder, or its .tar.gz

Images that are small enough to live in the repository go beside the page, into the folder of its name. Whatever is missing in RESULTS is missing in the page."""

from __future__ import annotations

import json
import re
import shutil
import sys
import tarfile
import tempfile
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parents[1] / "results"))
import pages  # noqa: E402
from tables import number, table  # noqa: E402

# bytes of an image, and of all of them, that may go into the repository
LARGEST = 200_000
ALL = 1_500_000


def load(path: Path) -> Any:
    """A JSON file's contents; None where it is not there or is not whole."""
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError):
        return None


def text(path: Path) -> str:
    try:
        return path.read_text(errors="replace")
    except OSError:
        return ""


def opened(source: Path) -> Path:
    """The folder; an archive is unpacked first."""
    if source.is_dir():
        return source
    folder = Path(tempfile.mkdtemp(prefix="skylit-gpu-"))
    with tarfile.open(source) as archive:
        archive.extractall(folder, filter="data")
    found = next(folder.rglob("steps.tsv"), None)
    if found is None:
        sys.exit(f"report: error: {source}: no steps.tsv in it: is it what run.sh wrote?")
    return found.parent


def steps(folder: Path) -> list[dict[str, str]]:
    lines = [line.split("\t") for line in text(folder / "steps.tsv").splitlines()]
    return [dict(zip(["name", "status", "seconds", "limit", "title"], line)) for line in lines if len(line) == 5]


def machine(folder: Path) -> list[str]:
    about = dict(line.split(" ", 1) for line in text(folder / "about.txt").splitlines() if " " in line)
    doctor = load(folder / "doctor.json") or {}
    device = next((d for d in doctor.get("devices", []) if d.get("index") == doctor.get("device")), {})
    if not device:
        return ["No Vulkan device was found. What was tried:", "", "```", *text(folder / "driver.log").splitlines(), "```", ""]
    limits = device.get("limits", {})
    rows = [
        ["device", f"{device.get('name')} ({device.get('kind')})"],
        ["driver", f"{device.get('driver')}, Vulkan {device.get('api_version')}"],
        ["memory", f"{limits.get('device_memory', 0) / 2**30:.1f} GiB"],
        ["subgroup", str(limits.get("subgroup_size"))],
        ["64-bit integers", "yes" if device.get("int64") else "no"],
        ["rasterization", "yes" if not device.get("missing_raster") else "lacks " + ", ".join(device["missing_raster"])],
        ["picked by `auto`", str(doctor.get("auto"))],
    ]
    for tracer in device.get("tracers", []):
        rows.append([f"tracer `{tracer['tracer']}`", "yes" if not tracer["missing"] else "lacks " + ", ".join(tracer["missing"])])
    for key in ["system", "cpu", "glibc", "date", "commit"]:
        if key in about:
            rows.append([key, about[key]])
    rows.append(["validation layer", about.get("validation", "layer no").removeprefix("layer ")])
    return table(["", ""], rows)


def outcomes(folder: Path) -> list[str]:
    def outcome(step: dict[str, str]) -> str:
        if step["status"] == "0":
            return "passed"
        if step["status"] in ("124", "137"):
            return f"**stopped after its {step['limit']} s**"
        if step["status"] == "left out":
            return "**left out: no time was left**"
        last = [line for line in text(folder / f"{step['name']}.log").splitlines() if line.strip()]
        said = next((line for line in reversed(last) if "error:" in line or "panicked" in line), last[-1] if last else "")
        return f"**failed, exit code {step['status']}**: `{said.strip().replace('|', '/')[:160]}`"

    rows = [[step["title"], outcome(step), step["seconds"]] for step in steps(folder)]
    return table(["step", "outcome", "seconds"], rows)


def parity(folder: Path) -> list[str]:
    rows = []
    for log in sorted(folder.glob("parity-*.log")):
        for line in text(log).splitlines():
            m = re.match(r"(\S+) (.+?) +(closest|any) +against the oracle: (\d+) rays \((\d+) hits\): \d+ agree, (\d+) ties, (\d+) unexplained", line)
            if m:
                rows.append([m[1], m[2], m[3], f"{int(m[4]):,}", m[6], m[7]])
    if not rows:
        return []
    said = "Rays that a rounding error explains are ties; the test passes up to one unexplained ray in 100,000."
    return ["## Parity with the double-precision oracle", "", said, "", *table(["scene", "tracer", "hit", "rays", "ties", "unexplained"], rows)]


def leaks(folder: Path) -> list[str]:
    found = [re.match(r"(.+), (\w+ \(.+\)|\w+): (\d+) leaks of (\d+) any, (\d+) closest", line) for line in text(folder / "leaks.log").splitlines()]
    sums: dict[str, list[int]] = {}
    for m in filter(None, found):
        s = sums.setdefault(m[2], [0, 0, 0])
        s[0], s[1], s[2] = s[0] + int(m[4]), s[1] + int(m[3]), s[2] + int(m[5])
    if not sums:
        return []
    rows = [[who, f"{n:,}", str(a), str(c)] for who, (n, a, c) in sums.items()]
    return ["## Rays aimed at edges and corners of closed bodies", "", *table(["tracer", "rays", "leaks, any hit", "leaks, closest hit"], rows)]


def closed_forms(folder: Path) -> list[str]:
    rows = []
    for log in sorted(folder.glob("ao_*.log")):
        for line in text(log).splitlines():
            m = re.match(r"(.+) (\w+): want ([\d.]+), bias (\S+), standard error (\S+) ", line)
            if m:
                rows.append([m[1], m[2], m[3], m[4], m[5]])
    if not rows:
        return []
    return ["## Ambient occlusion against closed forms", "", *table(["scene", "tracer", "expected", "bias", "standard error"], rows)]


def images(folder: Path) -> list[str]:
    rows = []
    for path in sorted(folder.glob("diff-*.json")):
        record = load(path)
        if record:
            rows.append([path.stem.removeprefix("diff-"), differences(record)])
    lines = ["## Images of the tracers, against the first one's", "", *table(["image", "root mean square difference of each channel"], rows)] if rows else []
    first = [load(folder / f"{name}.log") for name in ("cold", "warm")]
    totals = [(r or {}).get("seconds", {}).get("total") for r in first]
    if all(totals):
        lines += [f"A first image of the Cornell box takes {number(totals[0])} s when pipelines are compiled, {number(totals[1])} s when the driver has them in its cache.", ""]
    return lines


def differences(record: dict[str, Any]) -> str:
    channels = record.get("channels") or []
    if isinstance(channels, dict):
        channels = [{"name": k, **v} for k, v in channels.items()]
    return ", ".join(f"{c.get('name', c.get('channel'))} {number(c.get('rmse'))}" for c in channels if number(c.get("rmse")) != "-") or "-"


def bench(folder: Path) -> list[str]:
    """Presets in real time, of ambient occlusion and of light; rays a second; path tracing."""
    named = [("bench-ao", pages.frames), *((p.stem, pages.frames) for p in sorted(folder.glob("bench-frames*.json")))]
    lines = []
    for name, body in [*named, ("bench-rays", pages.rays), ("bench-path", pages.path)]:
        record = load(folder / f"{name}.json")
        if record:
            settings = record["settings"]
            said = ", ".join(settings[k] for k in ("integrator", "size") if k in settings)
            title = {"bench-rays": "Rays a second", "bench-path": "Path tracing: error against time"}.get(name)
            lines += [f"## {title or f'Frames in real time, {said}'}", ""]
            lines += [re.sub("^## ", "### ", line) for line in [*body(record), *pages.notes(record)]]
    return lines


def stress(folder: Path) -> list[str]:
    rows = []
    for log in sorted(folder.glob("stress-*.log")):
        # the record is the first line; what failed is said after it
        try:
            checks = json.loads(text(log).splitlines()[0])["checks"]
        except (IndexError, KeyError, ValueError):
            continue
        count = lambda verdict: sum(c["verdict"] == verdict for c in checks)
        failed = [f"{c['name']}: {number(c['value'])} {c['unit']}" for c in checks if c["verdict"] == "fails"]
        rows.append([log.stem.removeprefix("stress-"), str(count("holds")), str(count("reported")), str(len(failed)), "; ".join(failed).replace("|", "/") or "none"])
    if not rows:
        return []
    said = "Of `skylit stress`; what a ray-tracing driver answers for is reported, not judged."
    return ["## Numerical stability", "", said, "", *table(["tracer", "hold", "reported", "fail", "which"], rows)]


def gallery(folder: Path, page: Path) -> list[str]:
    target = page.with_suffix("")
    shutil.rmtree(target, ignore_errors=True)
    lines, total, shown = [], 0, set()
    for path in sorted([*folder.glob("*.png"), *folder.glob("*.apng")]):
        size = path.stat().st_size
        # the tracers' images look alike: how far apart they are is in a table
        image = re.sub(r"-(pipeline|query|compute)$", "", path.stem)
        if size > LARGEST or total + size > ALL or image in shown:
            continue
        shown.add(image)
        total += size
        target.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, target / path.name)
        lines.append(f"![{path.stem}]({target.name}/{path.name})")
    return ["## Images", "", *lines, ""] if lines else []


def main() -> None:
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    folder, page = opened(Path(sys.argv[1])), Path(sys.argv[2])
    if not (folder / "steps.tsv").is_file():
        sys.exit(f"report: error: {folder}: no steps.tsv in it: is it what run.sh wrote?")
    every = steps(folder)
    passed = sum(s["status"] == "0" for s in every)
    doctor = load(folder / "doctor.json") or {}
    kinds = {d.get("kind") for d in doctor.get("devices", []) if d.get("index") == doctor.get("device")}
    lines = ["# skylit on a GPU", "", "Written by `./scripts/gpu.sh report` from what the kit of `./scripts/gpu.sh` brought back.", ""]
    if "cpu" in kinds:
        lines += ["**This is no GPU**: the kit found a driver that runs on the CPU, and did little of everything.", ""]
    lines += [*machine(folder), f"{passed} of {len(every)} steps passed.", "", *outcomes(folder)]
    for part in [images, parity, leaks, closed_forms, stress, bench]:
        lines += part(folder)
    lines += gallery(folder, page)
    page.parent.mkdir(parents=True, exist_ok=True)
    page.write_text("\n".join(lines).rstrip() + "\n")
    print(f"report: {page}: {passed} of {len(every)} steps passed")


if __name__ == "__main__":
    main()
