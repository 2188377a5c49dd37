#!/usr/bin/env python3
"""Renders the judge's scenes with Mitsuba 3 and writes tests/mitsuba/NAME.exr: mean radiance R, G, B and variance.R, .G, .B of that mean.

    python3 -m venv venv && venv/bin/pip install mitsuba==3.9.1 numpy
    venv/bin/python scripts/mitsuba/scenes.py                  # the scenes and scenes.json
    venv/bin/python scripts/mitsuba/render.py                  # all of them
    venv/bin/python scripts/mitsuba/render.py glass cornell    # these

The variant llvm_ad_rgb needs LLVM's shared library (Debian: libllvm15). Images come as blocks of samples with seeds of their own; the variance is
that of the blocks' means. docs/design/mitsuba.md says what is compared, and how."""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")

import bsdf  # noqa: E402  (plugins derive from classes of the variant)
import emitters  # noqa: E402
import gltf  # noqa: E402
from scenes import TESTS  # noqa: E402

# between the two sides of an emitter that emits both ways: Mitsuba's emit one way
GAP = 2e-4
# at this distance a disk is a directional light with an angle; what its rays differ by over a scene is below 1e-4
FAR = 1e5
# how much finer than the file Mitsuba's environment is, whose rows lie elsewhere
FINER = 24


def write_ply(path: Path, mesh: gltf.Mesh, smooth: bool, uv: np.ndarray | None) -> None:
    """Binary PLY: positions, normals where they are not those of the faces, and one set of texture coordinates."""
    columns = [("x y z", mesh.positions)]
    if smooth:
        columns.append(("nx ny nz", mesh.normals))
    if uv is not None:
        columns.append(("u v", uv))
    names = " ".join(n for n, _ in columns).split()
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(mesh.positions)}"]
    header += [f"property float {n}" for n in names]
    header += [f"element face {len(mesh.indices)}", "property list uchar int vertex_indices", "end_header"]
    faces = np.empty(len(mesh.indices), np.dtype([("n", "u1"), ("i", "<i4", 3)]))
    faces["n"], faces["i"] = 3, mesh.indices
    data = np.concatenate([v for _, v in columns], 1).astype("<f4").tobytes() + faces.tobytes()
    path.write_bytes("\n".join(header).encode() + b"\n" + data)


def is_flat(mesh: gltf.Mesh) -> bool:
    """Are the normals those of the triangles?"""
    a, b, c = (mesh.positions[mesh.indices[:, k]] for k in range(3))
    plane = gltf.unit(np.cross(b - a, c - a))
    return bool(np.all(np.sum(mesh.normals[mesh.indices] * plane[:, None], -1) > 1 - 1e-6))


def rgb(color: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(c) for c in color[:3]]}


def light_spec(text: str) -> tuple[str, dict[str, Any]]:
    """The kind of a light of `--light`, and its values; `power` is the colour times intensity, irradiance or radiance."""
    kind, *words = text.split()
    numbers = {k: np.array([float(x) for x in v.split(",")]) for k, v in (w.split("=") for w in words)}
    strength = next(numbers[k] for k in ("intensity", "irradiance", "radiance") if k in numbers)
    return kind, numbers | {"power": strength * numbers.get("color", np.ones(3))}


def facing(position: Any, direction: Any, half: Any) -> Any:
    """The transform of a unit square or disk at a position, which faces a direction, its first axis horizontal; docs/design/paths.md."""
    front = gltf.unit(np.array(direction, float))
    u = np.cross([0, 1, 0], front)
    u = gltf.unit(u) if np.linalg.norm(u) > 1e-6 else np.array([1.0, 0, 0])
    m = np.eye(4)
    m[:3] = np.stack([u * half[0], np.cross(front, u) * half[1], front, position], 1)
    return mi.ScalarTransform4f(m)


