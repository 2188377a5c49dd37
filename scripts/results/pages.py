"""The text of the pages of docs/results, each from its record."""

from __future__ import annotations

import re
import statistics
import textwrap
from pathlib import Path
from typing import Any

import ao_versus_path
import mitsuba_scenes
import stress
from tables import along, distinct, find, middle, number, table, value

# parts of `skylit bench frames` that have a table
MOTIONS = ["still", "still, camera rays", "orbit", "sun", "slide", "animation"]
PAGES = Path(__file__).resolve().parents[2] / "docs/results"
Record = dict[str, Any]

TITLES = {
    "rays": "Rays a second",
    "frames": "Light in real time",
    "ao": "Ambient occlusion in real time",
    "path": "Path tracing: error against time",
    "builders": "Hierarchies for rays that are known",
    "stress": "Numerical stability",
    "ao-versus-path": "Ambient occlusion against path tracing",
    "mitsuba": "Images beside Mitsuba's",
    "gpu": "On a GPU",
}
ABOUT = {
    "index": """What the benchmarks and checks found at their last run, with a main figure of each page. Each page has
        its machine, date and command at the top. `python3 scripts/results.py` writes it from a record in [data](data).
        What was found before is in the [notebook](../notebook/README.md).
        [Benchmarks](../reference/benchmarks.md) says what is measured, and how to measure yourself.""",
    "rays": """Millions of rays a second by the time on the device, medians of repeats, of each kernel of the compute
        tracer and of each peer that was there. [Benchmarks](../reference/benchmarks.md) says what each stream of rays
        is.""",
    "frames": """Frames of light in real time beside plain accumulation: what a frame takes, and how far it is from a
        converged image. "Over plain" is the error over that of paths without histories and filter in the same time:
        below 1 a preset is worth its time.""",
    "ao": """Frames of ambient occlusion in real time: what a frame of each preset takes, the rays that it traces, and
        how far it is from a converged image. `larsen` is the pipeline of Larsen (2019).""",
    "path": """How the error of path tracing falls with time: images of more and more samples by each sampling strategy,
        and by each peer that was there. Errors are RMSE against a reference of the same engine.""",
    "builders": """Costs of rays in trees that were built for them, by the weights of the surface area heuristic: 2 a
        node and 1.2 a primitive. [Hierarchies](../reference/bvh.md) says what each builder does.""",
    "stress": """Every check of `skylit stress` with its bound and its figure on each tracer. A figure without a bound
        is reported and never fails.""",
    "ao-versus-path": """How much of the light that ambient light stands for is explained, in per cent, by ambient light
        without occlusion ("none"), by ambient occlusion without a limit, with the best radius, with the best falloff,
        and by `ao-sky` in its place. "Bounces" is the share of the light, in per cent, that has bounced off two
        surfaces or more, "halves" the distance at which the occlusion of a hit halves. A distance is "none" where it
        explains less than a tenth of a point more than no occlusion, and "or more" stands at the end of the search.""",
    "mitsuba": """Path-traced images against those of Mitsuba 3, an independent renderer, scene by scene. A z is a
        difference in standard errors. [Mitsuba](../design/mitsuba.md) says what each scene is for and which z
        passes.""",
}


def wrapped(text: str) -> list[str]:
    return textwrap.wrap(" ".join(text.split()), 118, break_long_words=False, break_on_hyphens=False)


def head(page: str, data: Record) -> list[str]:
    """Title, what the page is about, and the machine."""
    machine = data["machine"]
    threads = machine.get("threads")
    rows = [
        ["CPU", machine["cpu"] + (f", {threads} threads" if threads else "")],
        ["device", machine["device"]],
        ["driver", machine["driver"]],
        ["skylit", data["version"] + (f", commit {data['commit']}" if data["commit"] else "")],
        ["date", data["date"] + (", measured with `--quick`" if data.get("quick") else "")],
        ["peers", ", ".join(data.get("record", {}).get("peers", []))],
        ["note", data.get("note") or ""],
    ]
    command = [f"    {c}" for c in data["commands"] if c]
    machine_table = table(["", ""], [r for r in rows if r[1]])
    return [f"# {TITLES[page]}", "", *wrapped(ABOUT[page]), "", *machine_table, *command, ""]


