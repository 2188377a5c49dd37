#!/usr/bin/env python3
"""Renders the judge's scenes with Mitsuba 3 and writes tests/judge/NAME.exr: mean radiance R, G, B and variance.R, .G, .B of that mean.

    python3 -m venv venv && venv/bin/pip install mitsuba==3.9.1 numpy
    venv/bin/python scripts/judge/scenes.py                  # the scenes and scenes.json
    venv/bin/python scripts/judge/render.py                  # all of them
    venv/bin/python scripts/judge/render.py glass cornell    # these

The variant llvm_ad_rgb needs LLVM's shared library (Debian: libllvm15). Images come as blocks of samples with seeds of their own; the variance is
that of the blocks' means. docs/judge.md says what is compared, and how."""

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

# between the two sides of a lamp that shines both ways: Mitsuba's shine one way
GAP = 2e-4
# how much finer than the file Mitsuba's environment is, whose rows lie elsewhere
FINER = 24


def write_ply(path: Path, mesh: gltf.Mesh, smooth: bool) -> None:
    """Binary PLY with what of the mesh Mitsuba is to know."""
    columns = [("x y z", mesh.positions)]
    if smooth:
        columns.append(("nx ny nz", mesh.normals))
    if mesh.uv is not None:
        columns.append(("u v", mesh.uv))
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


class Builder:
    """From glTF to what Mitsuba's load_dict takes."""

    def __init__(self, scene: gltf.Scene, entry: dict[str, Any], folder: Path) -> None:
        self.scene, self.entry, self.folder = scene, entry, folder
        self.count = 0

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
            return {"type": "dielectric", "int_ior": extensions["KHR_materials_ior"]["ior"], "ext_ior": 1.0}
        return None

    def alpha(self, material: dict[str, Any], inner: dict[str, Any]) -> dict[str, Any]:
        """What is there in part."""
        mode, pbr = material.get("alphaMode", "OPAQUE"), material["pbrMetallicRoughness"]
        if mode == "OPAQUE":
            return inner
        texture = self.scene.texture(pbr["baseColorTexture"])
        opacity = texture.raw()[..., 3:] * pbr.get("baseColorFactor", [1, 1, 1, 1])[3]
        if mode == "MASK":
            assert texture.nearest, "a cutoff of what is interpolated"
            opacity = (opacity >= material.get("alphaCutoff", 0.5)).astype(float)
        return {"type": "mask", "opacity": bsdf.bitmap(texture, opacity), "bsdf": inner}

    def material(self, part: gltf.Part) -> dict[str, Any]:
        # stock BSDFs know nothing of shading normals that send light through the surface
        inner = self.stock(part) if is_flat(part.mesh) else None
        if inner is None:
            assert self.entry["judge"] == "python", f"{self.entry['name']} is not for Mitsuba's own BSDFs: {part.material}"
            bsdf.DESCRIPTIONS.append(
                bsdf.Description(part.material, self.scene, part.mesh.colors is not None, part.mesh.tangents is not None)
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
        radiance = rgb(factor) if texture is None else bsdf.bitmap(texture, texture.linear()[..., :3] * factor)
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
        for side in sides:
            path = self.folder / f"{self.count}.ply"
            write_ply(path, side, smooth)
            shape = {"type": "ply", "filename": str(path), "face_normals": not smooth, "bsdf": material}
            if emission:
                shape["emitter"] = emission
            volume = part.material.get("extensions", {}).get("KHR_materials_volume", {})
            if material["type"] == "dielectric" and "attenuationDistance" in volume:
                sigma = -np.log(volume["attenuationColor"]) / volume["attenuationDistance"]
                # Mitsuba scales the coefficient: the largest one stays outside
                shape["interior"] = {"type": "homogeneous", "albedo": 0.0, "sigma_t": rgb(sigma / sigma.max()), "scale": float(sigma.max())}
            loaded = mi.load_dict(shape)
            for name, values in [("vertex_color", side.colors), ("vertex_tangent", side.tangents)]:
                if values is not None:
                    loaded.add_attribute(name, 3, mi.Float(values[:, :3].astype(np.float32).ravel()))
            out[f"shape_{self.count}"] = loaded
            self.count += 1
        return out

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
        common = {"film": film, "sampler": {"type": "independent"}, "near_clip": 1e-3, "far_clip": 1e4}
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
        environment = self.environment()
        if environment:
            d["environment"] = environment
        return mi.load_dict(d)


def finer(texels: np.ndarray) -> np.ndarray:
    """The environment of docs/path.md at `FINER` times the size, as Mitsuba places texels: bilinear between middles of texels, -z in the middle,
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
    parser.add_argument("--out", type=Path, default=TESTS, help="folder of the images (tests/judge)")
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
