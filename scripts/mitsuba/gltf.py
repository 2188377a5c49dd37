"""Just enough glTF: a writer for the judge's scenes and, apart from it, a reader for what it writes."""

from __future__ import annotations

import base64
import json
import struct
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

Array = np.ndarray

FLOAT, UINT = 5126, 5125
WRAPS = {"repeat": 10497, "mirror": 33648, "clamp": 33071}
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}


@dataclass
class Mesh:
    """Triangles with attributes per vertex, in a space of their own."""

    positions: Array
    normals: Array
    indices: Array
    uv: Array | None = None
    colors: Array | None = None
    tangents: Array | None = None
    uv1: Array | None = None


def png(rgba: Array) -> bytes:
    """An 8-bit RGBA image as PNG."""
    h, w, _ = rgba.shape
    rows = b"".join(b"\0" + rgba[y].astype(np.uint8).tobytes() for y in range(h))

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", w, h, 8, 6, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")


def png_pixels(data: bytes) -> Array:
    """The pixels of what `png` wrote."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, packed, w, h = 8, b"", 0, 0
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        kind, body = data[at + 4 : at + 8], data[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            w, h, depth, colour = struct.unpack(">IIBB", body[:10])
            assert (depth, colour) == (8, 6)
        elif kind == b"IDAT":
            packed += body
        at += length + 12
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(h, 1 + 4 * w)
    assert not rows[:, 0].any(), "filtered rows"
    return rows[:, 1:].reshape(h, w, 4)


class Writer:
    """A glTF file in the making; every call returns an index."""

    def __init__(self) -> None:
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "skylit scripts/mitsuba"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "nodes": [],
        }
        self.data = bytearray()
        self.used: set[str] = set()

    def add(self, kind: str, value: Any) -> int:
        self.json.setdefault(kind, []).append(value)
        return len(self.json[kind]) - 1

    def accessor(self, values: Array) -> int:
        values = np.asarray(values)
        integer = values.dtype.kind in "iu"
        packed = values.astype("<u4" if integer else "<f4")
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": packed.nbytes}
        self.data += packed.tobytes()
        width = 1 if packed.ndim == 1 else packed.shape[1]
        accessor = {"bufferView": self.add("bufferViews", view), "componentType": UINT if integer else FLOAT}
        accessor |= {"count": len(packed), "type": KINDS[width]}
        if not integer and width == 3:
            accessor |= {"min": packed.min(0).tolist(), "max": packed.max(0).tolist()}
        return self.add("accessors", accessor)

    def texture(self, rgba: Array, wrap: str | tuple[str, str] = "repeat", nearest: bool = False) -> int:
        """`wrap` is one mode for both axes, or one of each."""
        s, t = (WRAPS[mode] for mode in ((wrap, wrap) if isinstance(wrap, str) else wrap))
        f = 9728 if nearest else 9729
        uri = "data:image/png;base64," + base64.b64encode(png(rgba)).decode()
        sampler = self.add("samplers", {"magFilter": f, "minFilter": f, "wrapS": s, "wrapT": t})
        return self.add("textures", {"sampler": sampler, "source": self.add("images", {"uri": uri})})

    def material(self, **m: Any) -> int:
        self.used |= set(m.get("extensions", {}))
        return self.add("materials", m)

    def mesh(self, mesh: Mesh, material: int, name: str = "") -> int:
        attributes = {"POSITION": mesh.positions, "NORMAL": mesh.normals, "TEXCOORD_0": mesh.uv, "TEXCOORD_1": mesh.uv1}
        attributes |= {"COLOR_0": mesh.colors, "TANGENT": mesh.tangents}
        primitive = {"attributes": {k: self.accessor(v) for k, v in attributes.items() if v is not None}}
        primitive |= {"indices": self.accessor(mesh.indices.astype(np.uint32).ravel()), "material": material}
        return self.add("meshes", {"primitives": [primitive]} | ({"name": name} if name else {}))

    def node(self, **n: Any) -> int:
        node = self.add("nodes", n)
        self.json["scenes"][0]["nodes"].append(node)
        return node

    def place(self, mesh: Mesh, material: int, name: str = "", **transform: Any) -> int:
        return self.node(mesh=self.mesh(mesh, material, name), **transform)

    def light(self, **light: Any) -> dict[str, Any]:
        """The extension that a node with this light carries."""
        name = "KHR_lights_punctual"
        self.used.add(name)
        lights = self.json.setdefault("extensions", {}).setdefault(name, {"lights": []})["lights"]
        lights.append(light)
        return {name: {"light": len(lights) - 1}}

    def write(self, path: Path) -> None:
        uri = "data:application/octet-stream;base64," + base64.b64encode(bytes(self.data)).decode()
        self.json["buffers"] = [{"byteLength": len(self.data), "uri": uri}]
        if self.used:
            self.json["extensionsUsed"] = sorted(self.used)
        path.write_text(json.dumps(self.json, separators=(",", ":")) + "\n")


@dataclass
class Texture:
    """An image, the set of texture coordinates that it is looked up with, and how; `linear` decodes sRGB."""

    pixels: Array
    wrap: tuple[str, str]
    nearest: bool
    transform: Array
    set: int

    def raw(self) -> Array:
        return self.pixels.astype(np.float64) / 255

    def linear(self) -> Array:
        c = self.raw()
        rgb = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
        return np.concatenate([rgb[..., :3], c[..., 3:]], -1)


@dataclass
class Part:
    """A primitive where its node puts it; normals and tangents are of unit length, triangles counter-clockwise from the front."""

    mesh: Mesh
    material: dict[str, Any]
    name: str
    to_world: Array


@dataclass
class Scene:
    """A glTF file in world space."""

    parts: list[Part] = field(default_factory=list)
    lights: list[dict[str, Any]] = field(default_factory=list)
    camera: dict[str, Any] = field(default_factory=dict)
    camera_to_world: Array = field(default_factory=lambda: np.eye(4))
    document: dict[str, Any] = field(default_factory=dict)

    def texture(self, info: dict[str, Any] | None) -> Texture | None:
        if info is None:
            return None
        texture = self.document["textures"][info["index"]]
        sampler = self.document["samplers"][texture["sampler"]]
        uri = self.document["images"][texture["source"]]["uri"]
        t = info.get("extensions", {}).get("KHR_texture_transform", {})
        (x, y), (sx, sy), r = t.get("offset", [0, 0]), t.get("scale", [1, 1]), t.get("rotation", 0.0)
        # KHR_texture_transform: translation, rotation and scale as its text writes them
        c, s = np.cos(r), np.sin(r)
        move = np.array([[1, 0, x], [0, 1, y], [0, 0, 1]])
        matrix = move @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ np.diag([sx, sy, 1])
        modes = {number: mode for mode, number in WRAPS.items()}
        wrap = (modes[sampler["wrapS"]], modes[sampler["wrapT"]])
        pixels = png_pixels(base64.b64decode(uri.split(",")[1]))
        return Texture(pixels, wrap, sampler["magFilter"] == 9728, matrix, info.get("texCoord", 0))


def matrix_of(node: dict[str, Any]) -> Array:
    """A node's transform; columns as in the specification."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", [0, 0, 0, 1])
    m = np.eye(4)
    m[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    m[:3, :3] = m[:3, :3] * np.array(node.get("scale", [1, 1, 1]))
    m[:3, 3] = node.get("translation", [0, 0, 0])
    return m


def unit(v: Array) -> Array:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def read(path: Path) -> Scene:
    """Reads a file that `Writer` wrote."""
    document = json.loads(path.read_text())
    data = base64.b64decode(document["buffers"][0]["uri"].split(",")[1])
    scene = Scene(document=document)

    def accessor(index: int) -> Array:
        a = document["accessors"][index]
        view = document["bufferViews"][a["bufferView"]]
        width = {v: k for k, v in KINDS.items()}[a["type"]]
        kind = "<u4" if a["componentType"] == UINT else "<f4"
        values = np.frombuffer(data, kind, a["count"] * width, view["byteOffset"])
        values = values.astype(np.int64 if kind == "<u4" else np.float64)
        return values if width == 1 else values.reshape(-1, width)

    def place(part: dict[str, Any], name: str, m: Array) -> Part:
        a = {k: accessor(v) for k, v in part["attributes"].items()}
        linear, indices = m[:3, :3], accessor(part["indices"]).reshape(-1, 3)
        if np.linalg.det(linear) < 0:
            # the specification turns the winding with the determinant
            indices = indices[:, ::-1]
        tangents = a.get("TANGENT")
        if tangents is not None:
            # the handedness is of the mesh's own space
            sign = tangents[:, 3:] * np.sign(np.linalg.det(linear))
            tangents = np.concatenate([unit(tangents[:, :3] @ linear.T), sign], 1)
        mesh = Mesh(
            positions=a["POSITION"] @ linear.T + m[:3, 3],
            normals=unit(a["NORMAL"] @ np.linalg.inv(linear)),
            indices=indices,
            uv=a.get("TEXCOORD_0"),
            uv1=a.get("TEXCOORD_1"),
            colors=a.get("COLOR_0"),
            tangents=tangents,
        )
        return Part(mesh, document["materials"][part["material"]], name, m)

    def visit(index: int, above: Array) -> None:
        node = document["nodes"][index]
        m = above @ matrix_of(node)
        if "mesh" in node:
            mesh = document["meshes"][node["mesh"]]
            scene.parts.extend(place(p, mesh.get("name", ""), m) for p in mesh["primitives"])
        if "camera" in node:
            scene.camera, scene.camera_to_world = document["cameras"][node["camera"]], m
        light = node.get("extensions", {}).get("KHR_lights_punctual")
        if light is not None:
            described = document["extensions"]["KHR_lights_punctual"]["lights"][light["light"]]
            scene.lights.append(described | {"position": m[:3, 3], "axis": unit(-m[:3, 2])})
        for child in node.get("children", []):
            visit(child, m)

    for root in document["scenes"][0]["nodes"]:
        visit(root, np.eye(4))
    return scene