def plot(page: str) -> list[str]:
    found = (PAGES / f"{page}.svg").is_file()
    return [f"![{TITLES[page]}: charts of the record]({page}.svg)", ""] if found else []


def notes(record: Record) -> list[str]:
    found = [line for n in record.get("notes", []) for line in textwrap.wrap(f"- {n}", 118, subsequent_indent="  ")]
    return ["## Notes", "", *found, ""] if found else []


def remarks(record: Record, scene: str) -> list[str]:
    """The size of a scene, and what the benchmark says of its results."""
    of_scene = next((s for s in record["scenes"] if s["scene"] == scene), {"about": "", "remarks": []})
    lines = wrapped(of_scene["about"] + ".") if of_scene["about"] else []
    said = [line for r in of_scene["remarks"] for line in textwrap.wrap(f"- {r}", 118, subsequent_indent="  ")]
    return [*lines, *([""] if lines else []), *said, *([""] if said else [])]


def measured_scenes(record: Record) -> list[str]:
    return distinct(m["scene"] for m in record["measurements"])


def spread(m: Record) -> str:
    """The median, and how far 95 % of repeats lie at most."""
    values = m["values"]
    return f"{number(values['median'])} ({number(values['p95'])})" if isinstance(values, dict) else number(values)


def rays(record: Record) -> list[str]:
    lines: list[str] = []
    streams = distinct(m["part"] for m in record["measurements"] if m["quantity"] == "rate")
    for stream in streams:
        rates = [m for m in record["measurements"] if m["part"] == stream and m["quantity"] == "rate"]
        kernels = distinct(m["contestant"] for m in rates)
        rate = {(m["scene"], m["contestant"]): number(middle(m)) for m in rates}
        rows = []
        for scene in distinct(m["scene"] for m in rates):
            visits = [value_at(find(record, scene, stream), "wide", q) for q in ("nodes a ray", "leaves a ray")]
            rows.append([scene, *(rate.get((scene, k), "-") for k in kernels), *map(number, visits)])
        lines += [f"## {stream}", ""]
        lines += table(["Mrays/s", *(f"`{k}`" for k in kernels), "nodes a ray", "leaves a ray"], rows)
    rows = []
    for scene in measured_scenes(record):
        own = find(record, scene, "building")
        for kernel in distinct(m["contestant"] for m in own):
            built = [number(value(own, kernel, q)) for q in ("build", "bytes a primitive", "SAH cost")]
            rows.append([scene, f"`{kernel}`", *built])
    lines += ["## building", "", *table(["scene", "kernel", "build, s", "bytes a primitive", "SAH cost"], rows)]
    checked, wrong = (total(record, q) for q in ("compared", "unexplained"))
    said = f"Of {checked:,.0f} answers that were compared {wrong:.0f} are unexplained."
    return lines + ([said, ""] if checked else [])


def total(record: Record, quantity: str) -> float:
    return sum(middle(m) for m in record["measurements"] if m["quantity"] == quantity)


def value_at(all: list[Record], contestant: str, quantity: str) -> Any:
    """The single value of a quantity, with or without the size of its scene."""
    return next((middle(m) for m in all if m["contestant"] == contestant and m["quantity"] == quantity), None)


