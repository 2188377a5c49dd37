#!/usr/bin/env python3
"""Makes docs/images/materials.png, a ball for each extension of glTF's materials, and docs/images/ball-NAME.png, a ball for each
material of docs/reference/materials.md: path traced before a soft lamp.

    python3 scripts/material_balls.py [SKYLIT]              # the program, target/release/skylit unless given; some minutes on two cores
    python3 scripts/material_balls.py [SKYLIT] --only glass # one of the single balls, by its name
    python3 scripts/material_balls.py --scene FILE.gltf     # the scene of all balls alone

Python's own library is enough."""

from __future__ import annotations

import base64
import json
import math
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "docs/images"
RENDER = [
    *["--integrator", "path", "--spp", "128", "--tone-map", "agx", "--denoise", "--environment", "0.5,0.57,0.7", "--quiet"],
    *["--light", "disk position=5,9,5 direction=-5,-9,-5 radius=4 radiance=7", "--light", "disk position=-9,5,9 direction=9,-5,-9 radius=1.5 radiance=14 color=1,0.8,0.6"],
]
# of a picture of all balls, and of one
ALL = ["--size", "540x300"]
ONE = ["--size", "128x128", "--spp", "512", "--eye", "0,2.6,7", "--target", "0,0.95,0", "--fov-y", "20"]
RINGS, SECTORS = 48, 96
VOLUME = {"thicknessFactor": 1}


def fog(color: list[float], distance: float) -> dict:
    """A volume that takes half of the light after a distance."""
    return {**VOLUME, "attenuationColor": color, "attenuationDistance": distance}


# name of each ball: base colour, metalness, roughness, extensions; from the left, the rear row first
BALLS = {
    "clearcoat": ([0.5, 0.02, 0.03], 0.6, 0.5, {"clearcoat": {"clearcoatFactor": 1, "clearcoatRoughnessFactor": 0.03}}),
    "sheen": ([0.02, 0.03, 0.12], 0, 0.9, {"sheen": {"sheenColorFactor": [0.6, 0.65, 0.9], "sheenRoughnessFactor": 0.4}}),
    "anisotropy": ([0.75, 0.75, 0.78], 1, 0.3, {"anisotropy": {"anisotropyStrength": 0.9}}),
    "iridescence": ([0.4, 0.4, 0.42], 1, 0.15, {"iridescence": {"iridescenceFactor": 1, "iridescenceIor": 1.6, "iridescenceThicknessMaximum": 480}}),
    "retroreflection": ([0.9, 0.55, 0.1], 0.9, 0.35, {"retroreflection": {"retroreflectionFactor": 1}}),
    "transmission and volume": ([1, 1, 1], 0, 0.0, {"transmission": {"transmissionFactor": 1}, "volume": fog([0.2, 0.75, 0.55], 1.2)}),
    "dispersion": ([1, 1, 1], 0, 0.0, {"transmission": {"transmissionFactor": 1}, "volume": VOLUME, "ior": {"ior": 1.8}, "dispersion": {"dispersion": 2.5}}),
    "volume scatter": ([1, 1, 1], 0, 0.1, {"transmission": {"transmissionFactor": 1}, "volume": fog([0.5, 0.5, 0.5], 0.7), "volume_scatter": {"multiscatterColor": [0.8, 0.85, 0.9]}}),
    "diffuse transmission and volume scatter": (
        [1, 1, 1], 0, 0.35,
        {"diffuse_transmission": {"diffuseTransmissionFactor": 1}, "volume": fog([0.65, 0.4, 0.3], 0.25), "volume_scatter": {"multiscatterColor": [0.9, 0.55, 0.3]}},
    ),
    "diffuse transmission": ([0.3, 0.5, 0.08], 0, 0.6, {"diffuse_transmission": {"diffuseTransmissionFactor": 0.6, "diffuseTransmissionColorFactor": [0.4, 0.6, 0.1]}}),
}

