#!/usr/bin/env python3
"""Makes the tables of docs/ao-versus-path.md: skylit compare ao-vs-path of many scenes.

    python3 scripts/ao_versus_path.py [--program target/release/skylit] [--scenes FOLDER] [--size WxH] [--json FILE] [NAME...]

FOLDER has the scenes of others (sponza, flight_helmet, brhan); what is missing is left out. --json keeps all records.
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
    command = [program, "compare", "ao-vs-path", scene, "--size", size, "--json", *options]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0:
        print(f"{scene}: {done.stderr.strip().splitlines()[-1]}", file=sys.stderr)
        return None
    return json.loads(done.stdout)


def number(x):
    return "0" if x == 0 else f"{x:.3g}"


def choice(c):
    parts = []
    if c["radius"] is not None:
        parts.append(number(c["radius"]))
    if c["half_distance"] is not None:
        parts.append("halves every " + number(c["half_distance"]))
    return ", ".join(parts) or "no limit"


def explained(fit, name):
    return next(100 * r["explained"] for r in fit["rows"] if r["name"] == name)


def best(fit):
    return 100 * (1 - (fit["best"]["rmse"] / fit["target_rms"]) ** 2)


def row(name, record, fit):
    m, diagonal = fit["metrics"], record["diagonal"]
    radius = fit["best"]["radius"] or fit["best"]["half_distance"]
    share = f"{100 * radius / diagonal:.2g} %" if radius else "-"
    cells = [
        name,
        f"{100 * record['light']['bounces']:.0f} %",
        *(f"{explained(fit, n):.1f}" for n in (FLAT, UNLIMITED)),
        f"{best(fit):.1f}",
        f"{explained(fit, EXACT):.1f}",
        choice(fit["best"]),
        share,
        ", ".join(number(c) for c in fit["best"]["ambient"]),
        f"{m['flip']:.3f}",
        f"{m['tanimoto']:.4f}",
        f"{m['minimum_ratio']:.4f}",
    ]
    return "| " + " | ".join(cells) + " |"


HEAD = "| scene | bounces | flat | AO, no limit | AO, best | ao-sky | best radius or falloff | of the diagonal | ambient | FLIP | Tanimoto | minimum ratio |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="target/release/skylit")
    parser.add_argument("--scenes", type=pathlib.Path, default=pathlib.Path("../shared/scenes"))
    parser.add_argument("--size", default="640x360")
    parser.add_argument("--json", type=pathlib.Path)
    parser.add_argument("names", nargs="*")
    arguments = parser.parse_args()
    tables = {"ambient": [], "traced": [], None: []}
    records = []
    for name, scene, options in expand(arguments.scenes):
        if arguments.names and not any(n in name for n in arguments.names):
            continue
        record = run(arguments.program, scene, options, arguments.size)
        if record is None:
            continue
        records.append({"name": name, **record})
        print(f"{name}: {record['seconds']:.0f} s", file=sys.stderr)
        for fit in record["path"]:
            tables[fit["environment_light"]].append(row(name, record, fit))
        fit = record["sky"]
        if fit:
            cells = [
                name,
                *(f"{explained(fit, n):.1f}" for n in ("the same everywhere", UNLIMITED + ", as it is", UNLIMITED)),
                f"{best(fit):.1f}",
                choice(fit["best"]),
                number(fit["best"]["ambient"][0]),
                number(fit["best"]["rmse"]),
            ]
            tables[None].append("| " + " | ".join(cells) + " |")
    if arguments.json:
        arguments.json.write_text(json.dumps(records, indent=1) + "\n")
    sky_head = "| scene | the same everywhere | AO, no limit | AO, no limit, scaled | AO, best | best radius or falloff | scale | RMSE |"
    heads = {"ambient": HEAD, "traced": HEAD, None: sky_head}
    titles = {"ambient": "ambient light in place of environment and bounces", "traced": "ambient light in place of bounces", None: "ao-sky"}
    for key, rows in tables.items():
        print(f"\n{titles[key]}\n\n{heads[key]}\n|" + "---|" * (heads[key].count("|") - 1))
        print("\n".join(rows))


if __name__ == "__main__":
    main()