def frames(record: Record) -> list[str]:
    settings = ", ".join(f"{k} {v}" for k, v in record["settings"].items())
    times = """Times are milliseconds a frame: by the device's clock, the median and what 95 % of frames keep within,
        and by the program's clock. RMSE is without the reference's own error."""
    lines = [*wrapped(f"Settings: {settings}. {times}"), ""]
    quantities = ["corrected RMSE", "rays" if record["settings"].get("integrator") == "ao" else "over plain"]
    for scene in measured_scenes(record):
        parts = [p for p in MOTIONS if find(record, scene, p)]
        if not parts:
            continue
        lines += [f"## {scene}", "", *remarks(record, scene)]
        for part in parts:
            rows, passes = [], {}
            for preset in presets(find(record, scene, part)):
                own = [m for m in find(record, scene, part) if m["contestant"] == preset and not along(m)]
                timed = [next((spread(m) for m in own if m["quantity"] == q), "-") for q in ("time", "wall time")]
                rows.append([f"`{preset}`", *timed, *(number(value(own, preset, q)) for q in quantities)])
                of_pass = [m for m in find(record, scene, f"{part}, passes") if m["contestant"] == preset]
                passes[preset] = ", ".join(f"{m['quantity']} {number(middle(m))}" for m in of_pass)
            lines += table([part, "device, ms", "wall, ms", "RMSE", quantities[1]], rows)
            lines += [f"- `{p}`, passes in ms: {found}" for p, found in passes.items() if found]
            lines += [""] if any(passes.values()) else []
        still = find(record, scene, "still")
        lines += by_axis(still, "corrected RMSE", "RMSE of a still camera after so many frames")
        if quantities[1] == "over plain":
            lines += by_axis(still, "plain RMSE", "RMSE of plain accumulation in the time of these frames")
    return lines


def presets(all: list[Record]) -> list[str]:
    return [c for c in distinct(m["contestant"] for m in all) if not c.startswith("reference")]


def by_axis(all: list[Record], quantity: str, about: str) -> list[str]:
    """A row a contestant, a column a place along the axis."""
    own = [m for m in all if m["quantity"] == quantity and along(m) and not m["contestant"].startswith("reference")]
    if not own:
        return []
    places = sorted({m["at"]["value"] for m in own})
    found = {(m["contestant"], m["at"]["value"]): number(middle(m)) for m in own}
    rows = [[f"`{c}`", *(found.get((c, p), "") for p in places)] for c in distinct(m["contestant"] for m in own)]
    return [f"{about}:", "", *table(["", *(f"{p:g}" for p in places)], rows)]


def path(record: Record) -> list[str]:
    columns = ["greatest", "image", "its RMSE", "bad pixels", "paths", "rays", "times as long"]
    names = ["samples a pixel", "seconds", "RMSE", "bad pixels", "Mpaths/s", "Mrays/s", "times as long"]
    lines: list[str] = []
    for scene in measured_scenes(record):
        own = find(record, scene, "images")
        rows = [[f"`{c}`", *(number(value(own, c, q)) for q in columns)] for c in presets(own)]
        lines += [f"## {scene}", "", *remarks(record, scene), *table(["", *names], rows)]
        lines += by_axis(own, "RMSE", "RMSE by samples a pixel")
    return lines


def beside_his(all: list[Record], contestant: str, quantity: str, his: str) -> str:
    return f"{number(value(all, contestant, quantity))} ({number(value(all, contestant, his))})"


def builders(record: Record) -> list[str]:
    lines: list[str] = []
    falcone = "Falcone: all placements"
    costs = [m for m in record["measurements"] if m["quantity"] == "cost"]
    placements = distinct(m["part"] for m in costs if m["scene"] == falcone)
    if placements:
        variants = distinct(m["contestant"] for m in find(record, falcone, placements[0]))
        rows = []
        for part in placements:
            own = find(record, falcone, part)
            local = [beside_his(own, v, "cost", "his") for v in variants]
            whole = beside_his(own, "sah-longest", "whole tree", "his whole tree")
            rows.append([part, *local, whole, number(value(own, "sah-longest", "default"))])
        said = "Means over eight scenes of the cost of a ray in local trees, in parentheses his (Falcone 2024);"
        lines += ["## Falcone's placements", "", *wrapped(f"{said} beside trees over the whole scene."), ""]
        lines += table(["placement", *(f"`{v}`" for v in variants), "whole, `sah-longest`", "whole, `default`"], rows)
        quantities = ["Pearson", "Spearman", "mean ratio to his"]
        for part in distinct(m["part"] for m in record["measurements"] if m["part"].startswith("correlation")):
            own = find(record, falcone, part)
            names = distinct(m["contestant"] for m in own)
            rows = [[f"`{c}`", *(number(value(own, c, q)) for q in quantities)] for c in names]
            said = f"Over placements, ours beside his, {part.removeprefix('correlation, ')}:"
            lines += [said, "", *table(["", *quantities], rows)]
    for scene in [s for s in measured_scenes(record) if not s.startswith("Falcone")]:
        own = [m for m in costs if m["scene"] == scene]
        parts = distinct(m["part"] for m in own)
        cost = {(m["contestant"], m["part"]): middle(m) for m in own}
        least = {p: min(v for (_, q), v in cost.items() if q == p) for p in parts}
        rows = []
        for c in distinct(m["contestant"] for m in own):
            cells = [f"{cost[c, p]:.1f}" if (c, p) in cost else "" for p in parts]
            bold = [cost.get((c, p)) == least[p] for p in parts]
            rows.append([f"`{c}`", *(f"**{x}**" if b else x for x, b in zip(cells, bold, strict=True))])
        lines += [f"## {scene}", "", "Costs of a ray, the least in bold.", "", *table(["", *parts], rows)]
    return lines