def is_inside(point: np.ndarray, mesh: gltf.Mesh) -> bool:
    """Does a closed mesh hold a point? By the solid angle that its triangles fill (van Oosterom and Strackee 1983)."""
    a, b, c = (mesh.positions[mesh.indices[:, k]] - point for k in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=-1) for x in (a, b, c))
    dot = lambda x, y: np.sum(x * y, -1)  # noqa: E731
    angle = 2 * np.arctan2(dot(a, np.cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb)
    return bool(abs(angle.sum()) > 2 * np.pi)


class Builder:
    """From glTF to what Mitsuba's load_dict takes."""

    def __init__(self, scene: gltf.Scene, entry: dict[str, Any], folder: Path) -> None:
        self.scene, self.entry, self.folder = scene, entry, folder
        self.count = 0
        self.volumes = [part for part in scene.parts if "KHR_materials_volume" in part.material.get("extensions", {})]
        self.media: dict[int, Any] = {}

    def volume_at(self, point: np.ndarray, but: gltf.Part | None = None) -> gltf.Part | None:
        """The innermost volume that holds a point."""
        holding = [v for v in self.volumes if v is not but and is_inside(point, v.mesh)]
        return min(holding, key=lambda v: np.prod(np.ptp(v.mesh.positions, axis=0)), default=None)

    def medium(self, part: gltf.Part | None) -> Any:
        """What fills a volume, if that absorbs; one object, which all surfaces of the volume refer to."""
        volume = {} if part is None else part.material["extensions"]["KHR_materials_volume"]
        if "attenuationDistance" not in volume:
            return None
        if id(part) not in self.media:
            sigma = -np.log(volume["attenuationColor"]) / volume["attenuationDistance"]
            # Mitsuba scales the coefficient: the largest one stays outside
            medium = {"type": "homogeneous", "albedo": 0.0, "sigma_t": rgb(sigma / sigma.max()), "scale": float(sigma.max())}
            self.media[id(part)] = mi.load_dict(medium)
        return self.media[id(part)]

    def surroundings(self, part: gltf.Part) -> gltf.Part | None:
        """The volume that a volume is in."""
        return self.volume_at(part.mesh.positions[0], part)

    def base(self, part: gltf.Part) -> dict[str, Any]:
        """Base colour as a texture of Mitsuba's: a factor and one of texture and colours at vertices."""
        pbr = part.material["pbrMetallicRoughness"]
        factor = np.array(pbr.get("baseColorFactor", [1, 1, 1, 1])[:3])
        texture = self.scene.texture(pbr.get("baseColorTexture"))
        if texture is not None:
            return bsdf.bitmap(texture, texture.linear()[..., :3] * factor)
        if part.mesh.colors is not None:
            part.mesh.colors[:, :3] *= factor
            return {"type": "mesh_attribute", "name": "vertex_color"}
        return rgb(factor)

    def stock(self, part: gltf.Part) -> dict[str, Any] | None:
        """Mitsuba's own BSDF where it is the same."""
        m = part.material
        pbr, extensions = m["pbrMetallicRoughness"], m.get("extensions", {})
        names = {n.removeprefix("KHR_materials_") for n in extensions} - {"emissive_strength"}
        metallic, roughness = pbr.get("metallicFactor", 1.0), pbr.get("roughnessFactor", 1.0)
        if "normalTexture" in m:
            return None
        if "unlit" in names:
            return {"type": "diffuse", "reflectance": rgb([0, 0, 0])}
        if names == {"specular"} and extensions["KHR_materials_specular"] == {"specularFactor": 0.0} and metallic == 0:
            return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": self.base(part)}}
        if not names and metallic == 1 and roughness == 0 and pbr["baseColorFactor"] == [1, 1, 1, 1]:
            return {"type": "twosided", "bsdf": {"type": "conductor", "material": "none"}}
        if names == {"transmission", "volume", "ior"} and roughness == 0 and extensions["KHR_materials_transmission"] == {"transmissionFactor": 1.0}:
            assert pbr["baseColorFactor"] == [1, 1, 1, 1]
            around = self.surroundings(part)
            outer = 1.0 if around is None else around.material["extensions"]["KHR_materials_ior"]["ior"]
            return {"type": "dielectric", "int_ior": extensions["KHR_materials_ior"]["ior"], "ext_ior": outer}
        return None

    def opacity(self, material: dict[str, Any]) -> tuple[gltf.Texture, np.ndarray] | None:
        """Alpha per texel, of what is not opaque."""
        mode, pbr = material.get("alphaMode", "OPAQUE"), material["pbrMetallicRoughness"]
        if mode == "OPAQUE":
            return None
        texture = self.scene.texture(pbr["baseColorTexture"])
        opacity = texture.raw()[..., 3:] * pbr.get("baseColorFactor", [1, 1, 1, 1])[3]
        if mode == "MASK":
            assert texture.nearest, "a cutoff of what is interpolated"
            opacity = (opacity >= material.get("alphaCutoff", 0.5)).astype(float)
        return texture, opacity

    def alpha(self, material: dict[str, Any], inner: dict[str, Any]) -> dict[str, Any]:
        """A material with its alpha."""
        opacity = self.opacity(material)
        return inner if opacity is None else {"type": "mask", "opacity": bsdf.bitmap(*opacity), "bsdf": inner}

    def material(self, part: gltf.Part) -> dict[str, Any]:
        # stock BSDFs know nothing of shading normals that send light through the surface
        inner = self.stock(part) if is_flat(part.mesh) else None
        if inner is None:
            assert self.entry["judge"] == "python", f"{self.entry['name']} is not for Mitsuba's own BSDFs: {part.material}"
            bsdf.DESCRIPTIONS.append(
                bsdf.Description(
                    part.material,
                    self.scene,
                    part.mesh.colors is not None,
                    part.mesh.tangents is not None,
                    self.entry.get("compensation", False),
                )
            )
            inner = {"type": "gltf", "description": len(bsdf.DESCRIPTIONS) - 1}
        return self.alpha(part.material, inner)

    def emission(self, material: dict[str, Any]) -> dict[str, Any] | None:
        extensions = material.get("extensions", {})
        if "KHR_materials_unlit" in extensions:
            return {"type": "area", "radiance": rgb(material["pbrMetallicRoughness"]["baseColorFactor"])}
        strength = extensions.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
        factor = np.array(material.get("emissiveFactor", [0, 0, 0])) * strength
        if not factor.any():
            return None
        texture = self.scene.texture(material.get("emissiveTexture"))
        values = None if texture is None else texture.linear()[..., :3] * factor
        opacity = self.opacity(material)
        if opacity is not None:
            # Mitsuba's emitters do not know the alpha of their surfaces
            if texture is None:
                texture, values = opacity[0], opacity[1] * factor
            else:
                assert texture.nearest and opacity[0].nearest and texture.pixels.shape == opacity[0].pixels.shape
                values = values * opacity[1]
        radiance = rgb(factor) if texture is None else bsdf.bitmap(texture, values)
        return {"type": "area", "radiance": radiance}

    def shapes(self, part: gltf.Part) -> dict[str, Any]:
        """A shape, and its other side where it shines both ways."""
        mesh, out = part.mesh, {}
        smooth = not is_flat(mesh)
        material, emission = self.material(part), self.emission(part.material)
        sides = [mesh]
        if emission and part.material.get("doubleSided") and "KHR_materials_unlit" not in part.material.get("extensions", {}):
            assert not smooth
            down = 0.5 * GAP * mesh.normals
            back = gltf.Mesh(mesh.positions - down, -mesh.normals, mesh.indices[:, ::-1], mesh.uv)
            sides = [gltf.Mesh(mesh.positions + down, mesh.normals, mesh.indices, mesh.uv), back]
        # Mitsuba's own BSDFs know one set of texture coordinates; ours find the second as an attribute
        slot = part.material["pbrMetallicRoughness"].get("baseColorTexture", {}) | part.material.get("emissiveTexture", {})
        second = material["type"] != "gltf" and slot.get("texCoord", 0) == 1
        for side in sides:
            shape: dict[str, Any] = {"bsdf": material}
            if part.name == "sphere":
                # the analytic sphere that the mesh stands for
                radius = np.linalg.norm(part.to_world[:3, 0])
                shape |= {"type": "sphere", "center": part.to_world[:3, 3].tolist(), "radius": float(radius)}
            else:
                path = self.folder / f"{self.count}.ply"
                write_ply(path, side, smooth, side.uv1 if second else side.uv)
                shape |= {"type": "ply", "filename": str(path), "face_normals": not smooth}
            if emission:
                shape["emitter"] = emission
            if material["type"] == "dielectric":
                media = {"interior": self.medium(part), "exterior": self.medium(self.surroundings(part))}
                shape |= {k: m for k, m in media.items() if m is not None}
            loaded = mi.load_dict(shape)
            uv1 = None if side.uv1 is None else np.pad(side.uv1, ((0, 0), (0, 1)))
            for name, values in [("vertex_color", side.colors), ("vertex_tangent", side.tangents), ("vertex_uv1", uv1)]:
                if values is not None and part.name != "sphere":
                    loaded.add_attribute(name, 3, mi.Float(values[:, :3].astype(np.float32).ravel()))
            out[f"shape_{self.count}"] = loaded
            self.count += 1
        return out

    def option_light(self, text: str) -> dict[str, Any]:
        """A light of `--light`."""
        kind, v = light_spec(text)
        if kind == "point":
            return {"type": "point", "position": v["position"].tolist(), "intensity": rgb(v["power"])}
        if kind == "sun" and "angle" not in v:
            return {"type": "directional", "direction": v["direction"].tolist(), "irradiance": rgb(v["power"])}
        shape: dict[str, Any] = {"bsdf": {"type": "diffuse", "reflectance": rgb([0, 0, 0])}}
        shape["emitter"] = {"type": "area", "radiance": rgb(v["power"])}
        if kind == "sun":
            half = np.radians(0.5 * v["angle"][0])
            middle = -FAR * gltf.unit(v["direction"])
            shape["emitter"]["radiance"] = rgb(v["power"] / (np.pi * np.sin(half) ** 2))
            radius = FAR * np.tan(half)
            return shape | {"type": "disk", "to_world": facing(middle, v["direction"], [radius, radius])}
        if kind == "sphere":
            return shape | {"type": "sphere", "center": v["position"].tolist(), "radius": float(v["radius"][0])}
        half = 0.5 * v["size"] if kind == "rectangle" else np.repeat(v["radius"], 2)
        return shape | {"type": kind, "to_world": facing(v["position"], v["direction"], half)}

    def light(self, light: dict[str, Any]) -> dict[str, Any]:
        intensity = np.array(light.get("color", [1, 1, 1])) * light.get("intensity", 1.0)
        position, axis = light["position"], light["axis"]
        target = position + axis
        kind, spot = light["type"], light.get("spot", {})
        if kind == "directional":
            return {"type": "directional", "direction": axis.tolist(), "irradiance": rgb(intensity)}
        if kind == "point" and "range" not in light:
            return {"type": "point", "position": position.tolist(), "intensity": rgb(intensity)}
        inner, outer = spot.get("innerConeAngle", 0.0), spot.get("outerConeAngle", np.pi / 4)
        if kind == "spot" and "range" not in light and inner == outer:
            up = [0, 0, 1] if abs(axis[1]) > 0.9 else [0, 1, 0]
            # Mitsuba wants some width between the cones
            cones = {"beam_width": np.degrees(inner) - 1e-3, "cutoff_angle": np.degrees(outer)}
            to_world = mi.ScalarTransform4f().look_at(position.tolist(), target.tolist(), up)
            return {"type": "spot", "to_world": to_world, "intensity": rgb(intensity)} | cones
        assert self.entry["judge"] == "python"
        cos = (np.cos(inner), np.cos(outer)) if kind == "spot" else (-2.0, -3.0)
        numbers = {f"position_{k}": v for k, v in zip("xyz", position)} | {f"axis_{k}": v for k, v in zip("xyz", axis)}
        numbers |= {f"intensity_{k}": v for k, v in zip("rgb", intensity)}
        numbers |= {"cos_inner": cos[0], "cos_outer": cos[1], "range": light.get("range", 1e9)}
        return {"type": "punctual"} | {k: float(v) for k, v in numbers.items()}

    def environment(self) -> dict[str, Any] | None:
        given = self.entry.get("environment")
        if given is None:
            return None
        if isinstance(given, list):
            return {"type": "constant", "radiance": rgb(given)}
        texels = np.array(mi.Bitmap(str(TESTS / "scenes" / given)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
        return {"type": "envmap", "bitmap": mi.Bitmap(finer(texels)), "scale": 1.0}

    def sensor(self) -> dict[str, Any]:
        m, camera = self.scene.camera_to_world, self.scene.camera
        # Mitsuba looks along +z, and its x is to the left
        to_world = m @ np.diag([-1.0, 1, -1, 1])
        width, height = self.entry.get("size", [32, 32])
        film = {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb", "component_format": "float32"}
        film["rfilter"] = {"type": "box"}
        common = {"film": film, "sampler": {"type": "independent"}, "near_clip": 1e-3, "far_clip": 10 * FAR}
        medium = self.medium(self.volume_at(m[:3, 3]))
        if medium is not None:
            common["medium"] = medium
        if camera["type"] == "orthographic":
            half = camera["orthographic"]["ymag"]
            to_world = to_world @ np.diag([half * width / height, half, 1.0, 1.0])
            return {"type": "orthographic", "to_world": mi.ScalarTransform4f(to_world)} | common
        common |= {"fov": float(np.degrees(camera["perspective"]["yfov"])), "fov_axis": "y", "to_world": mi.ScalarTransform4f(to_world)}
        lens = self.entry.get("lens")
        if lens:
            return {"type": "thinlens", "aperture_radius": lens["radius"], "focus_distance": lens["focus"]} | common
        return {"type": "perspective"} | common

    def build(self) -> Any:
        depth = self.entry.get("max_depth")
        # bounces: Mitsuba counts the surface that shines, too
        integrator = {"type": self.entry.get("integrator", "path"), "max_depth": -1 if depth is None else depth + 1}
        d = {"type": "scene", "integrator": integrator, "sensor": self.sensor()}
        for part in self.scene.parts:
            d |= self.shapes(part)
        d |= {f"light_{k}": self.light(light) for k, light in enumerate(self.scene.lights)}
        d |= {f"option_light_{k}": self.option_light(text) for k, text in enumerate(self.entry.get("lights", []))}
        environment = self.environment()
        if environment:
            d["environment"] = environment
        return mi.load_dict(d)


def finer(texels: np.ndarray) -> np.ndarray:
    """The environment of docs/design/paths.md at `FINER` times the size, as Mitsuba places texels: bilinear between middles of texels, -z in the middle,
    to rows from pole to pole and columns that begin at -z."""
    h, w, _ = texels.shape
    rows, columns = h * FINER + 1, w * FINER
    # middles of Mitsuba's columns lie half a texel from the edge; half a turn apart from ours
    u = ((np.arange(columns) + 0.5) / columns + 0.5) % 1.0 * w - 0.5
    v = np.arange(rows) / (rows - 1) * h - 0.5
    x, y = np.floor(u).astype(int), np.floor(v).astype(int)
    fx, fy = (u - x)[None, :, None], (v - y)[:, None, None]
    left, right, above, below = x % w, (x + 1) % w, np.clip(y, 0, h - 1), np.clip(y + 1, 0, h - 1)

    def row(k: np.ndarray) -> np.ndarray:
        return texels[k][:, left] * (1 - fx) + texels[k][:, right] * fx

    return (row(above) * (1 - fy) + row(below) * fy).astype(np.float32)


def render(scene: Any, size: list[int], spp: int, blocks: int, limit: float) -> tuple[np.ndarray, np.ndarray, int]:
    """Mean and variance of the mean, by blocks of samples; and how many blocks there was time for."""
    total = np.zeros((size[1], size[0], 3))
    squares = np.zeros_like(total)
    begin, done = time.time(), 0
    for k in range(blocks):
        image = np.array(mi.render(scene, spp=spp // blocks, seed=1000 + k), np.float64)[..., :3]
        assert np.isfinite(image).all(), "not finite"
        total += image
        squares += image * image
        done = k + 1
        if done >= 16 and time.time() - begin > limit:
            break
    mean = total / done
    return mean, np.maximum(squares / done - mean * mean, 0) / (done - 1), done


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="scenes; all without")
    parser.add_argument("--spp", type=int, help="samples per pixel instead of scenes.json's judge_spp (32768)")
    parser.add_argument("--blocks", type=int, default=64, help="blocks of samples, 16 or more (64)")
    parser.add_argument("--limit", type=float, default=60.0, help="seconds per scene; what is done by then is written (60)")
    parser.add_argument("--threads", type=int, help="threads that render; all without")
    parser.add_argument("--out", type=Path, default=TESTS, help="folder of the images (tests/mitsuba)")
    args = parser.parse_args()
    bsdf.register()
    emitters.register()
    entries = {e["name"]: e for e in json.loads((TESTS / "scenes.json").read_text())}
    unknown = [n for n in args.names if n not in entries]
    if unknown:
        sys.exit(f"no such scene: {', '.join(unknown)}; there are {', '.join(entries)}")
    for name in args.names or entries:
        entry, begin = entries[name], time.time()
        with tempfile.TemporaryDirectory() as folder:
            scene = Builder(gltf.read(TESTS / "scenes" / f"{name}.gltf"), entry, Path(folder)).build()
        size, spp = entry.get("size", [32, 32]), args.spp or entry.get("judge_spp", 32768)
        # while it renders only: with one thread Mitsuba never comes back from reading an EXR
        threads = dr.thread_count()
        dr.set_thread_count(args.threads or threads)
        mean, variance, done = render(scene, size, spp, args.blocks, args.limit)
        dr.set_thread_count(threads)
        planes = np.concatenate([mean, variance], -1).astype(np.float32)
        channels = ["R", "G", "B", "variance.R", "variance.G", "variance.B"]
        bitmap = mi.Bitmap(planes, mi.Bitmap.PixelFormat.MultiChannel, channels)
        bitmap.metadata()["skylit.judge"] = f"mitsuba {mi.__version__}"
        bitmap.metadata()["skylit.spp"] = str(spp // args.blocks * done)
        bitmap.write(str(args.out / f"{name}.exr"))
        error = np.sqrt(variance.sum((0, 1))) / mean[..., 0].size
        relative = ", ".join(f"{m:.5f} +- {100 * e / m:.3f} %" for m, e in zip(mean.mean((0, 1)), error))
        print(f"{name:20} {spp // args.blocks * done:6} spp {time.time() - begin:6.1f} s  {relative}", flush=True)


if __name__ == "__main__":
    main()
