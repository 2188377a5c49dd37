"""The table of tests/mitsuba: each scene beside Mitsuba's image of it."""

from __future__ import annotations

import os
import re
import subprocess
from typing import Any

from tables import distinct, table

Record = dict[str, Any]
HEAD = [
    "scene", "by", "spp", "pixels that pass, %", "largest z of a pixel", "of a tile (rms)", "mean: sigmas", "%", "+- %"
]
# scene | by | tracer | spp | pixels | z | z (rms) | sigmas | % | +- % | seconds
FIGURES = [r"(\S+)", r"(\S+)", r"(\S+ \(\S+\))", *[r"(\S+)"] * 3]
ROW = re.compile(r"^\s*([\w.-]+) \| (\w+) \| (\w+) \| (\d+) \| " + r" \| ".join(FIGURES))


def measure(words: list[str]) -> Record:
    """Runs the tests with cargo and reads the rows that they print."""
    environment = {**os.environ, "SKYLIT_MITSUBA": ""}
    output = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    done = subprocess.run(["cargo", *words], env=environment, check=False, **output)
    rows = [list(m.groups()) for line in done.stdout.splitlines() if (m := ROW.match(line))]
    if not rows:
        raise RuntimeError((done.stdout.strip().splitlines() or ["cargo said nothing"])[-1])
    return {"passed": done.returncode == 0, "rows": rows}


def tables(records: list[Record]) -> list[str]:
    lines: list[str] = []
    for record in records:
        lines += [] if record["passed"] else ["**The test fails.**", ""]
        for tracer in distinct(row[2] for row in record["rows"]):
            rows = [[*row[:2], *row[3:]] for row in record["rows"] if row[2] == tracer]
            lines += [f"## Tracer `{tracer}`, {len(rows)} scenes", "", *table(HEAD, rows)]
    return lines