def gpu_line() -> str:
    """The line of the index about the page that scripts/gpu.sh writes."""
    text = (PAGES / "gpu.md").read_text() if (PAGES / "gpu.md").is_file() else ""
    found = {k: m[1] for k in ("device", "date") if (m := re.search(rf"^\| {k} \| (.*) \|$", text, re.M))}
    steps = m[1] if (m := re.search(r"^(\d+ of \d+ steps) passed\.$", text, re.M)) else ""
    rays = "[rays a second](gpu.md#rays-a-second)" if "## Rays a second" in text else ""
    figure = "; ".join(x for x in (f"{steps} of tests and benchmarks pass" if steps else "", rays) if x)
    return f"| [{TITLES['gpu']}](gpu.md) | {figure} | {found.get('date', '')} | {found.get('device', '')} | |"


def extent(values: list[float]) -> str:
    """The least and the greatest of figures."""
    ends = [number(x) for x in (min(values), max(values))]
    return ends[0] if ends[0] == ends[1] else f"{ends[0]} to {ends[1]}"


def leading(cell: str) -> float:
    """The number that a cell begins with; ~ before it says that it is known less well."""
    return float(re.match(r"~?(\d*\.?\d+)", cell)[1])  # type: ignore[index]


def earlier_ratios(page: str, table: Record) -> list[float]:
    """What the main figure of a page is taken from, of an earlier page's first table."""
    head, rows = table["head"], table["rows"]
    if page == "rays":
        return [float(re.search(r"\((\S+) /", cell)[1]) for cell in rows[0][1:]]  # type: ignore[index]
    if page == "frames":
        return [leading(r[head.index("still, ratio after 1, 2, 4")]) for r in rows if r[1] == "`balanced`"]
    if page == "ao":
        ours, his = (head.index(f"error, `{preset}`") for preset in ("balanced", "larsen"))
        return [leading(r[ours]) / leading(r[his]) for r in rows]
    return [leading(r[head.index("times as long as multijitter")]) for r in rows]


def measured(record: Record, part: str, contestant: str, quantity: str) -> list[float]:
    """A quantity of a contestant in all scenes that have it."""
    found = (value(find(record, s, part), contestant, quantity) for s in measured_scenes(record))
    return [x for x in found if isinstance(x, (int, float))]


def record_figure(page: str, record: Record) -> str:
    """The main figure of a page whose record was kept."""
    if page == "rays":
        rates = measured(record, "primary", "packet", "rate") or measured(record, "primary", "wide", "rate")
        return f"primary rays: {extent(rates)} Mrays/s" if rates else ""
    if page == "frames":
        ratios = measured(record, "still", "balanced", "over plain")
        return f"`balanced`, still camera: {extent(ratios)} of the error of plain accumulation" if ratios else ""
    if page == "ao":
        errors = measured(record, "still", "balanced", "corrected RMSE")
        return f"`balanced`, still camera: RMSE {extent(errors)}" if errors else ""
    if page == "path":
        errors = measured(record, "images", "mis", "its RMSE")
        return f"`mis`: RMSE {extent(errors)} at the most samples" if errors else ""
    scenes = [s for s in measured_scenes(record) if not s.startswith("Falcone")]
    costs = [
        {m["contestant"]: middle(m) for m in find(record, s, "camera") if m["quantity"] == "cost"} for s in scenes
    ]
    ratios = [c["default"] / min(c.values()) for c in costs if "default" in c]
    return f"camera rays: `default` costs {extent(ratios)} times the least" if ratios else ""


