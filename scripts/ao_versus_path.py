#!/usr/bin/env python3
"""Makes the tables of docs/ao-versus-path.md: skylit compare ao-vs-path of many scenes.

    python3 scripts/ao_versus_path.py [--program target/release/skylit] [--scenes FOLDER] [--size WxH] [--json FILE] [--saved FILE] [NAME...]

FOLDER has the scenes of others (sponza, flight_helmet, brhan); what is missing is left out. --json keeps all records;
--saved prints the tables of records that were kept, without measuring.
"""

import argparse
import json
import pathlib
import subprocess
import sys

SPONZA_NAVE = ["--eye=-120,20,-5", "--target=50,35,0", "--fov-y=70"]
SUN = "sun direction=-1,-3,-2 irradiance=3 angle=0.5"
SKY = "--environment=1,1,1"
# name, scene, options
SCENES = [
    ("Sponza, nave, lamp", "sponza/sponza.glb", SPONZA_NAVE + ["--light=sphere position=30,70,-5 radius=4 radiance=400"]),
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
HEAD = "| scene and light | bounces | none | AO, no limit | best radius | best falloff | `ao-sky` | radius | halves | ambient radiance |"
SKY_HEAD = "| scene | the same everywhere | AO, no limit, as it is | AO, no limit, scaled | best radius | best falloff | radius | halves | scale |"
SIMILARITY_HEAD = "| | Tanimoto | minimum ratio |"


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


def run(program, scene, options, size):
    command = [program, "compare", "ao-vs-path", scene, "--size", size, "--spp", "32", "--ao-samples", "64", "--json", *options]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0:
        print(f"{scene}: {done.stderr.strip().splitlines()[-1]}", file=sys.stderr)
        return None
    return json.loads(done.stdout)


def number(x):
    return "0" if x == 0 else f"{x:.3g}"


def explained(fit, name):
    return next(100 * r["explained"] for r in fit["rows"] if r["name"] == name)


def distance(fit, choice, key, name, flat, end):
    """The best radius or half distance with its standard error; none where it explains hardly more than ambient light without occlusion."""
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
        cells = [name, bounces, *values, f"{explained(fit, EXACT):.1f}", *limits, ", ".join(number(c) for c in fit["best"]["ambient"])]
    return "| " + " | ".join(cells) + " |"


def similarity(name, fit):
    return f"| ours, {name} | {fit['metrics']['tanimoto']:.4f} | {fit['metrics']['minimum_ratio']:.4f} |"


def measure(arguments):
    for name, scene, options in expand(arguments.scenes):
        if arguments.names and not any(n in name for n in arguments.names):
            continue
        record = run(arguments.program, scene, options, arguments.size)
        if record is not None:
            print(f"{name}: {record['seconds']:.0f} s", file=sys.stderr)
            yield {"name": name, **record}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="target/release/skylit")
    parser.add_argument("--scenes", type=pathlib.Path, default=pathlib.Path("../shared/scenes"))
    parser.add_argument("--size", default="640x360")
    parser.add_argument("--json", type=pathlib.Path)
    parser.add_argument("--saved", type=pathlib.Path)
    parser.add_argument("names", nargs="*")
    arguments = parser.parse_args()
    if arguments.saved:
        records = json.loads(arguments.saved.read_text())
    else:
        records = list(measure(arguments))
    if arguments.json:
        arguments.json.write_text(json.dumps(records, indent=1) + "\n")
    ambient, traced, sky, similar, seen = [], [], [], [], set()
    for record in records:
        for fit in record["path"]:
            (ambient if fit["environment_light"] == "ambient" else traced).append(row(record["name"], record, fit))
        # by itself ambient visibility knows of no sun: each scene once
        fit, name = record["sky"], record["name"].replace(", sun and sky", "").replace(", sky", "")
        if fit and record["scene"] not in seen:
            seen.add(record["scene"])
            sky.append(row(name, record, fit))
            similar.append(similarity(name, fit))
    for title, head, rows in [
        ("Ambient light in place of environment and bounces", HEAD, ambient),
        ("Ambient light in place of bounces", HEAD, traced),
        ("Ambient visibility by itself, against ao-sky", SKY_HEAD, sky),
        ("The same beside Larsen's figures", SIMILARITY_HEAD, similar),
    ]:
        print(f"\n{title}\n\n{head}\n|" + "---|" * (head.count("|") - 1))
        print("\n".join(rows))


if __name__ == "__main__":
    main()