# balls that are shown alone, as BALLS; what else the material has comes last
SINGLE = {
    "matte": ([0.6, 0.3, 0.15], 0, 1, {"specular": {"specularFactor": 0}}, {}),
    "rough diffuse": ([0.6, 0.3, 0.15], 0, 1, {}, {"extras": {"sigma": 1}}),
    "dielectric": ([0.05, 0.25, 0.5], 0, 0.2, {}, {}),
    "metal": ([0.9, 0.65, 0.35], 1, 0.25, {}, {}),
    "specular": ([0.05, 0.25, 0.5], 0, 0.2, {"specular": {"specularFactor": 1, "specularColorFactor": [9, 3, 1]}}, {}),
    "thin walls": ([0.9, 0.6, 0.3], 0, 0.0, {"transmission": {"transmissionFactor": 1}}, {}),
    "rough thin walls": ([0.9, 0.6, 0.3], 0, 0.5, {"transmission": {"transmissionFactor": 1}}, {}),
    "rough glass": ([1, 1, 1], 0, 0.4, {"transmission": {"transmissionFactor": 1}, "volume": VOLUME}, {}),
    "emission": ([0, 0, 0], 0, 1, {}, {"emissiveFactor": [1, 0.45, 0.1]}),
    "unlit": ([0.6, 0.3, 0.15], 0, 1, {"unlit": {}}, {}),
    "blend": ([0.6, 0.3, 0.15], 0, 1, {}, {"alphaMode": "BLEND", "alpha": 0.5}),
}
# named materials of .brhan
BRHAN = {
    "mirror": "material[mirror] reflectance[0.95 0.95 0.95]",
    "glass": "material[glass] reflectance[1 1 1] transmittance[1 1 1]",
    "copper": "material[copper]",
    "gold": "material[gold]",
}
GREYS = [0.55, 0.12]


class Buffer:
    """The buffer of a glTF file, and what lies in it."""

    def __init__(self) -> None:
        self.bytes, self.views, self.accessors = b"", [], []

    def add(self, form: str, values: list, component: int, kind: str) -> int:
        """Appends tuples of numbers; returns their accessor."""
        data = b"".join(struct.pack("<" + form, *v) for v in values)
        self.views.append({"buffer": 0, "byteOffset": len(self.bytes), "byteLength": len(data)})
        self.bytes += data + bytes(-len(data) % 4)
        accessor = {"bufferView": len(self.views) - 1, "componentType": component, "type": kind, "count": len(values)}
        if kind == "VEC3":
            accessor |= {"min": [min(c) for c in zip(*values)], "max": [max(c) for c in zip(*values)]}
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def primitive(self, positions: list, normals: list, coordinates: list, indices: list) -> dict:
        """A mesh of triangles."""
        attributes = {
            "POSITION": self.add("3f", positions, 5126, "VEC3"),
            "NORMAL": self.add("3f", normals, 5126, "VEC3"),
            "TEXCOORD_0": self.add("2f", coordinates, 5126, "VEC2"),
        }
        return {"attributes": attributes, "indices": self.add("I", [(i,) for i in indices], 5125, "SCALAR")}


def ball(buffer: Buffer) -> dict:
    """A sphere of radius 1."""
    points, coordinates, indices = [], [], []
    for i in range(RINGS + 1):
        for j in range(SECTORS + 1):
            theta, phi = math.pi * i / RINGS, 2 * math.pi * j / SECTORS
            points.append((math.sin(theta) * math.cos(phi), math.cos(theta), math.sin(theta) * math.sin(phi)))
            coordinates.append((j / SECTORS, i / RINGS))
            if i < RINGS and j < SECTORS:
                a, b = i * (SECTORS + 1) + j, (i + 1) * (SECTORS + 1) + j
                indices += [a, a + 1, b, a + 1, b + 1, b]
    return buffer.primitive(points, points, coordinates, indices)


def floor(buffer: Buffer, parity: int) -> dict:
    """The squares of one colour of a chequered floor."""
    points, indices = [], []
    for x in range(-12, 12):
        for z in range(-10, 6):
            if (x + z) % 2 == parity:
                k = len(points)
                points += [(x, 0, z), (x + 1, 0, z), (x + 1, 0, z + 1), (x, 0, z + 1)]
                indices += [k, k + 2, k + 1, k, k + 3, k + 2]
    return buffer.primitive(points, [(0, 1, 0)] * len(points), [(0, 0)] * len(points), indices)