def merged_figure(page: str, records: list[Record]) -> str:
    """The main figure of a page of several records."""
    if page == "stress":
        verdicts = [c["verdict"] for r in records for c in r["checks"]]
        held, failed = verdicts.count("holds"), verdicts.count("fails")
        return f"{held:,} figures with a bound hold, {failed or 'none'} {'fail' if failed > 1 else 'fails'}"
    if page == "mitsuba":
        scenes = distinct(row[0] for r in records for row in r["rows"])
        passed = all(r["passed"] for r in records)
        return f"{len(scenes)} scenes, {'all pass' if passed else 'not all pass'}"
    fits = [f["rows"] for r in records for f in r["path"] if f["environment_light"] == "ambient"]
    best = [row["explained"] for rows in fits for row in rows if row["name"] == "AO with the best falloff"]
    flat = [row["explained"] for rows in fits for row in rows if row["name"] == "ambient light without occlusion"]
    ours, none = (f"{100 * statistics.median(x):.1f} %" for x in (best, flat))
    said = f"in place of environment and bounces, AO with the best falloff explains {ours}, ambient light alone {none}"
    return f"{said} (medians of scenes)"


EARLIER = {
    "rays": "primary rays: {} times Embree's rate, one ray at a time (robust)",
    "frames": "`balanced`, first frame of a still camera: {} of the error of plain accumulation",
    "ao": "`balanced`, still camera: {} of the error of `larsen`",
    "path": "`mis`: {} times as long as Mitsuba to the same error",
}


def main_figure(page: str, data: Record) -> str:
    if "tables" in data:
        return EARLIER[page].format(extent(earlier_ratios(page, data["tables"][0]))) if page in EARLIER else ""
    return merged_figure(page, data["records"]) if page in MERGED else record_figure(page, data["record"])


def index(records: dict[str, Record]) -> list[str]:
    rows = []
    for page, data in records.items():
        machine, note = data["machine"], data.get("note") or ("measured with `--quick`" if data.get("quick") else "")
        where = f"{machine['cpu']}, {machine['driver']}"
        rows.append([f"[{TITLES[page]}]({page}.md)", main_figure(page, data), data["date"], where, note])
    head = ["page", "main figure", "date", "machine", "note"]
    lines = ["# Results", "", *wrapped(ABOUT["index"]), "", *table(head, rows)]
    return [*lines[:-1], gpu_line(), ""]


BODIES = {"rays": rays, "frames": frames, "ao": frames, "path": path, "builders": builders}
# of several records, one a driver or a scene
MERGED = {
    "stress": lambda records: stress.tables(stress.merged(records)),
    "ao-versus-path": ao_versus_path.tables,
    "mitsuba": mitsuba_scenes.tables,
}


def body(page: str, data: Record) -> list[str]:
    # of records that were not kept there are the tables of an earlier page
    if "tables" in data:
        return [line for t in data["tables"] for line in earlier(t)]
    if page in MERGED:
        return [*MERGED[page](data["records"]), *notes(data)]
    return [*plot(page), *BODIES[page](data["record"]), *notes(data["record"])]


def earlier(found: Record) -> list[str]:
    about = [*wrapped(found["about"]), ""] if found["about"] else []
    return [f"## {found['title']}", "", *about, *table(found["head"], found["rows"])]


def pages(records: dict[str, Record]) -> dict[Path, str]:
    """All pages that there is a record for, and their index."""
    made = {page: [*head(page, data), *body(page, data)] for page, data in records.items()}
    made["index"] = index(records)
    return {PAGES / f"{page}.md": "\n".join(lines).rstrip() + "\n" for page, lines in made.items()}
