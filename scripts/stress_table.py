#!/usr/bin/env python3
"""Makes the tables of docs/stress.md: every check of `skylit stress`, with its figure on each tracer and driver.

    skylit stress --json > new.json                                            # on the newest driver
    for t in compute pipeline query; do skylit stress --json --tracer $t > $t.json; done   # sections that shade run on one tracer only
    VK_DRIVER_FILES=... VK_ICD_FILENAMES=... skylit stress --json > floor.json   # on the oldest
    python3 scripts/stress_table.py new.json compute.json pipeline.json query.json floor.json

Records of one driver share their columns: the first that has a figure gives it.
"""

import json
import math
import re
import sys


def number(value):
    if value is None or math.isnan(value):
        return "-"
    if value == int(value) and abs(value) < 1e7:
        return str(int(value))
    return f"{value:.4g}" if 1e-2 <= abs(value) < 1e5 else f"{value:.1e}".replace("e-0", "e-").replace("e+0", "e").replace("e+", "e")


def bound(check):
    if not check["bound"]:
        return ""
    (side, value), = check["bound"].items()
    # those that depend on an image's noise are its tracer's
    return ("<= " if side == "at-most" else ">= ") + number(value)


def main(files):
    records = []
    for r in (json.load(open(f)) for f in files):
        before = next((b for b in records if b["driver"] == r["driver"] and b["device"] == r["device"]), None)
        if before is None:
            records.append(r)
            continue
        had = {(c["section"], c["name"], c["tracer"]) for c in before["checks"]}
        before["checks"] += [c for c in r["checks"] if (c["section"], c["name"], c["tracer"]) not in had]
    columns = []
    for r in records:
        driver = re.search(r"Mesa [0-9.]+", r["driver"])
        name = driver.group(0) if driver else r["driver"]
        tracers = sorted({c["tracer"] or "cpu" for c in r["checks"]} - {"cpu"}, key=["pipeline", "query", "compute"].index)
        columns += [(r, t, f"{t}, {name}") for t in tracers]
    for r in records:
        failed = [c for c in r["checks"] if c["verdict"] == "fails"]
        lines = "".join(f" {c['name']} ({c['tracer'] or 'cpu'}): {c['sentence']}." for c in failed)
        print(f"- {len(r['checks'])} checks on {r['driver']}: {len(failed) or 'none'} fail{'' if failed else 's'}.{lines}")
    print()
    for section in records[0]["sections"]:
        names = list(dict.fromkeys(c["name"] for r in records for c in r["checks"] if c["section"] == section["name"]))
        if not names:
            continue
        print(f"### {section['title']}\n\n`skylit stress --sections {section['name']}`: {section['about']}.\n")
        print("| check | unit | bound | " + " | ".join(c[2] for c in columns) + " |")
        print("|---|---|---|" + "---|" * len(columns))
        for name in names:
            of_name = [c for r in records for c in r["checks"] if c["name"] == name and c["bound"]]
            cells, unit, limit = [], "", bound(of_name[0]) if of_name else ""
            for r, tracer, _ in columns:
                found = [c for c in r["checks"] if c["name"] == name and (c["tracer"] or tracer) == tracer]
                if not found:
                    cells.append("")
                    continue
                check = found[0]
                unit, limit = check["unit"] or unit, bound(check) or limit
                mark = {"fails": " **fails**", "reported": " (reported)" if limit else ""}.get(check["verdict"], "")
                cells.append("not applicable" if check["verdict"] == "not-applicable" else number(check["value"]) + mark)
            print(f"| {name} | {unit} | {limit} | " + " | ".join(cells) + " |")
        print()


if __name__ == "__main__":
    main(sys.argv[1:] or sys.exit(__doc__))
