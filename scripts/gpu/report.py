#!/usr/bin/env python3
"""The page of what skylit did on a GPU, from the folder that the kit of scripts/gpu.sh wrote there.

    python3 scripts/gpu/report.py RESULTS docs/gpu.md      # RESULTS: the folder, or its .tar.gz

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


def number(x: Any) -> str:
    """Three digits that count."""
    if not isinstance(x, (int, float)):
        return "-"
    if x == 0 or 0.001 <= abs(x) < 1000:
        return f"{x:.3g}"
    return f"{x:,.0f}" if abs(x) >= 1000 else f"{x:.1e}"


def table(head: list[str], rows: list[list[str]]) -> list[str]:
    return ["| " + " | ".join(head) + " |", "|" + "---|" * len(head), *("| " + " | ".join(r) + " |" for r in rows), ""]


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


def milliseconds(cost: Any, clock: str = "device_ms") -> str:
    """The median, and what 95 % of frames keep within."""
    return f"{number(cost[clock]['median'])} ({number(cost[clock]['p95'])})" if cost else "-"


def rmse(record: Any) -> str:
    return number(((record or {}).get("errors") or {}).get("rmse"))


def passes(cost: Any) -> str:
    return ", ".join(f"{p['pass']} {number(p['ms']['median'])}" for p in (cost or {}).get("passes", []))


def presets(folder: Path) -> list[str]:
    record = load(folder / "bench-ao.json")
    if not record:
        return []
    width, height = record["size"]
    lines = [f"## Presets in real time, {width}x{height}", "", f"Tracer `{record['tracer']}`, {record['frames']} frames; times are the device's, milliseconds a frame: the median, and what 95 % of frames keep within.", ""]
    for view in record["views"]:
        rows = []
        for r in view["results"]:
            still, moving = r.get("still") or {}, r.get("moving") or {}
            curve = still.get("curve") or [None]
            costs = [still.get("cost"), moving.get("cost")]
            rows.append([f"`{r['preset']}`", r["primary"], *map(milliseconds, costs), rmse(curve[0]), rmse(curve[-1]), rmse(moving), passes(costs[1] or costs[0])])
        lines += [f"{view['scene']}, {view['view']}: {view['primitives']:,} primitives", ""]
        lines += table(["preset", "camera rays", "still", "moving", "RMSE of frame 1", "RMSE settled", "RMSE moving", "passes"], rows)
    return lines + notes(record)


def light(folder: Path) -> list[str]:
    records = [load(path) for path in sorted(folder.glob("bench-frames*.json"))]
    return [line for record in records if record for line in frames_of_light(record)]


def frames_of_light(record: dict[str, Any]) -> list[str]:
    width, height = record["size"]
    lines = [f"## Path tracing in real time, {width}x{height}", "", f"Tracer `{record['tracer']}`, {record['frames']} frames, references of {record['reference_paths']} paths a pixel. Milliseconds a frame: by the device's clock, the median (what 95 % of frames keep within), and by the program's, with all that it does besides. RMSE: of the last frame, beside plain accumulation's at equal time.", ""]
    for view in record["views"]:
        rows = []
        for r in view["still"]:
            last = (r["curve"] or [{}])[-1]
            rows.append([f"`{r['preset']}`", "still", milliseconds(r["cost"]), milliseconds(r["cost"], "wall_ms"), f"{rmse(last)} / {rmse(last.get('plain'))}", passes(r["cost"])])
        for m in view["motions"]:
            rows += [[f"`{r['preset']}`", m["motion"], milliseconds(r["cost"]), milliseconds(r["cost"], "wall_ms"), f"{rmse(r)} / {rmse(r.get('plain'))}", passes(r["cost"])] for r in m["results"]]
        lines += [f"{view['scene']}: {view['primitives']:,} primitives", ""]
        lines += table(["preset", "motion", "device ms", "wall ms", "RMSE / plain", "passes, ms"], rows)
    return lines + notes(record)


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


def rays(folder: Path) -> list[str]:
    record = load(folder / "bench-rays.json")
    if not record:
        return []
    lines = ["## Rays a second", "", f"Millions, by the device's clock; the median of {record['repeats']}.", ""]
    for scene in record["scenes"]:
        names = list(dict.fromkeys(r["contestant"] for s in scene["streams"] for r in s["results"]))
        rows = []
        for stream in scene["streams"]:
            by_name = {r["contestant"]: r for r in stream["results"]}
            rows.append([stream["stream"], *(number((by_name.get(n) or {}).get("device", {}).get("median")) for n in names)])
        builds = ", ".join(f"{b['contestant']} {number(1000 * b['build_seconds'])} ms" for b in scene["builds"])
        wrong = sum(c["unexplained"] for c in scene.get("checks", []))
        checked = sum(c["rays"] for c in scene.get("checks", []))
        lines += [f"{scene['scene']}: {scene['triangles']:,} triangles; built in {builds}; of {checked:,} answers that were compared, {wrong} unexplained", ""]
        lines += table(["rays", *(f"`{n}`" for n in names)], rows)
    return lines + notes(record)


def paths(folder: Path) -> list[str]:
    record = load(folder / "bench-path.json")
    if not record:
        return []
    lines = ["## Path tracing: error against time", "", f"Tracer `{record['tracer']}`.", ""]
    for scene in record["scenes"]:
        rows = []
        for r in scene["results"]:
            for p in r["points"][-1:]:
                rows.append([f"`{r['name']}`", str(p["spp"]), number(p["seconds"]["median"]), number(p["rmse"]), number(r.get("mpaths")), number(r.get("mrays"))])
        lines += [f"{scene['scene']}, {scene['size'][0]}x{scene['size'][1]}", ""]
        lines += table(["sampling", "samples a pixel", "seconds", "RMSE", "Mpaths/s", "Mrays/s"], rows)
    return lines + notes(record)


def notes(record: dict[str, Any]) -> list[str]:
    found = [f"- {n}" for n in record.get("notes", [])]
    return [*found, ""] if found else []


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


# what is written by hand stays when the page is made anew
NOTES = ["<!-- notes: what is between these two lines is written by hand, and kept -->", "<!-- end of notes -->"]


def kept(page: Path) -> list[str]:
    old = text(page)
    if not all(mark in old for mark in NOTES):
        return []
    return [NOTES[0], *old.split(NOTES[0], 1)[1].split(NOTES[1], 1)[0].splitlines()[1:], NOTES[1], ""]


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
    lines += [*kept(page), *machine(folder), f"{passed} of {len(every)} steps passed.", "", *outcomes(folder)]
    for part in [images, parity, leaks, closed_forms, stress, presets, light, rays, paths]:
        lines += part(folder)
    lines += gallery(folder, page)
    page.parent.mkdir(parents=True, exist_ok=True)
    page.write_text("\n".join(lines).rstrip() + "\n")
    print(f"report: {page}: {passed} of {len(every)} steps passed")


if __name__ == "__main__":
    main()
