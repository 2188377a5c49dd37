#!/usr/bin/env python3
"""Markdown tables of a JSON record of `skylit bench`, so that no figure is typed.

    python3 scripts/results/tables.py RECORD.json                                    # every part of every scene
    python3 scripts/results/tables.py RECORD.json --part still --quantities "time,RMSE,over plain"
    python3 scripts/results/tables.py RECORD.json --part still --quantities RMSE --along   # by frame

A row a contestant, a column a quantity; with --along a column a place along the axis."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

Measurement = dict[str, Any]


def number(x: Any) -> str:
    """Three digits that count."""
    if not isinstance(x, (int, float)):
        return "-"
    if x == 0 or 0.001 <= abs(x) < 1000:
        return f"{x:.3g}"
    return f"{x:,.0f}" if abs(x) >= 1000 else f"{x:.1e}"


def middle(m: Measurement) -> Any:
    """The value, or the median of repeated ones."""
    values = m["values"]
    return values["median"] if isinstance(values, dict) else values


def along(m: Measurement) -> bool:
    """Is it one of several along an axis? Sizes of scenes are none: a scene has one."""
    return m.get("at") is not None and m["at"]["axis"] != "triangles and spheres"


def find(record: dict[str, Any], scene: str, part: str) -> list[Measurement]:
    """All measurements of a part of a scene."""
    return [m for m in record["measurements"] if m["scene"] == scene and m["part"] == part]


def value(all: list[Measurement], contestant: str, quantity: str) -> Any:
    """A result that stands alone; None where there is none."""
    found = (m for m in all if m["contestant"] == contestant and m["quantity"] == quantity and not along(m))
    return next((middle(m) for m in found), None)


def distinct(names: Any) -> list[Any]:
    """Each name once, in the order of their first occurrence."""
    return list(dict.fromkeys(names))


def title(m: Measurement) -> str:
    """The heading of a quantity's column."""
    return f"{m['quantity']}, {m['unit']}" if m["unit"] else m["quantity"]


def table(head: list[str], rows: list[list[str]]) -> list[str]:
    """Lines of a Markdown table, and an empty one."""
    return ["| " + " | ".join(head) + " |", "|" + "---|" * len(head), *("| " + " | ".join(r) + " |" for r in rows), ""]


def pivot(all: list[Measurement], column: Any) -> list[str]:
    """A row a contestant and a column for each value of `column`."""
    columns = distinct(column(m) for m in all)
    rows = []
    for contestant in distinct(m["contestant"] for m in all):
        own = {column(m): number(middle(m)) for m in all if m["contestant"] == contestant}
        rows.append([f"`{contestant}`", *(own.get(c, "") for c in columns)])
    return table(["", *(str(c) for c in columns)], rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("record", type=Path)
    parser.add_argument("--scene")
    parser.add_argument("--part")
    parser.add_argument("--quantities", help="names, separated by commas")
    parser.add_argument("--along", action="store_true")
    arguments = parser.parse_args()
    record = json.loads(arguments.record.read_text())
    # a file of docs/results/data holds the record
    record = record.get("record", record)
    wanted = arguments.quantities.split(",") if arguments.quantities else None
    chosen = [m for m in record["measurements"] if wanted is None or m["quantity"] in wanted]
    for scene in distinct(m["scene"] for m in chosen):
        for part in distinct(m["part"] for m in chosen if m["scene"] == scene):
            if arguments.scene not in (None, scene) or arguments.part not in (None, part):
                continue
            own = [m for m in chosen if m["scene"] == scene and m["part"] == part and along(m) == arguments.along]
            if not own:
                continue
            print(f"{scene}, {part}\n")
            if arguments.along:
                for name in distinct(title(m) for m in own):
                    print(f"{name} by {own[0]['at']['axis']}\n")
                    print("\n".join(pivot([m for m in own if title(m) == name], lambda m: f"{m['at']['value']:g}")))
            else:
                print("\n".join(pivot(own, title)))


if __name__ == "__main__":
    main()