def scene(balls: dict) -> dict:
    """The file: rows of five balls on a floor; one alone is in the middle."""
    buffer, materials, meshes, nodes = Buffer(), [], [], []

    def place(primitive: dict, name: str, color: list, metallic: float, roughness: float, extensions: dict, more: dict, at: list) -> None:
        pbr = {"baseColorFactor": [*color, more.get("alpha", 1)], "metallicFactor": metallic, "roughnessFactor": roughness}
        extensions = {f"KHR_materials_{key}": value for key, value in extensions.items()}
        more = {key: value for key, value in more.items() if key != "alpha"}
        materials.append({"name": name, "pbrMetallicRoughness": pbr, "extensions": extensions, **more})
        meshes.append({"name": name, "primitives": [{**primitive, "material": len(materials) - 1}]})
        nodes.append({"name": name, "mesh": len(meshes) - 1, "translation": at})

    shape = ball(buffer)
    for k, (name, (color, metallic, roughness, extensions, *more)) in enumerate(balls.items()):
        row, column = divmod(k, 5)
        at = [2.5 * (column - 2), 1, 4 * row - 3] if len(balls) > 1 else [0, 1, 0]
        place(shape, name, color, metallic, roughness, extensions, more[0] if more else {}, at)
    for parity, grey in enumerate(GREYS):
        place(floor(buffer, parity), "floor", [grey] * 3, 0, 0.8, {}, {}, [0, 0, 0])
    tilt = math.radians(-27)
    nodes.append({"camera": 0, "translation": [0, 8.6, 14.5], "rotation": [math.sin(tilt / 2), 0, 0, math.cos(tilt / 2)]})
    used = sorted({name for material in materials for name in material["extensions"]})
    data = base64.b64encode(buffer.bytes).decode()
    return {
        "asset": {"version": "2.0"}, "extensionsUsed": used, "scene": 0, "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes, "meshes": meshes, "materials": materials, "accessors": buffer.accessors, "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(buffer.bytes), "uri": f"data:application/octet-stream;base64,{data}"}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.42, "znear": 0.1}}],
    }


def write_brhan(folder: Path, material: str) -> Path:
    """A .brhan file of one ball on the floor."""
    models = folder / "models"
    models.mkdir(exist_ok=True)
    text = f"Sphere center[0 1 0] radius[1] {material}\n"
    for parity, grey in enumerate(GREYS):
        corners = [(x + dx, z + dz) for x in range(-12, 12) for z in range(-10, 6) if (x + z) % 2 == parity for dx, dz in [(0, 0), (0, 1), (1, 1), (1, 0)]]
        lines = [f"v {x} 0 {z}" for x, z in corners] + [f"f {k} {k + 1} {k + 2} {k + 3}" for k in range(1, len(corners), 4)]
        (models / f"floor{parity}.obj").write_text("\n".join(lines) + "\n")
        text += f"Model file[models/floor{parity}.obj] material[matte] diffuse[{grey} {grey} {grey}]\n"
    file = folder / "ball.brhan"
    file.write_text(text)
    return file


def main() -> None:
    if sys.argv[1:2] == ["--scene"]:
        Path(sys.argv[2]).write_text(json.dumps(scene(BALLS)))
        return
    arguments = sys.argv[1:]
    only = arguments.pop(arguments.index("--only") + 1) if "--only" in arguments else None
    arguments = [a for a in arguments if a != "--only"]
    program = arguments[0] if arguments else ROOT / "target/release/skylit"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = folder / "materials.gltf"

        def render(source: Path, out: str, view: list) -> None:
            subprocess.run([program, "render", source, "-o", OUT / out, *RENDER, *view], check=True)

        for ball_name, entry in {**BALLS, **SINGLE}.items():
            if only in (None, ball_name):
                file.write_text(json.dumps(scene({ball_name: entry})))
                render(file, f"ball-{ball_name.replace(' ', '-')}.png", ONE)
        for ball_name, material in BRHAN.items():
            if only in (None, ball_name):
                render(write_brhan(folder, material), f"ball-{ball_name}.png", ONE)
        if only is None:
            file.write_text(json.dumps(scene(BALLS)))
            render(file, "materials.png", ALL)


if __name__ == "__main__":
    main()
