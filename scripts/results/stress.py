"""Tables of `skylit stress`: every check, with its figure on each tracer and driver."""

from __future__ import annotations

import math
import re
import textwrap
from typing import Any

from tables import distinct, table

Record = dict[str, Any]
TRACERS = ["pipeline", "query", "compute"]


def number(value: float | None) -> str:
    """A count as it is, other figures with four digits."""
    if value is None or math.isnan(value):
        return "-"
    if value == int(value) and abs(value) < 1e7:
        return str(int(value))
    if 1e-2 <= abs(value) < 1e5:
        return f"{value:.4g}"
    return re.sub(r"e([+-])0*(\d)", r"e\1\2", f"{value:.1e}").replace("e+", "e")


def bound(check: Record) -> str:
    if not check["bound"]:
        return ""
    ((side, value),) = check["bound"].items()
    return ("<= " if side == "at-most" else ">= ") + number(value)


def merged(records: list[Record]) -> list[Record]:
    """Records of one driver become one: the first that has a check gives its figure."""
    out: list[Record] = []
    for r in records:
        before = next((b for b in out if b["driver"] == r["driver"] and b["device"] == r["device"]), None)
        if before is None:
            out.append({**r, "checks": list(r["checks"])})
            continue
        had = {(c["section"], c["name"], c["tracer"]) for c in before["checks"]}
        before["checks"] += [c for c in r["checks"] if (c["section"], c["name"], c["tracer"]) not in had]
    return out


def summary(records: list[Record]) -> list[str]:
    """A line a driver: the number of its checks, and which fail."""
    lines = []
    for r in records:
        failed = [c for c in r["checks"] if c["verdict"] == "fails"]
        named = "".join(f" {c['name']} ({c['tracer'] or 'cpu'}): {c.get('sentence', '')}." for c in failed)
        verb = "fail" if failed else "fails"
        lines.append(f"- {len(r['checks'])} checks on {r['driver']}: {len(failed) or 'none'} {verb}.{named}")
    return lines


def tables(records: list[Record]) -> list[str]:
    """How many checks hold, and all sections, with a column for each tracer of each driver."""
    columns = []
    for r in records:
        driver = re.search(r"Mesa [0-9.]+", r["driver"])
        name = driver.group(0) if driver else r["driver"]
        tracers = {c["tracer"] for c in r["checks"]} - {None, "cpu"}
        columns += [(r, t, f"{t}, {name}") for t in sorted(tracers, key=TRACERS.index)]
    lines = [*summary(records), ""]
    for section in records[0]["sections"]:
        names = distinct(c["name"] for r in records for c in r["checks"] if c["section"] == section["name"])
        if not names:
            continue
        command = f"`skylit stress --sections {section['name']}`"
        lines += [f"## {section['title']}", "", *textwrap.wrap(f"{command}: {section['about']}.", 118), ""]
        rows = [row(name, records, columns) for name in names]
        lines += table(["check", "unit", "bound", *(c[2] for c in columns)], rows)
    return lines


def row(name: str, records: list[Record], columns: list[tuple[Record, str, str]]) -> list[str]:
    bounded = [c for r in records for c in r["checks"] if c["name"] == name and c["bound"]]
    cells, unit, limit = [], "", bound(bounded[0]) if bounded else ""
    for r, tracer, _ in columns:
        check = next((c for c in r["checks"] if c["name"] == name and (c["tracer"] or tracer) == tracer), None)
        if check is None:
            cells.append("")
            continue
        unit, limit = check["unit"] or unit, bound(check) or limit
        mark = {"fails": " **fails**", "reported": " (reported)" if limit else ""}.get(check["verdict"], "")
        cells.append("not applicable" if check["verdict"] == "not-applicable" else number(check["value"]) + mark)
    return [name, unit, limit, *cells]
