#!/usr/bin/env python3
"""Writes the scenes that our path tracer and Mitsuba both render: tests/mitsuba/scenes/NAME.gltf, and tests/mitsuba/scenes.json with what a
glTF cannot say (environment, depth, lens, samples)."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gltf import Array, Mesh, Writer, unit

TESTS = Path(__file__).resolve().parents[2] / "tests" / "mitsuba"
ENVIRONMENT = "sun.exr"


# shapes

def quad(middle: Any, u: Any, v: Any, tiles: float = 1.0) -> Mesh:
    """A rectangle with sides u and v, its front where u x v points; texture coordinates go along u, and against v, as an image hangs."""
    m, u, v = (np.array(a, float) for a in (middle, u, v))
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    normal, tangent = unit(np.cross(u, v)), np.append(unit(u), 1)
    return Mesh(
        positions=np.array([m + 0.5 * (a * u + b * v) for a, b in corners]),
        normals=np.tile(normal, (4, 1)),
        indices=np.array([[0, 1, 2], [0, 2, 3]]),
        uv=tiles * np.array([(0.5 + 0.5 * a, 0.5 - 0.5 * b) for a, b in corners]),
        tangents=np.tile(tangent, (4, 1)),
    )


def merged(meshes: list[Mesh]) -> Mesh:
    """One mesh of several that have the same attributes."""
    first = np.cumsum([0] + [len(m.positions) for m in meshes])

    def all_of(name: str) -> Array | None:
        values = [getattr(m, name) for m in meshes]
        return None if any(v is None for v in values) else np.concatenate(values)

    indices = np.concatenate([m.indices + k for m, k in zip(meshes, first)])
    names = ("uv", "colors", "tangents", "uv1")
    return Mesh(all_of("positions"), all_of("normals"), indices, *map(all_of, names))


def box(lo: Any, hi: Any, inside: bool = False) -> Mesh:
    """A box, seen from outside or from inside."""
    lo, hi = np.array(lo, float), np.array(hi, float)
    middle, size = 0.5 * (lo + hi), hi - lo
    faces = []
    for axis in range(3):
        for side in (-1, 1):
            u, v = (size * np.eye(3)[(axis + k) % 3] for k in (1, 2))
            if (side > 0) == inside:
                u, v = v, u
            faces.append(quad(middle + 0.5 * side * size * np.eye(3)[axis], u, v))
    return merged(faces)


def icosphere(middle: Any, radius: float, levels: int = 2, smooth: bool = False) -> Mesh:
    """20 * 4^levels triangles, flat or with the sphere's normals."""
    g = (1 + 5**0.5) / 2
    p = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g)]
    p += [(0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    points = [unit(np.array(x, float)) for x in p]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6), (7, 1, 8)]
    faces += [(3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    for _ in range(levels):
        middles: dict[tuple[int, int], int] = {}

        def between(a: int, b: int) -> int:
            key = (min(a, b), max(a, b))
            if key not in middles:
                middles[key] = len(points)
                points.append(unit(points[a] + points[b]))
            return middles[key]

        split = []
        for a, b, c in faces:
            ab, bc, ca = between(a, b), between(b, c), between(c, a)
            split += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        faces = split
    sphere, indices = np.array(points), np.array(faces)
    shell = Mesh(np.array(middle, float) + radius * sphere, sphere, indices)
    return shell if smooth else flat(shell)


def flat(mesh: Mesh) -> Mesh:
    """The same triangles with corners of their own and the normals of their planes."""
    corners = mesh.positions[mesh.indices.ravel()]
    a, b, c = corners[0::3], corners[1::3], corners[2::3]
    normals = np.repeat(unit(np.cross(b - a, c - a)), 3, 0)
    return Mesh(corners, normals, np.arange(len(corners)).reshape(-1, 3))


def cylinder(middle: Any, radius: float, height: float, segments: int = 24) -> Mesh:
    """An upright tube with smooth normals and tangents around it."""
    turn = 2 * np.pi * np.arange(segments) / segments
    out = np.stack([np.sin(turn), np.zeros(segments), np.cos(turn)], 1)
    around = np.stack([np.cos(turn), np.zeros(segments), -np.sin(turn), np.ones(segments)], 1)
    up = np.array([0, 0.5 * height, 0])
    ring = np.arange(segments)
    after = (ring + 1) % segments
    lower = np.stack([ring, after, after + segments], 1)
    upper = np.stack([ring, after + segments, ring + segments], 1)
    positions = np.array(middle, float) + np.concatenate([radius * out - up, radius * out + up])
    return Mesh(positions, np.tile(out, (2, 1)), np.concatenate([lower, upper]), tangents=np.tile(around, (2, 1)))


# materials

NO_SPECULAR = {"KHR_materials_specular": {"specularFactor": 0.0}}


def matte(color: Any = (0.6, 0.6, 0.6), **more: Any) -> dict[str, Any]:
    """Lambert: metallic-roughness whose Fresnel term is 0."""
    return surface(color, 0.0, 1.0, extensions=dict(NO_SPECULAR), **more)


def surface(color: Any, metallic: float, roughness: float, **more: Any) -> dict[str, Any]:
    rgba = [float(c) for c in color] + [1.0] * (4 - len(color))
    pbr = {"baseColorFactor": rgba, "metallicFactor": metallic, "roughnessFactor": roughness} | more.pop("pbr", {})
    return {"pbrMetallicRoughness": pbr} | more


def khr(**extensions: dict[str, Any]) -> dict[str, Any]:
    return {f"KHR_materials_{name}": value for name, value in extensions.items()}


def lamp(radiance: Any, **more: Any) -> dict[str, Any]:
    """Emits and reflects nothing."""
    radiance = np.broadcast_to(np.array(radiance, float), 3)
    strength = max(float(radiance.max()), 1.0)
    emission = {"emissiveFactor": (radiance / strength).tolist()}
    return matte((0, 0, 0), **more) | emission | {"extensions": NO_SPECULAR | khr(emissive_strength={"emissiveStrength": strength})}


def glass(roughness: float = 0.0, color: Any = (1, 1, 1), ior: float = 1.5, **volume: Any) -> dict[str, Any]:
    """A body that refracts."""
    extensions = khr(transmission={"transmissionFactor": 1.0}, volume={"thicknessFactor": 1.0} | volume, ior={"ior": ior})
    return surface(color, 0.0, roughness, extensions=extensions)


# textures

def patches(n: int, seed: int, alpha: Callable[[int, int], int] = lambda x, y: 255) -> Array:
    """n x n texels of colours at random."""
    rgb = np.random.default_rng(seed).integers(10, 246, (n, n, 3))
    a = np.array([[alpha(x, y) for x in range(n)] for y in range(n)])
    return np.concatenate([rgb, a[..., None]], -1).astype(np.uint8)


def bumps(n: int, seed: int, tilt: float) -> Array:
    """A normal map of n x n slopes at random."""
    slopes = np.random.default_rng(seed).uniform(-tilt, tilt, (n, n, 2))
    normals = unit(np.concatenate([slopes, np.ones((n, n, 1))], -1))
    rgb = np.round((normals * 0.5 + 0.5) * 255)
    return np.concatenate([rgb, np.full((n, n, 1), 255)], -1).astype(np.uint8)


def brush(n: int, seed: int) -> Array:
    """Directions of anisotropy at random, and strengths."""
    random = np.random.default_rng(seed)
    angle = random.uniform(0, 2 * np.pi, (n, n))
    rgb = np.stack([0.5 + 0.5 * np.cos(angle), 0.5 + 0.5 * np.sin(angle), random.uniform(0.3, 1, (n, n)), np.ones((n, n))], -1)
    return np.round(255 * rgb).astype(np.uint8)


# scenes

@dataclass
class Judged:
    """A scene in the making: the file, and what else there is to know."""

    name: str
    about: str
    judge: str
    writer: Writer = field(default_factory=Writer)
    more: dict[str, Any] = field(default_factory=dict)

    def add(self, mesh: Mesh, material: dict[str, Any], name: str = "", **transform: Any) -> None:
        self.writer.place(mesh, self.writer.material(**material), name, **transform)

    def sphere(self, middle: Any, radius: float, material: dict[str, Any]) -> None:
        """An analytic sphere. glTF has none: a mesh of this name stands for it, and both renderers put the sphere in its place."""
        self.add(icosphere((0, 0, 0), 1.0, 0), material, "sphere", translation=list(middle), scale=[radius] * 3)

    def floor(self, material: dict[str, Any] | None = None, tiles: float = 1.0, size: float = 6.0) -> None:
        self.add(quad((0, 0, 0), (size, 0, 0), (0, 0, -size), tiles), material or matte())

    def lamp(self, radiance: Any = (12, 11, 9), middle: Any = (-1.2, 3.0, 0.8), side: float = 1.2) -> None:
        """A square lamp that looks down."""
        self.add(quad(middle, (side, 0, 0), (0, 0, side)), lamp(radiance))

    def light(self, kind: str, intensity: float, position: Any, target: Any = (0, 0, 0), **more: Any) -> None:
        extension = self.writer.light(type=kind, intensity=intensity, **more)
        self.writer.node(matrix=look_at(position, target), extensions=extension)

    def camera(self, eye: Any = (0.6, 2.2, 4.4), target: Any = (0, 0.55, 0), yfov: float = 0.62, xmag: float = 0.0) -> None:
        if xmag:
            camera = {"type": "orthographic", "orthographic": {"xmag": xmag, "ymag": xmag, "znear": 0.01, "zfar": 100.0}}
        else:
            camera = {"type": "perspective", "perspective": {"yfov": yfov, "znear": 0.01, "aspectRatio": 1.0}}
        self.writer.node(camera=self.writer.add("cameras", camera), matrix=look_at(eye, target))

    def sky(self, *rgb: float) -> None:
        self.more["environment"] = list(rgb)

    def option_light(self, text: str) -> None:
        """A light as `--light` takes it."""
        self.more.setdefault("lights", []).append(text)


def look_at(eye: Any, target: Any) -> list[float]:
    """A node's matrix that looks along -z at the target."""
    eye = np.array(eye, float)
    back = unit(eye - np.array(target, float))
    up = np.array([0.0, 1, 0]) if abs(back[1]) < 0.999 else np.array([0.0, 0, -1])
    right = unit(np.cross(up, back))
    m = np.eye(4)
    m[:3] = np.stack([right, np.cross(back, right), back, eye], 1)
    return m.T.ravel().tolist()


SCENES: dict[str, Callable[[], Judged]] = {}

# what scenes wait for: the test leaves them out until it is there
AWAITS: dict[str, str] = {}


def scene(name: str, about: str, judge: str = "python", **more: Any) -> Callable[[Callable[[Judged], None]], Callable[[Judged], None]]:
    """Registers a scene. `judge`: which BSDFs Mitsuba renders it with, its own or ours in Python."""

    def register(build: Callable[[Judged], None]) -> Callable[[Judged], None]:
        def make() -> Judged:
            judged = Judged(name, about, judge, more=dict(more))
            build(judged)
            if "cameras" not in judged.writer.json:
                judged.camera()
            return judged

        SCENES[name] = make
        return build

    return register


BALL = (0.0, 0.75, 0.0)


def ball(s: Judged, material: dict[str, Any], smooth: bool = False, middle: Any = BALL, radius: float = 0.7) -> None:
    s.add(icosphere(middle, radius, 2, smooth), material)


# lights


@scene("light-point", "two coloured point lights", "stock")
def _(s: Judged) -> None:
    s.floor()
    ball(s, matte((0.7, 0.4, 0.3)))
    s.light("point", 20.0, (1.5, 2.5, 1.5), color=[1.0, 0.8, 0.5])
    s.light("point", 5.0, (-1.5, 1.2, 1.0), color=[0.2, 0.5, 1.0])


@scene("light-range", "a point and a spot with a range", "python")
def _(s: Judged) -> None:
    s.floor()
    ball(s, matte())
    s.light("point", 20.0, (1.5, 2.0, 1.5), range=3.5)
    s.light("spot", 30.0, (-1.5, 2.0, 1.0), range=4.0, spot={"innerConeAngle": 0.1, "outerConeAngle": 0.6})


@scene("light-spot", "a spot with a soft edge", "python")
def _(s: Judged) -> None:
    s.floor()
    ball(s, matte((0.3, 0.6, 0.5)))
    s.light("spot", 40.0, (1.5, 3.0, 1.5), (0, 0.4, 0), spot={"innerConeAngle": 0.15, "outerConeAngle": 0.45})


@scene("light-spot-hard", "a spot with a hard edge", "stock")
def _(s: Judged) -> None:
    s.floor()
    ball(s, matte((0.3, 0.6, 0.5)))
    s.light("spot", 40.0, (1.5, 3.0, 1.5), (0, 0.4, 0), spot={"innerConeAngle": 0.35, "outerConeAngle": 0.35})


@scene("light-directional", "a directional light", "stock")
def _(s: Judged) -> None:
    s.floor()
    ball(s, matte((0.5, 0.5, 0.7)))
    s.light("directional", 3.0, (1.0, 2.0, 1.4), color=[1.0, 0.9, 0.8])


@scene("light-quad", "a lamp that shines down only, in view", "stock")
def _(s: Judged) -> None:
    s.floor()
    ball(s, matte((0.7, 0.5, 0.3)))
    s.lamp((9, 8, 6), (0.2, 2.0, -0.4), 0.8)


@scene("light-two-sided", "a lamp that shines both ways", "stock")
def _(s: Judged) -> None:
    s.floor()
    ball(s, matte((0.7, 0.5, 0.3)), middle=(-0.9, 0.7, 0), radius=0.5)
    s.add(quad((0.7, 0.9, 0), (0.3, 0, 0.5), (0, 0.9, 0)), lamp((5, 6, 8), doubleSided=True))


@scene("light-textured", "a lamp with a picture", "stock")
def _(s: Judged) -> None:
    s.floor()
    picture = s.writer.texture(patches(4, 3), "clamp")
    panel = lamp((6, 6, 6)) | {"emissiveTexture": {"index": picture}}
    s.add(quad((0, 0.75, -0.9), (2.4, 0, 0), (0, 1.2, 0)), panel)


@scene("light-many", "64 small lamps of many colours", "stock")
def _(s: Judged) -> None:
    s.floor()
    ball(s, matte())
    random = np.random.default_rng(7)
    for k in range(64):
        x, z = -1.9 + 3.8 * (k % 8) / 7, -1.9 + 3.8 * (k // 8) / 7
        y = 2.4 + 0.3 * random.random()
        s.add(quad((x, y, z), (0.12, 0, 0), (0, 0, 0.12)), lamp(40 * random.random(3) ** 2 + 1))


@scene("light-mesh", "a mesh of 320 triangles that emits", "stock")
def _(s: Judged) -> None:
    s.floor()
    s.add(icosphere((0.8, 0.9, 0.3), 0.35, 2), lamp((8, 6, 3)))
    s.add(box((-1.3, 0.02, -0.8), (-0.3, 1.1, 0.2)), matte((0.4, 0.5, 0.7)))


@scene("sky-uniform", "a sky that is the same everywhere", "stock")
def _(s: Judged) -> None:
    s.floor()
    ball(s, matte((0.8, 0.7, 0.4)))
    s.sky(0.7, 0.9, 1.2)


@scene("sky-sun", "an environment map with a small bright sun", "stock", environment=ENVIRONMENT)
def _(s: Judged) -> None:
    s.floor()
    ball(s, matte())
    s.camera((0.6, 1.4, 4.4), (0, 1.0, 0), 0.8)


@scene("lights-all", "every kind of light at once", "python", environment=ENVIRONMENT)
def _(s: Judged) -> None:
    s.floor()
    ball(s, matte())
    s.lamp((6, 2, 2), (1.4, 1.6, 0), 0.6)
    s.light("point", 4.0, (-1.5, 1.2, 1.0), color=[0.2, 0.5, 1.0])
    s.light("spot", 20.0, (0.0, 3.0, 1.5), spot={"innerConeAngle": 0.1, "outerConeAngle": 0.3}, color=[0.4, 1.0, 0.4])
    s.light("directional", 0.5, (1.0, 2.0, 1.4))


@scene("unlit", "a body that only shows its colour", "stock")
def _(s: Judged) -> None:
    s.floor()
    ball(s, surface((0.9, 0.3, 0.1), 0.0, 1.0, extensions=khr(unlit={}), emissiveFactor=[0.3, 0.9, 0.6]))
    s.sky(0.5, 0.5, 0.5)


SMALL = [24, 24]


@scene("light-rectangle", "a rectangle of --light close to a wall, and what stands before it", "stock", size=SMALL)
def _(s: Judged) -> None:
    s.floor()
    s.add(quad((0, 1.5, -1.2), (6, 0, 0), (0, 3, 0)), matte((0.7, 0.6, 0.5)))
    s.add(box((-0.5, 0.02, -0.2), (0.3, 0.6, 0.2)), matte((0.3, 0.5, 0.8)))
    s.add(quad((0.8, 0.8, -0.3), (0.4, 0, 0.3), (0, 0.5, 0)), matte((0.8, 0.4, 0.3), doubleSided=True))
    s.option_light("rectangle position=0.4,1.5,-0.85 direction=0.1,-0.8,-0.3 size=1.6,0.3 radiance=14 color=1,0.8,0.6")


@scene("light-disk", "a disk of --light, and what stands before it", "stock", size=SMALL)
def _(s: Judged) -> None:
    s.floor()
    s.add(box((-0.9, 0.02, -0.7), (-0.5, 1.0, -0.3)), matte((0.3, 0.7, 0.4)))
    s.add(quad((0.3, 0.6, 0.2), (0.9, 0, 0), (0, 0, -0.5)), matte((0.7, 0.4, 0.7), doubleSided=True))
    s.option_light("disk position=0.8,1.5,0.2 direction=-0.5,-1,-0.1 radius=0.45 radiance=11 color=0.8,1,0.9")


@scene("spheres", "analytic spheres: matte, rough metal and glass, lit by one", "python", size=SMALL)
def _(s: Judged) -> None:
    s.floor()
    s.sphere((-0.9, 0.5, 0.2), 0.45, matte((0.3, 0.5, 0.8)))
    s.sphere((0.3, 0.42, 0.7), 0.4, glass())
    s.sphere((0.5, 0.6, -0.7), 0.55, surface((0.95, 0.7, 0.4), 1.0, 0.4))
    s.sphere((-0.3, 0.2, 1.1), 0.15, lamp((3, 1, 0.5)))
    s.option_light("sphere position=-0.5,1.7,-0.6 radius=0.3 radiance=14 color=1,0.9,0.7")
    s.sky(0.2, 0.25, 0.3)


@scene("sun-wide", "a sun of eight degrees: in view, in a mirror, on rough metal, and the penumbra that it makes", "python", size=[30, 24])
def _(s: Judged) -> None:
    s.floor(matte((0.5, 0.45, 0.4)), size=8.0)
    s.add(quad((-0.3, 0.02, 0.4), (1.0, 0, 0), (0, 0, -1.6)), surface((1, 1, 1), 1.0, 0.0))
    s.add(quad((1.2, 0.02, 0.4), (1.2, 0, 0), (0, 0, -2.6)), surface((0.9, 0.7, 0.5), 1.0, 0.35))
    s.add(box((-1.6, 0.02, -1.2), (-1.1, 1.1, -0.9)), matte((0.3, 0.5, 0.8)))
    s.option_light("sun direction=0.15,-0.36,1 irradiance=3 color=1,0.9,0.7 angle=8")
    s.camera((0, 1.5, 4.4), (0, 1.2, 0), 0.9)


@scene("emitter-alpha", "emitters with a picture, holes cut by alpha, and there in part", "stock", integrator="volpath", size=SMALL)
def _(s: Judged) -> None:
    s.floor()
    texture = s.writer.texture(patches(4, 21, lambda x, y: 255 if (x + y) % 2 else 40), "clamp", nearest=True)
    slots = {"pbr": {"baseColorTexture": {"index": texture}}, "emissiveTexture": {"index": texture}}
    holes = lamp((9, 9, 9)) | matte((0, 0, 0), alphaMode="MASK", **slots)
    s.add(quad((-0.75, 0.7, -0.5), (1.1, 0, 0.3), (0, 1.1, 0)), holes | {"extensions": lamp((9, 9, 9))["extensions"]})
    random = np.random.default_rng(22)
    veil = s.writer.texture(patches(3, 22, lambda x, y: int(random.integers(0, 256))))
    part = lamp((5, 6, 8)) | matte((0, 0, 0, 0.9), alphaMode="BLEND", pbr={"baseColorTexture": {"index": veil}})
    s.add(quad((0.75, 0.7, -0.3), (1.1, 0, -0.3), (0, 1.1, 0)), part | {"extensions": lamp((5, 6, 8))["extensions"]})
    s.add(box((0.2, 0.02, -1.4), (1.2, 0.8, -1.0)), matte((0.8, 0.5, 0.3)))


# cameras


@scene("camera-wide", "a wide image of a wide view from a camera that is turned", "stock", size=[40, 24])
def _(s: Judged) -> None:
    s.floor()
    ball(s, matte((0.7, 0.4, 0.3)))
    s.add(box((-1.6, 0.02, -0.4), (-1.0, 0.8, 0.3)), matte((0.2, 0.6, 0.3)))
    s.lamp()
    s.camera((1.8, 1.9, 2.2), (0.3, 0.5, 0.2), 1.1)


@scene("camera-orthographic", "parallel rays", "stock")
def _(s: Judged) -> None:
    s.floor()
    ball(s, matte((0.7, 0.4, 0.3)))
    s.lamp()
    s.sky(0.3, 0.3, 0.4)
    s.camera((1.6, 2.4, 3.4), (0, 0.5, 0), xmag=1.5)


@scene("camera-lens", "a thin lens, in focus on one of three boxes", "stock", lens={"radius": 0.3, "focus": 4.6})
def _(s: Judged) -> None:
    s.floor()
    for k, (x, z) in enumerate([(-1.0, 1.3), (0.0, 0.0), (1.0, -1.6)]):
        s.add(box((x - 0.3, 0.02, z - 0.3), (x + 0.3, 1.2, z + 0.3)), matte(np.eye(3)[k] * 0.6 + 0.15))
    s.sky(1.0, 1.0, 1.0)
    s.camera((0, 1.5, 4.5), (0, 0.5, 0), 0.7)


# textures, alpha, geometry


@scene("texture-base", "base colour in sRGB, repeated, interpolated", "stock")
def _(s: Judged) -> None:
    texture = s.writer.texture(patches(4, 1))
    s.floor(matte((1, 1, 1), pbr={"baseColorTexture": {"index": texture}}), tiles=2.5, size=4.0)
    s.sky(1, 1, 1)


@scene("texture-mirrored", "mirrored repetition, nearest texel, a factor beside it", "stock")
def _(s: Judged) -> None:
    texture = s.writer.texture(patches(4, 2), "mirror", nearest=True)
    s.floor(matte((0.9, 0.6, 0.8), pbr={"baseColorTexture": {"index": texture}}), tiles=3.3, size=4.0)
    s.sky(1, 1, 1)


@scene("texture-transform", "KHR_texture_transform, clamped at the edge", "stock")
def _(s: Judged) -> None:
    texture = s.writer.texture(patches(5, 4), "clamp")
    move = {"offset": [0.15, -0.25], "rotation": 0.5, "scale": [1.3, 0.8]}
    s.writer.used.add("KHR_texture_transform")
    slot = {"index": texture, "extensions": {"KHR_texture_transform": move}}
    s.floor(matte((1, 1, 1), pbr={"baseColorTexture": slot}), tiles=1.4, size=4.0)
    s.sky(1, 1, 1)


@scene("texture-rough", "metallic and roughness from a texture", "python")
def _(s: Judged) -> None:
    texels = patches(4, 5)
    texels[..., 1] = np.random.default_rng(6).integers(60, 256, (4, 4))
    texture = s.writer.texture(texels)
    pbr = {"metallicRoughnessTexture": {"index": texture}}
    s.floor(surface((0.8, 0.7, 0.5), 1.0, 1.0, pbr=pbr), tiles=1.5, size=4.0)
    s.lamp(middle=(0, 1.6, -1.2), side=1.4)
    s.sky(0.3, 0.4, 0.5)


@scene("texture-sets", "axes that wrap differently; both sets of texture coordinates", "python", size=SMALL)
def _(s: Judged) -> None:
    def sheet(x: float, **uv: float) -> Mesh:
        mesh = quad((x, 0, 0), (1.25, 0, 0), (0, 0, -3.2), 1.0)
        first = mesh.uv
        assert first is not None
        mesh.uv, mesh.uv1 = 2.6 * first - 0.8, first @ np.array([[1.1, 0.9], [-0.9, 1.7]]) - 0.3
        return mesh

    def slot(wrap: tuple[str, str], number: int, seed: int, nearest: bool = False) -> dict[str, Any]:
        return {"index": s.writer.texture(patches(4, seed), wrap, nearest), "texCoord": number}

    s.add(sheet(-1.3), matte((1, 1, 1), pbr={"baseColorTexture": slot(("repeat", "clamp"), 0, 23, True)}))
    s.add(sheet(0.0), matte((1, 0.9, 0.8), pbr={"baseColorTexture": slot(("clamp", "mirror"), 1, 24)}))
    both = {"baseColorTexture": slot(("mirror", "repeat"), 0, 25), "metallicRoughnessTexture": slot(("repeat", "mirror"), 1, 26)}
    s.add(sheet(1.3), surface((1, 1, 1), 1.0, 1.0, pbr=both))
    s.lamp((6, 6, 6), (0.5, 1.7, -1.6), 1.4)
    s.sky(0.5, 0.6, 0.7)


@scene("texture-coat", "textures of clearcoat (factor, roughness, normal) and of sheen (colour, roughness)", "python", size=SMALL, spp=1024)
def _(s: Judged) -> None:
    stage(s)
    coat = patches(4, 27)
    # so rough that nothing is a mirror
    coat[..., 1] = np.random.default_rng(28).integers(110, 256, (4, 4))
    slots = {f"clearcoat{name}Texture": {"index": s.writer.texture(coat)} for name in ("", "Roughness")}
    slots["clearcoatNormalTexture"] = {"index": s.writer.texture(bumps(5, 29, 0.35)), "scale": 0.9}
    coated = khr(clearcoat={"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.8} | slots)
    s.add(quad((-0.75, 0.75, 0), (1.3, 0, 0.2), (0, 1.1, -0.9)), surface((0.6, 0.2, 0.1), 0.0, 0.7, extensions=coated))
    fibres = patches(4, 30, lambda x, y: 90 + 41 * ((x + 2 * y) % 5))
    slots = {f"sheen{name}Texture": {"index": s.writer.texture(fibres)} for name in ("Color", "Roughness")}
    cloth = khr(sheen={"sheenColorFactor": [0.9, 0.9, 0.8], "sheenRoughnessFactor": 0.9} | slots)
    s.add(quad((0.75, 0.75, 0), (1.3, 0, -0.2), (0, 1.1, -0.9)), surface((0.3, 0.1, 0.2), 0.0, 0.8, extensions=cloth))


@scene("texture-specular", "textures of transmission, specular (factor, colour) and anisotropy", "python", size=SMALL, spp=1024)
def _(s: Judged) -> None:
    stage(s)

    def sheet(x: float) -> Mesh:
        return quad((x, 0.7, 0.2), (0.95, 0, 0), (0, 1.1, -0.6))

    window = khr(transmission={"transmissionFactor": 0.9, "transmissionTexture": {"index": s.writer.texture(patches(4, 31))}})
    s.add(sheet(-1.05), surface((0.7, 0.9, 0.6), 0.0, 0.4, extensions=window, doubleSided=True))
    texture = {"index": s.writer.texture(patches(4, 32, lambda x, y: 60 + 48 * ((3 * x + y) % 5)))}
    tint = {"specularFactor": 0.9, "specularColorFactor": [1.0, 1.0, 0.8], "specularTexture": texture, "specularColorTexture": texture}
    s.add(sheet(0.0), surface((0.1, 0.1, 0.1), 0.0, 0.35, extensions=khr(specular=tint, ior={"ior": 2.2})))
    brushed = {"anisotropyStrength": 0.9, "anisotropyRotation": 0.4, "anisotropyTexture": {"index": s.writer.texture(brush(3, 33), nearest=True)}}
    s.add(sheet(1.05), surface((0.9, 0.8, 0.7), 1.0, 0.35, extensions=khr(anisotropy=brushed)))
    s.add(box((-1.4, 0.02, -1.4), (-0.8, 0.6, -0.9)), matte((0.8, 0.3, 0.2)))


@scene("alpha-mask", "holes cut by alpha", "stock", integrator="volpath")
def _(s: Judged) -> None:
    s.floor()
    texels = patches(6, 8, lambda x, y: 255 if (x + y) % 3 else 60)
    texture = s.writer.texture(texels, nearest=True)
    material = matte((1, 1, 1), pbr={"baseColorTexture": {"index": texture}}, alphaMode="MASK", alphaCutoff=0.4, doubleSided=True)
    s.add(quad((0, 0.9, 0), (1.8, 0, 0.4), (0, 1.5, 0.3), 1.5), material)
    s.lamp((8, 8, 8), (0.3, 2.2, -1.6), 1.2)
    s.light("point", 6.0, (-1.5, 2.4, -1.2))


@scene("alpha-blend", "a sheet that is there in part", "stock", integrator="volpath")
def _(s: Judged) -> None:
    s.floor()
    random = np.random.default_rng(9)
    texels = patches(5, 9, lambda x, y: int(random.integers(0, 256)))
    texture = s.writer.texture(texels)
    material = matte((1, 1, 1, 0.9), pbr={"baseColorTexture": {"index": texture}}, alphaMode="BLEND", doubleSided=True)
    s.add(quad((0, 0.9, 0), (1.8, 0, 0.4), (0, 1.5, 0.3)), material)
    s.lamp((8, 8, 8), (0.3, 2.2, -1.6), 1.2)
    s.light("point", 6.0, (-1.5, 2.4, -1.2))


@scene("vertex-colors", "colours at vertices, beside a factor", "stock")
def _(s: Judged) -> None:
    s.floor()
    mesh = icosphere(BALL, 0.7, 2, smooth=True)
    colors = 0.1 + 0.8 * np.random.default_rng(11).random((len(mesh.positions), 3))
    body = flat(mesh)
    body.colors = colors[mesh.indices.ravel()]
    s.add(body, matte((0.9, 1.0, 0.8)))
    s.sky(1.0, 1.0, 0.9)


@scene("instances", "mirrored, stretched and turned instances", "stock")
def _(s: Judged) -> None:
    s.floor()
    wedge = merged([box((-0.3, -0.3, -0.3), (0.3, 0.3, 0.3)), box((0.3, -0.3, -0.1), (0.8, 0.0, 0.2))])
    s.add(wedge, matte((0.8, 0.3, 0.3)), translation=[-1.0, 0.5, 0.3], scale=[-1.0, 1.4, 0.7])
    s.add(wedge, matte((0.3, 0.8, 0.3)), translation=[0.9, 0.6, 0.6], rotation=[0.18, 0.36, 0.06, 0.9132360045], scale=[0.6, 1.5, 1.0])
    shear = np.array([[0.9, 0.4, 0, 0], [0, 0.8, 0.2, 0], [0.3, 0, -0.7, 0], [0.2, 0.7, -1.0, 1]])
    s.add(wedge, matte((0.3, 0.4, 0.9)), matrix=shear.ravel().tolist())
    # a lamp that a mirroring transform turns: it still shines down
    s.add(quad((0, 0, 0), (1, 0, 0), (0, 0, 1)), lamp((12, 12, 10)), translation=[0.5, 2.6, 0.8], scale=[-1.2, 1.0, 0.8])


# interiors


@scene("cornell", "the Cornell box", "stock")
def _(s: Judged) -> None:
    room(s, matte((0.73, 0.73, 0.73)), matte((0.63, 0.06, 0.05)), matte((0.15, 0.48, 0.09)))
    s.add(quad((0, 1.98, 0), (0.5, 0, 0), (0, 0, 0.5)), lamp((17, 12, 4)))
    s.add(turned_box((-0.35, 0.61, -0.3), (0.6, 1.2, 0.6), 0.3), matte((0.73, 0.73, 0.73)))
    s.add(turned_box((0.35, 0.31, 0.35), (0.6, 0.6, 0.6), -0.3), matte((0.73, 0.73, 0.73)))


def room(s: Judged, white: dict[str, Any], left: dict[str, Any], right: dict[str, Any]) -> None:
    """A room of two units, open towards the camera."""
    s.add(quad((0, 0, 0), (2, 0, 0), (0, 0, -2)), white)
    s.add(quad((0, 2, 0), (2, 0, 0), (0, 0, 2)), white)
    s.add(quad((0, 1, -1), (2, 0, 0), (0, 2, 0)), white)
    s.add(quad((-1, 1, 0), (0, 0, -2), (0, 2, 0)), left)
    s.add(quad((1, 1, 0), (0, 0, 2), (0, 2, 0)), right)
    s.camera((0, 1, 4.2), (0, 1, 0), 0.62)


def turned_box(middle: Any, size: Any, angle: float) -> Mesh:
    half = 0.5 * np.array(size, float)
    mesh = box(-half, half)
    c, n = np.cos(angle), np.sin(angle)
    turn = np.array([[c, 0, n], [0, 1, 0], [-n, 0, c]])
    mesh.positions, mesh.normals = mesh.positions @ turn.T + np.array(middle), mesh.normals @ turn.T
    mesh.tangents = None
    return mesh


@scene("interior", "a closed white room whose lamp shines at the ceiling: eight bounces", "stock", max_depth=8)
def _(s: Judged) -> None:
    s.add(box((-1.5, 0, -1.5), (1.5, 2, 1.5), inside=True), matte((0.8, 0.78, 0.7)))
    s.add(quad((-0.6, 1.3, -0.6), (0.7, 0, 0), (0, 0, -0.7)), lamp((10, 10, 10)))
    s.add(box((0.3, 0.02, -0.9), (0.9, 0.9, -0.3)), matte((0.3, 0.5, 0.8)))
    s.camera((0.9, 1.1, 1.3), (-0.2, 0.8, -0.6), 1.0)


@scene("interior-endless", "the same room, paths of any length", "stock")
def _(s: Judged) -> None:
    s.add(box((-1.5, 0, -1.5), (1.5, 2, 1.5), inside=True), matte((0.8, 0.78, 0.7)))
    s.add(quad((-0.6, 1.3, -0.6), (0.7, 0, 0), (0, 0, -0.7)), lamp((10, 10, 10)))
    s.add(box((0.3, 0.02, -0.9), (0.9, 0.9, -0.3)), matte((0.3, 0.5, 0.8)))
    s.camera((0.9, 1.1, 1.3), (-0.2, 0.8, -0.6), 1.0)


@scene("mirror", "a perfect mirror at the back of a room", "stock")
def _(s: Judged) -> None:
    room(s, matte((0.7, 0.7, 0.7)), matte((0.63, 0.06, 0.05)), matte((0.15, 0.48, 0.09)))
    s.add(quad((0, 1, -0.9), (1.4, 0, 0.1), (0, 1.4, 0.2)), surface((1, 1, 1), 1.0, 0.0))
    s.add(icosphere((0.2, 0.5, 0.2), 0.4, 1), surface((1, 1, 1), 1.0, 0.0))
    s.add(quad((0, 1.98, 0), (1, 0, 0), (0, 0, 1)), lamp((5, 5, 4)))


# materials


def stage(s: Judged) -> None:
    """What reflective bodies are shown in."""
    s.floor(matte((0.5, 0.45, 0.4)))
    s.lamp((8, 7, 6), (-0.8, 2.6, 1.2), 1.4)
    s.sky(0.4, 0.5, 0.6)


def rough_pair(roughness: float) -> Callable[[Judged], None]:
    def build(s: Judged) -> None:
        if roughness < 0.1:
            # what mirrors the sun on so few facets is noise
            stage(s)
        else:
            s.floor(matte((0.5, 0.45, 0.4)))
            s.more["environment"] = ENVIRONMENT
        ball(s, surface((0.2, 0.5, 0.3), 0.0, roughness), middle=(-0.65, 0.62, 0), radius=0.55)
        ball(s, surface((0.95, 0.7, 0.4), 1.0, roughness), middle=(0.65, 0.62, 0), radius=0.55)

    return build


for r in ("0.05", "0.3", "0.7", "1"):
    scene(f"rough-{r}", f"a dielectric and a metal of roughness {r}", "python")(rough_pair(float(r)))


@scene("metal-half", "a material that is a metal in part", "python")
def _(s: Judged) -> None:
    stage(s)
    ball(s, surface((0.9, 0.3, 0.2), 0.5, 0.35))


@scene("metal-ramp", "metallic from 0 to 1 in steps, on a rough and on a smooth sheet", "python", size=SMALL)
def _(s: Judged) -> None:
    stage(s)
    steps = np.zeros((6, 6, 4), np.uint8)
    steps[..., 1], steps[..., 2] = 255, np.arange(0, 256, 51)
    slot = {"metallicRoughnessTexture": {"index": s.writer.texture(steps, "clamp", nearest=True)}}
    s.add(quad((-0.75, 0.8, 0), (1.4, 0, 0), (0, 1.3, -0.7)), surface((0.9, 0.5, 0.2), 1.0, 0.35, pbr=slot))
    for k in range(3):
        s.add(quad((0.31 + 0.48 * k, 0.8, 0), (0.44, 0, 0), (0, 1.3, -0.7)), surface((0.3, 0.6, 0.9), 0.25 + 0.25 * k, 0.0))


@scene("metal-smooth", "metal and dielectric of roughness 0", "python")
def _(s: Judged) -> None:
    stage(s)
    ball(s, surface((0.2, 0.5, 0.3), 0.0, 0.0), middle=(-0.65, 0.62, 0), radius=0.55)
    ball(s, surface((0.95, 0.7, 0.4), 1.0, 0.0), middle=(0.65, 0.62, 0), radius=0.55)


@scene("specular-ior", "KHR_materials_specular and _ior", "python")
def _(s: Judged) -> None:
    stage(s)
    tinted = khr(specular={"specularFactor": 0.6, "specularColorFactor": [1.0, 0.4, 0.2]}, ior={"ior": 1.8})
    ball(s, surface((0.3, 0.3, 0.6), 0.0, 0.25, extensions=tinted), middle=(-0.65, 0.62, 0), radius=0.55)
    ball(s, surface((0.1, 0.1, 0.1), 0.0, 0.4, extensions=khr(ior={"ior": 2.4})), middle=(0.65, 0.62, 0), radius=0.55)


@scene("smooth-normals", "a coarse ball with the sphere's normals", "python")
def _(s: Judged) -> None:
    stage(s)
    s.add(icosphere((-0.65, 0.62, 0), 0.55, 1, smooth=True), matte((0.7, 0.6, 0.3)))
    s.add(icosphere((0.65, 0.62, 0), 0.55, 1, smooth=True), surface((0.8, 0.6, 0.5), 1.0, 0.3))


@scene("normal-map", "a normal map on a matte and on a shiny sheet", "python")
def _(s: Judged) -> None:
    stage(s)
    texture = s.writer.texture(bumps(5, 12, 0.5))
    slot = {"normalTexture": {"index": texture, "scale": 0.8}}
    s.add(quad((-0.75, 0.8, 0), (1.3, 0, 0), (0, 1.2, -0.4)), matte((0.7, 0.7, 0.6)) | slot)
    s.add(quad((0.75, 0.8, 0), (1.3, 0, 0), (0, 1.2, -0.4)), surface((0.8, 0.7, 0.5), 1.0, 0.35) | slot)


@scene("normal-map-grazing", "normal maps under a sun that grazes them: matte, metal, and a clearcoat's own", "python", size=SMALL)
def _(s: Judged) -> None:
    s.floor(matte((0.5, 0.45, 0.4)))
    texture = s.writer.texture(bumps(6, 34, 0.7))
    slot = {"normalTexture": {"index": texture}}
    s.add(quad((-1.15, 0.3, 0.2), (1.05, 0, 0), (0, 0, -2.6)), matte((0.8, 0.7, 0.6)) | slot)
    s.add(quad((0.0, 0.3, 0.2), (1.05, 0, 0), (0, 0, -2.6)), surface((0.8, 0.7, 0.5), 1.0, 0.5) | slot)
    coat = khr(clearcoat={"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.45, "clearcoatNormalTexture": {"index": texture}})
    s.add(quad((1.15, 0.3, 0.2), (1.05, 0, 0), (0, 0, -2.6)), surface((0.2, 0.4, 0.7), 0.0, 0.7, extensions=coat))
    s.light("directional", 8.0, (2.0, 0.5, -2.0), color=[1.0, 0.9, 0.8])
    s.sky(0.1, 0.12, 0.15)


@scene("compensation", "energy compensation: rough metal, plastic and glass", "python", size=SMALL, compensation=True)
def _(s: Judged) -> None:
    stage(s)
    ball(s, surface((0.9, 0.6, 0.3), 1.0, 0.8), middle=(-0.85, 0.5, 0.2), radius=0.42)
    ball(s, surface((0.7, 0.7, 0.7), 0.0, 0.6, extensions=khr(ior={"ior": 2.0})), middle=(0.05, 0.5, 0.4), radius=0.42)
    ball(s, glass(0.6, (0.9, 0.95, 1.0), 1.5), middle=(0.95, 0.5, 0.2), radius=0.42)


@scene("glass", "a glass ball", "stock")
def _(s: Judged) -> None:
    stage(s)
    ball(s, glass())


@scene("glass-absorbing", "glass in which light is absorbed", "stock", integrator="volpath")
def _(s: Judged) -> None:
    stage(s)
    ball(s, glass(ior=1.4, attenuationColor=[0.3, 0.7, 0.9], attenuationDistance=0.6))


@scene("glass-rough", "rough glass, tinted, absorbing", "python")
def _(s: Judged) -> None:
    stage(s)
    ball(s, glass(0.4, (0.9, 0.95, 1.0), 1.5, attenuationColor=[0.8, 0.5, 0.3], attenuationDistance=1.0))


@scene("thin", "thin walls that transmit, clear and frosted", "python")
def _(s: Judged) -> None:
    stage(s)
    clear = surface((0.9, 0.6, 0.5), 0.0, 0.0, extensions=khr(transmission={"transmissionFactor": 1.0}), doubleSided=True)
    frosted = surface((0.6, 0.9, 0.7), 0.0, 0.5, extensions=khr(transmission={"transmissionFactor": 0.8}), doubleSided=True)
    s.add(quad((-0.75, 0.8, 0.3), (1.3, 0, 0.3), (0, 1.2, 0.2)), clear)
    s.add(quad((0.75, 0.8, 0.3), (1.3, 0, -0.3), (0, 1.2, 0.2)), frosted)
    ball(s, matte((0.2, 0.3, 0.8)), middle=(0, 0.5, -0.9), radius=0.45)


@scene("thin-straight", "a sun and a point light through smooth thin walls, which are no bounces", "python", integrator="volpath", max_depth=2, size=SMALL)
def _(s: Judged) -> None:
    s.floor()
    ball(s, matte((0.7, 0.5, 0.3)), middle=(-0.2, 0.5, 0.0), radius=0.45)
    for color, factor, x in [((0.9, 0.6, 0.5), 0.9, 0.75), ((0.6, 0.9, 0.95), 1.0, 0.95)]:
        wall = surface(color, 0.0, 0.0, extensions=khr(transmission={"transmissionFactor": factor}), doubleSided=True)
        s.add(quad((x, 0.8, 0), (0, 0, 2.4), (0.1, 1.5, 0)), wall)
    wall = surface((0.8, 0.9, 0.7), 0.0, 0.0, extensions=khr(transmission={"transmissionFactor": 1.0}, ior={"ior": 1.8}))
    s.add(quad((-0.9, 0.7, 1.1), (0.9, 0, 0.2), (0, 1.3, -0.1)), wall)
    s.light("directional", 3.0, (2.0, 1.6, 0.3), color=[1.0, 0.9, 0.8])
    s.light("point", 6.0, (1.8, 1.4, 1.0), color=[0.4, 0.6, 1.0])
    s.sky(0.1, 0.12, 0.15)


@scene("nested", "glass that holds water, and an absorbing body around another", "stock", integrator="volpath", size=SMALL)
def _(s: Judged) -> None:
    stage(s)
    ball(s, glass(ior=1.5), middle=(-0.65, 0.62, 0), radius=0.55)
    ball(s, glass(ior=1.33, attenuationColor=[0.4, 0.6, 0.9], attenuationDistance=0.7), middle=(-0.65, 0.62, 0), radius=0.42)
    ball(s, glass(ior=1.4, attenuationColor=[0.9, 0.5, 0.3], attenuationDistance=0.5), middle=(0.65, 0.62, 0), radius=0.55)
    s.add(box((0.45, 0.4, -0.2), (0.85, 0.75, 0.2)), glass(ior=1.8, attenuationColor=[0.3, 0.9, 0.5], attenuationDistance=0.4))


@scene("camera-inside", "a camera in a body that absorbs", "stock", integrator="volpath", size=SMALL)
def _(s: Judged) -> None:
    stage(s)
    ball(s, matte((0.8, 0.5, 0.3)))
    s.add(turned_box((0.5, 1.9, 3.8), (2.0, 1.5, 2.2), 0.2), glass(ior=1.25, attenuationColor=[0.5, 0.7, 0.9], attenuationDistance=1.5))
    s.add(box((-0.1, 1.5, 3.2), (0.25, 1.75, 3.5)), matte((0.3, 0.6, 0.4)))


@scene("clearcoat-smooth", "a smooth coat on a matte and a rough body", "python")
def _(s: Judged) -> None:
    stage(s)
    coat = khr(clearcoat={"clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.0})
    ball(s, matte((0.7, 0.1, 0.1)) | {"extensions": NO_SPECULAR | coat}, middle=(-0.65, 0.62, 0), radius=0.55)
    ball(s, surface((0.2, 0.3, 0.7), 0.0, 0.5, extensions=coat), middle=(0.65, 0.62, 0), radius=0.55)


@scene("clearcoat-rough", "a rough coat, whole and in part, on a metal", "python")
def _(s: Judged) -> None:
    stage(s)
    for x, factor, roughness in [(-0.65, 1.0, 0.3), (0.65, 0.6, 0.5)]:
        coat = khr(clearcoat={"clearcoatFactor": factor, "clearcoatRoughnessFactor": roughness})
        ball(s, surface((0.9, 0.6, 0.3), 1.0, 0.6, extensions=coat), middle=(x, 0.62, 0), radius=0.55)


@scene("sheen", "sheen of two roughnesses over a colour", "python")
def _(s: Judged) -> None:
    stage(s)
    for x, color, roughness in [(-0.65, [0.9, 0.7, 0.8], 0.3), (0.65, [0.4, 0.6, 0.9], 0.8)]:
        sheen = khr(sheen={"sheenColorFactor": color, "sheenRoughnessFactor": roughness})
        ball(s, surface((0.4, 0.1, 0.15), 0.0, 0.8, extensions=sheen), middle=(x, 0.62, 0), radius=0.55)


@scene("anisotropy", "brushed sheets, the direction turned on one of them", "python")
def _(s: Judged) -> None:
    stage(s)
    for x, strength, turn in [(-0.75, 0.8, 0.0), (0.75, 0.6, 0.7)]:
        brushed = khr(anisotropy={"anisotropyStrength": strength, "anisotropyRotation": turn})
        s.add(quad((x, 0.8, 0), (1.3, 0, 0), (0, 1.2, -0.5)), surface((0.9, 0.8, 0.7), 1.0, 0.3, extensions=brushed))


@scene("anisotropy-tube", "a brushed tube with smooth normals", "python")
def _(s: Judged) -> None:
    stage(s)
    brushed = khr(anisotropy={"anisotropyStrength": 0.7, "anisotropyRotation": 0.4})
    tube = surface((0.9, 0.8, 0.7), 1.0, 0.35, extensions=brushed, doubleSided=True)
    s.add(cylinder((0, 0.75, 0), 0.6, 1.3), tube)


@scene("layers", "coat, sheen, anisotropy and a metal in part", "python")
def _(s: Judged) -> None:
    stage(s)
    extensions = khr(
        clearcoat={"clearcoatFactor": 0.7, "clearcoatRoughnessFactor": 0.25},
        sheen={"sheenColorFactor": [0.3, 0.5, 0.4], "sheenRoughnessFactor": 0.5},
        anisotropy={"anisotropyStrength": 0.5, "anisotropyRotation": 1.0},
        specular={"specularFactor": 0.8, "specularColorFactor": [1.0, 0.8, 0.6]},
        ior={"ior": 1.7},
    )
    s.add(quad((0, 0.8, 0), (1.8, 0, 0), (0, 1.3, -0.4)), surface((0.7, 0.4, 0.3), 0.4, 0.4, extensions=extensions))


def environment() -> Array:
    """A sky that brightens towards one side, a dark ground, and a sun of one texel; the map is interpolated between texels."""
    w, h = 64, 32
    y, x = np.mgrid[0:h, 0:w]
    theta, phi = (y + 0.5) / h * np.pi, (x + 0.5) / w * 2 * np.pi
    up = np.cos(theta)
    sky = np.where(up > 0, 0.5 + 0.4 * up, 0.15)[..., None] * np.array([0.5, 0.7, 1.0])
    side = (1 + 0.5 * np.cos(phi - 1.0))[..., None]
    image = sky * side
    image[8, 41] = [400, 360, 300]
    return image.astype(np.float32)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.parse_args()
    # only to write an EXR
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    folder = TESTS / "scenes"
    folder.mkdir(parents=True, exist_ok=True)
    mi.Bitmap(environment()).write(str(folder / ENVIRONMENT))
    entries = []
    for name, make in SCENES.items():
        s = make()
        s.writer.write(folder / f"{name}.gltf")
        awaits = {"awaits": AWAITS[name]} if name in AWAITS else {}
        entries.append({"name": name, "judge": s.judge, "about": s.about} | s.more | awaits)
    lines = ",\n".join("  " + json.dumps(e) for e in entries)
    (TESTS / "scenes.json").write_text(f"[\n{lines}\n]\n")
    print(f"{len(entries)} scenes, {sum(f.stat().st_size for f in folder.iterdir()) / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
