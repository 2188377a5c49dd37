#!/usr/bin/env python3
"""Mitsuba 3's path tracer as a peer of `skylit bench path`. docs/reference/benchmarks.md has the protocol.

    pip install mitsuba==3.9.1 numpy      # and LLVM's shared library: DRJIT_LIBLLVM_PATH names it where it is not found

Materials are Mitsuba's own: diffuse, conductor, roughconductor, dielectric, and principled for glTF's metallic-roughness, whose formula
differs from ours by a few percent; each engine is held against its own reference. What has no counterpart is refused."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

VARIANT = "llvm_ad_rgb"
KERNELS = ["independent", "multijitter"]
# between the two sides of a lamp that shines both ways: Mitsuba's shine one way
GAP = 2e-4


def say(**answer: Any) -> None:
    print(json.dumps(answer), flush=True)


try:
    import drjit as dr
    import mitsuba as mi

    mi.set_variant(VARIANT)
    # what it logs goes to stdout, where the answers are
    mi.set_log_level(mi.LogLevel.Error)
    # finds LLVM, or says that it does not
    dr.eval(mi.Float(1) + dr.arange(mi.Float, 2))
except Exception as e:  # noqa: BLE001  (whatever it is, the bench shows it)
    say(error=f"{type(e).__name__}: {e}")
    sys.exit(1)


def rgb(color: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(c) for c in color[:3]]}


def to_linear(c: np.ndarray) -> np.ndarray:
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def write_ply(path: Path, columns: dict[str, np.ndarray], indices: np.ndarray) -> None:
    names = " ".join(columns).split()
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(columns['x y z'])}"]
    header += [f"property float {n}" for n in names]
    header += [f"element face {len(indices)}", "property list uchar int vertex_indices", "end_header"]
    faces = np.empty(len(indices), np.dtype([("n", "u1"), ("i", "<i4", 3)]))
    faces["n"], faces["i"] = 3, indices
    data = np.concatenate(list(columns.values()), 1).astype("<f4").tobytes()
    path.write_bytes("\n".join(header).encode() + b"\n" + data + faces.tobytes())


class Builder:
    """From the bench's scene to Mitsuba's."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.scene = json.loads((folder / "scene.json").read_text())
        self.bsdfs: dict[int, Any] = {}
        self.texels: dict[int, np.ndarray] = {}

    def array(self, name: str, kind: str, columns: int) -> np.ndarray:
        return np.fromfile(self.folder / name, kind).reshape(-1, columns)

    def image(self, k: int) -> np.ndarray:
        """0 to 1, as stored."""
        if k not in self.texels:
            t = self.scene["textures"][k]
            texels = np.fromfile(self.folder / t["texels"], "u1").reshape(t["height"], t["width"], 4)
            self.texels[k] = texels.astype(np.float32) / 255
        return self.texels[k]

    def bitmap(self, slot: dict[str, Any], values: np.ndarray) -> dict[str, Any]:
        if slot["texcoord"] != 0:
            raise ValueError("a second set of texture coordinates")
        t = self.scene["textures"][slot["texture"]]
        if t["wrap"][0] != t["wrap"][1]:
            raise ValueError("a texture that wraps differently in u and v")
        to_uv = np.eye(4)
        m = slot["transform"]
        to_uv[0, :2], to_uv[0, 3], to_uv[1, :2], to_uv[1, 3] = m[0:2], m[2], m[3:5], m[5]
        return {
            "type": "bitmap",
            "data": mi.TensorXf(np.ascontiguousarray(values.astype(np.float32))),
            "raw": True,
            "format": "variant",
            "filter_type": "nearest" if t["nearest"] else "bilinear",
            "wrap_mode": t["wrap"][0],
            "to_uv": mi.ScalarTransform4f(to_uv),
        }

    def color(self, slot: Any, factor: Any) -> dict[str, Any]:
        if slot is None:
            return rgb(factor)
        return self.bitmap(slot, to_linear(self.image(slot["texture"])[..., :3]) * np.array(factor[:3]))

    def gltf(self, m: dict[str, Any]) -> dict[str, Any]:
        base = self.color(m["base_color_texture"], m["base_color"])
        slot = m["metallic_roughness_texture"]
        metallic, roughness = m["metallic"], m["roughness"]
        if slot is None and metallic == 1 and roughness == 0 and m["base_color_texture"] is None:
            return {"type": "conductor", "material": "none", "specular_reflectance": base}
        principled = {"type": "principled", "base_color": base, "eta": m["ior"]}
        if slot is None:
            principled |= {"metallic": metallic, "roughness": max(roughness, 1e-3)}
        else:
            texels = self.image(slot["texture"])
            principled["metallic"] = self.bitmap(slot, texels[..., 2:3] * metallic)
            principled["roughness"] = self.bitmap(slot, np.maximum(texels[..., 1:2] * roughness, 1e-3))
        return principled

    def bsdf(self, k: int) -> Any:
        if k in self.bsdfs:
            return self.bsdfs[k]
        m = self.scene["materials"][k]
        if m["layers"] or m["unlit"]:
            raise ValueError("a clearcoat, sheen, transmission, anisotropy or no shading at all")
        kind, two_sided = m["kind"], True
        if kind == "matte":
            inner: dict[str, Any] = {"type": "diffuse", "reflectance": self.color(m["base_color_texture"], m["base_color"])}
        elif kind == "mirror":
            inner = {"type": "conductor", "material": "none", "specular_reflectance": rgb(m["specular_color"])}
        elif kind == "glass":
            inner, two_sided = {"type": "dielectric", "int_ior": m["ior"], "ext_ior": 1.0}, False
        elif kind in ("copper", "gold"):
            inner = {"type": "roughconductor", "material": "Cu" if kind == "copper" else "Au", "distribution": "beckmann"}
            inner["alpha"] = m["roughness"] ** 2
        elif kind == "metallicroughness":
            inner = self.gltf(m)
        else:
            raise ValueError(f"material {kind}")
        if m["normal_texture"] is not None:
            texels = self.image(m["normal_texture"]["texture"])[..., :3].copy()
            texels[..., :2] = (texels[..., :2] * 2 - 1) * m["normal_scale"] * 0.5 + 0.5
            # v goes down in glTF, and its y goes up
            texels[..., 1] = 1 - texels[..., 1]
            inner = {"type": "normalmap", "normalmap": self.bitmap(m["normal_texture"], texels), "bsdf": inner}
        if two_sided:
            inner = {"type": "twosided", "bsdf": inner}
        if m["alpha"] != "opaque":
            slot = m["base_color_texture"]
            if slot is None:
                opacity: Any = m["base_color"][3]
            else:
                alpha = self.image(slot["texture"])[..., 3:] * m["base_color"][3]
                opacity = self.bitmap(slot, (alpha >= m["cutoff"]).astype(np.float32) if m["alpha"] == "mask" else alpha)
            inner = {"type": "mask", "opacity": opacity, "bsdf": inner}
        self.bsdfs[k] = mi.load_dict(inner)
        return self.bsdfs[k]

    def shapes(self) -> dict[str, Any]:
        out: dict[str, Any] = {}
        for s in self.scene["spheres"]:
            shape = {"type": "sphere", "center": s["center"], "radius": s["radius"], "bsdf": self.bsdf(s["material"])}
            out[f"shape_{len(out)}"] = self.lit(shape, s["material"])
        for mesh in self.scene["meshes"]:
            if mesh["colors"]:
                raise ValueError("colours at vertices")
            m = self.scene["materials"][mesh["material"]]
            positions, indices = self.array(mesh["positions"], "<f4", 3), self.array(mesh["indices"], "<u4", 3)
            columns = {"x y z": positions}
            if mesh["normals"]:
                columns["nx ny nz"] = self.array(mesh["normals"], "<f4", 3)
            if mesh["uv"]:
                columns["u v"] = self.array(mesh["uv"], "<f4", 2)
            sides = [(columns, indices)]
            if any(m["emissive"]) and m["double_sided"]:
                n = np.cross(positions[indices[0, 1]] - positions[indices[0, 0]], positions[indices[0, 2]] - positions[indices[0, 0]])
                down = 0.5 * GAP * n / np.linalg.norm(n)
                back = columns | {"x y z": positions - down} | ({"nx ny nz": -columns["nx ny nz"]} if mesh["normals"] else {})
                sides = [(columns | {"x y z": positions + down}, indices), (back, indices[:, ::-1])]
            for side, faces in sides:
                path = self.folder / f"{len(out)}.ply"
                write_ply(path, side, faces)
                shape = {"type": "ply", "filename": str(path), "bsdf": self.bsdf(mesh["material"])}
                # without normals of its own it has those of its faces
                shape["face_normals"] = not mesh["normals"]
                out[f"shape_{len(out)}"] = mi.load_dict(self.lit(shape, mesh["material"]))
        return out

    def lit(self, shape: dict[str, Any], material: int) -> dict[str, Any]:
        m = self.scene["materials"][material]
        if any(m["emissive"]):
            shape["emitter"] = {"type": "area", "radiance": self.color(m["emissive_texture"], m["emissive"])}
        return shape

    def light(self, light: dict[str, Any]) -> dict[str, Any]:
        kind, intensity = light["kind"], rgb(light["intensity"])
        if light["range"] is not None:
            raise ValueError("a light with a range")
        if kind == "point":
            return {"type": "point", "position": light["position"], "intensity": intensity}
        if kind == "directional" and light["inner"] == 0:
            return {"type": "directional", "direction": light["direction"], "irradiance": intensity}
        raise ValueError(f"a {kind} light")

    def environment(self) -> dict[str, Any] | None:
        e = self.scene["environment"]
        if e is None:
            return None
        if "radiance" in e:
            return {"type": "constant", "radiance": rgb(e["radiance"])}
        texels = np.fromfile(self.folder / e["texels"], "<f4").reshape(e["height"], e["width"], 3) * np.array(e["factor"])
        # Mitsuba's columns begin half a turn from ours
        texels = np.roll(texels, e["width"] // 2, 1).astype(np.float32)
        to_world = np.eye(4)
        to_world[:3, :3] = np.array(e["to_map"]).reshape(3, 3).T
        return {"type": "envmap", "bitmap": mi.Bitmap(np.ascontiguousarray(texels)), "to_world": mi.ScalarTransform4f(to_world)}

    def sensor(self) -> dict[str, Any]:
        camera, (width, height) = self.scene["camera"], self.scene["size"]
        m = np.eye(4)
        # Mitsuba looks along +z, and its x is to the left
        m[:3, :3] = np.array(camera["rotation"]).reshape(3, 3) @ np.diag([-1.0, 1.0, -1.0])
        m[:3, 3] = camera["position"]
        film = {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb", "component_format": "float32"}
        film["rfilter"] = {"type": "box"}
        common = {"film": film, "near_clip": 1e-3, "far_clip": 1e5}
        if camera["fov_y"] is None:
            half = camera["half_height"]
            m = m @ np.diag([half * width / height, half, 1.0, 1.0])
            return {"type": "orthographic", "to_world": mi.ScalarTransform4f(m)} | common
        fov = float(np.degrees(camera["fov_y"]))
        return {"type": "perspective", "fov": fov, "fov_axis": "y", "to_world": mi.ScalarTransform4f(m)} | common

    def build(self) -> Any:
        d: dict[str, Any] = {"type": "scene"} | self.shapes()
        d |= {f"light_{k}": self.light(light) for k, light in enumerate(self.scene["lights"])}
        environment = self.environment()
        if environment:
            d["environment"] = environment
        return mi.load_dict(d)


class Peer:
    def __init__(self) -> None:
        self.world: Any = None
        self.sensors: dict[str, Any] = {}
        self.integrator = mi.load_dict({"type": "path", "max_depth": -1, "rr_depth": 5})

    def scene(self, folder: str) -> None:
        builder, start = Builder(Path(folder)), time.perf_counter()
        self.world = builder.build()
        self.sensors = {k: mi.load_dict(builder.sensor() | {"sampler": {"type": k}}) for k in KERNELS}
        say(build_seconds=time.perf_counter() - start)

    def render(self, kernel: str, spp: str, seed: str, path: str) -> None:
        start = time.perf_counter()
        image = mi.render(self.world, sensor=self.sensors[kernel], integrator=self.integrator, spp=int(spp), seed=int(seed))
        pixels = np.array(image, np.float32)[..., :3]
        seconds = time.perf_counter() - start
        pixels.tofile(path)
        say(seconds=seconds)


def main() -> None:
    say(protocol=1, peer=f"Mitsuba {mi.__version__}, {VARIANT}", kernels=KERNELS)
    peer = Peer()
    commands = {"scene": peer.scene, "render": peer.render}
    for line in sys.stdin:
        words = line.split()
        if words == ["quit"]:
            return
        try:
            commands[words[0]](*words[1:])
        except Exception as e:  # noqa: BLE001  (the bench shows it and goes on)
            say(error=f"{type(e).__name__}: {e}".replace("\n", " "))


if __name__ == "__main__":
    main()
