"""Tables of `skylit compare ao-vs-path` of many scenes, and the scenes."""

import json
import subprocess
import sys
import time
from pathlib import Path

from tables import table

NAVE = ["--eye=-120,20,-5", "--target=50,35,0", "--fov-y=70", "--light=sphere position=30,70,-5 radius=4 radiance=400"]
SUN = "sun direction=-1,-3,-2 irradiance=3 angle=0.5"
SKY = "--environment=1,1,1"
# name, scene, options
SCENES = [
    ("Sponza, nave, lamp", "sponza/sponza.glb", NAVE),
    ("FlightHelmet, sky", "flight_helmet/FlightHelmet.gltf", [SKY]),
    ("FlightHelmet, sun and sky", "flight_helmet/FlightHelmet.gltf", ["--environment=0.3,0.4,0.6", "--light=" + SUN]),
    ("CornellBox-Original (.brhan)", "brhan/scenes", []),
    ("atrium, sky", "builtin:atrium", [SKY]),
    ("atrium, sun and sky", "builtin:atrium", ["--environment=0.3,0.4,0.6", "--light=" + SUN]),
    ("stairs, sky", "builtin:stairs", [SKY]),
    ("stairs, sun and sky", "builtin:stairs", ["--environment=0.3,0.4,0.6", "--light=" + SUN]),
    ("Cornell box", "builtin:cornell-box", []),
    ("Cornell box, empty", "builtin:cornell-empty", []),
    ("Cornell box, spheres", "builtin:cornell-spheres", []),
    ("grid of tori, sky", "builtin:grid", [SKY]),
    ("spheres, sky", "builtin:spheres", [SKY]),
    ("leaf cards, sky", "builtin:leaf-cards", [SKY]),
    ("terrain, sun and sky", "builtin:terrain:100000", ["--environment=0.3,0.4,0.6", "--light=" + SUN]),
    ("sphere over plane, sky", "builtin:sphere-over-plane", [SKY]),
    ("groove of 90 degrees, sky", "builtin:v-groove", [SKY]),
    ("parallel planes, sky", "builtin:parallel-planes", [SKY]),
]
FLAT, UNLIMITED, EXACT = "ambient light without occlusion", "AO without radius or falloff", "ao-sky in place of AO"
SKY_FLAT, RADIUS, FALLOFF = "the same everywhere", "AO with the best radius", "AO with the best falloff"
# points of what is explained, below which a radius or falloff is called none
LEAST_GAIN = 0.1
HEAD = [
    "scene and light", "bounces", "none", "AO, no limit", "best radius", "best falloff", "`ao-sky`", "radius", "halves",
    "ambient radiance",
]
SKY_HEAD = [
    "scene", "the same everywhere", "AO, no limit, as it is", "AO, no limit, scaled", "best radius", "best falloff",
    "radius", "halves", "scale",
]


def expand(folder):
    """The scenes, files of .brhan one by one; those that are not there are left out."""
    for name, scene, options in SCENES:
        if scene.startswith("builtin:"):
            yield name, scene, options
        elif scene == "brhan/scenes":
            for path in sorted((folder / scene).glob("*.brhan")):
                yield path.stem + " (.brhan)", str(path), options
        elif (folder / scene).exists():
            yield name, str(folder / scene), options


def measure(program, folder, options):
    """A compact record of each scene that can be compared, and why others are left out."""
    records, notes = [], []
    for name, scene, own in expand(folder):
        begin = time.monotonic()
        command = [program, "compare", "ao-vs-path", scene, "--json", *options, *own]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            reason = done.stderr.strip().splitlines()[-1].split(".brhan: ")[-1].split(";")[0]
            notes.append(f"{name} is left out: {reason}")
        else:
            records.append(compact(name, json.loads(done.stdout)))
        print(f"{name}: {time.monotonic() - begin:.0f} s", file=sys.stderr)
    return records, notes


def compact(name, record):
    """The figures that the tables have; the curves over all radii are left out."""

    def fit(found):
        if found is None:
            return None
        best = {k: {n: v for n, v in found[k].items() if n != "rmse"} for k in ("binary", "falloff", "best")}
        rows = [{"name": r["name"], "explained": r["explained"]} for r in found["rows"]]
        return {"environment_light": found["environment_light"], "rows": rows, "metrics": found["metrics"], **best}

    return {
        "name": name,
        "scene": Path(record["scene"]).name,
        "diagonal": record["diagonal"],
        "light": {"bounces": record["light"]["bounces"]},
        "path": [fit(f) for f in record["path"]],
        "sky": fit(record["sky"]),
    }


def number(x):
    return "0" if x == 0 else f"{x:.3g}"


def explained(fit, name):
    return next(100 * r["explained"] for r in fit["rows"] if r["name"] == name)


def distance(fit, choice, key, name, flat, end):
    """The best radius or half distance and its standard error; none where it hardly beats no occlusion."""
    value, error = fit[choice][key], fit[choice]["standard_error"]
    if explained(fit, name) - explained(fit, flat) < LEAST_GAIN:
        return "none"
    if value is None:
        return "no limit"
    if value > 0.99 * end:
        return f"{number(value)} or more"
    return number(value) + (f" ± {100 * error:.2g} %" if error else "")


def row(name, record, fit):
    is_sky = fit["environment_light"] is None
    flat, unlimited = (SKY_FLAT, UNLIMITED) if is_sky else (FLAT, UNLIMITED)
    columns = [flat, *([UNLIMITED + ", as it is"] if is_sky else []), unlimited, RADIUS, FALLOFF]
    values = [f"{explained(fit, n):.1f}" for n in columns]
    best = max(values, key=float)
    values = [f"**{v}**" if v == best else v for v in values]
    diagonal = record["diagonal"]
    limits = [
        distance(fit, "binary", "radius", RADIUS, flat, diagonal),
        distance(fit, "falloff", "half_distance", FALLOFF, flat, 2 * diagonal),
    ]
    if is_sky:
        cells = [name, *values, *limits, f"{fit['best']['ambient'][0]:.2f}"]
    else:
        bounces = f"{100 * record['light']['bounces']:.0f}"
        ambient = ", ".join(number(c) for c in fit["best"]["ambient"])
        cells = [name, bounces, *values, f"{explained(fit, EXACT):.1f}", *limits, ambient]
    return cells


def tables(records):
    """Three tables of what is explained, and one of similarity."""
    ambient, traced, sky, similar, seen = [], [], [], [], set()
    for record in records:
        for fit in record["path"]:
            (ambient if fit["environment_light"] == "ambient" else traced).append(row(record["name"], record, fit))
        # by itself ambient visibility knows of no sun: each scene once
        fit, name = record["sky"], record["name"].replace(", sun and sky", "").replace(", sky", "")
        if fit and record["scene"] not in seen:
            seen.add(record["scene"])
            sky.append(row(name, record, fit))
            metrics = fit["metrics"]
            similar.append([name, f"{metrics['tanimoto']:.4f}", f"{metrics['minimum_ratio']:.4f}"])
    lines = []
    for heading, head, rows in [
        ("Ambient light in place of environment and bounces", HEAD, ambient),
        ("Ambient light in place of bounces", HEAD, traced),
        ("Ambient visibility by itself, against `ao-sky`", SKY_HEAD, sky),
        ("Similarity to `ao-sky`, by Larsen's two measures", ["scene", "Tanimoto", "minimum ratio"], similar),
    ]:
        if rows:
            lines += [f"## {heading}", "", *table(head, rows)]
    return lines
