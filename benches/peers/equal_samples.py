#!/usr/bin/env python3
"""Error at equal samples: `skylit render --integrator path` beside Mitsuba 3's path tracer with three of its samplers.

    pip install mitsuba==3.9.1 numpy      # and LLVM's shared library: DRJIT_LIBLLVM_PATH names it where it is not found
    python3 benches/peers/equal_samples.py target/release/skylit
    python3 benches/peers/equal_samples.py target/release/skylit disk sky-sun --mitsuba images/mitsuba   # these; Mitsuba's part is kept there

Each scene is rendered with 16, 64 and 256 samples a pixel and several seeds by both, and held against a reference of the same engine: what its
own samples converge to. The references' means must agree. RMSE is over pixels and channels, averaged over seeds as mean squares; the noise of
the reference is taken off it. Mitsuba's reference is made with `multijitter`: what `ldsampler` converges to is off by a tenth of a percent in
some scenes, with any seed, and its errors here hold that. All surfaces are Lambertian, so that both estimate the same image; Mitsuba renders them with its own `diffuse`.
Emitters are out of view: their edges would be most of the error, and say nothing of how light is sampled.

Rectangles and disks are Mitsuba's shapes of these names, spheres its `sphere`: its best case. Everything else that emits is a mesh in both."""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

MITSUBA = Path(__file__).resolve().parents[2] / "scripts" / "mitsuba"
sys.path.insert(0, str(MITSUBA))

import render  # noqa: E402  (sets Mitsuba's variant)
import scenes  # noqa: E402
from gltf import read, unit  # noqa: E402
from scenes import Judged, Mesh, box, flat, glass, icosphere, lamp, matte, patches, quad, surface  # noqa: E402

import mitsuba as mi  # noqa: E402

mi.set_log_level(mi.LogLevel.Error)

SAMPLERS = ["independent", "multijitter", "ldsampler"]
SPP = [16, 64, 256]
# seeds of the images that are held against the reference, and of the reference's parts
FIRST_SEED, FIRST_REFERENCE_SEED = 1, 1001

SCENES: dict[str, Callable[[Judged], None]] = {}


def scene(name: str) -> Callable[[Callable[[Judged], None]], None]:
    def register(build: Callable[[Judged], None]) -> None:
        SCENES[name] = build

    return register


def stage(s: Judged) -> None:
    """Floor, wall, a ball and a box that throw shadows on them, seen from above: emitters hang above the view."""
    s.floor(matte((0.6, 0.6, 0.6)))
    s.add(icosphere((-0.5, 0.45, 0.2), 0.4, 2), matte((0.7, 0.4, 0.3)))
    s.add(box((0.4, 0.02, -0.5), (0.8, 0.8, -0.1)), matte((0.3, 0.5, 0.7)))
    s.camera((0.4, 2.6, 2.6), (0, 0.2, 0), 0.7)


@scene("triangle")
def _(s: Judged) -> None:
    stage(s)
    corners = np.array([(-0.9, 1.9, -0.8), (0.9, 1.6, -0.9), (-0.1, 1.9, 0.3)])
    normal = unit(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
    s.add(Mesh(corners, np.tile(normal, (3, 1)), np.array([[0, 1, 2]])), lamp((12, 11, 9)))


@scene("sphere")
def _(s: Judged) -> None:
    stage(s)
    s.option_light("sphere position=-0.3,1.9,-0.5 radius=0.35 radiance=12")


@scene("rectangle")
def _(s: Judged) -> None:
    stage(s)
    s.add(quad((0, 1.0, -0.3), (0.7, 0, 0), (0, 0, -0.5)), matte((0.5, 0.5, 0.5), doubleSided=True))
    s.option_light("rectangle position=-0.2,1.9,-0.6 direction=0.1,-1,0.2 size=1.4,0.6 radiance=12")


@scene("disk")
def _(s: Judged) -> None:
    stage(s)
    s.add(quad((0, 1.0, -0.3), (0.7, 0, 0), (0, 0, -0.5)), matte((0.5, 0.5, 0.5), doubleSided=True))
    s.option_light("disk position=-0.2,1.9,-0.6 direction=0.1,-1,0.2 radius=0.5 radiance=12")


@scene("mesh")
def _(s: Judged) -> None:
    stage(s)
    body = icosphere((0, 0, 0), 1.0, 2, smooth=True)
    bumps = np.random.default_rng(1).uniform(0.25, 0.5, (len(body.positions), 1))
    body.positions = np.array([-0.2, 1.9, -0.6]) + bumps * body.positions
    s.add(flat(body), lamp((10, 9, 7)))


@scene("many")
def _(s: Judged) -> None:
    stage(s)
    random = np.random.default_rng(2)
    for k in range(18 * 18):
        x, z = -2.2 + 4.4 * (k % 18) / 17, -2.8 + 4.4 * (k // 18) / 17
        # above the view, which falls towards the camera
        y = 2.0 + 0.45 * max(z, 0) + 0.3 * random.random()
        s.add(quad((x, y, z), (0.1, 0, 0), (0, 0, 0.1)), lamp(30 * random.random(3) ** 3 + 0.5))


@scene("sky")
def _(s: Judged) -> None:
    stage(s)
    s.sky(0.7, 0.9, 1.2)


@scene("sky-sun")
def _(s: Judged) -> None:
    stage(s)
    s.more["environment"] = scenes.ENVIRONMENT


@scene("interior")
def _(s: Judged) -> None:
    s.add(box((-1.5, 0, -1.5), (1.5, 2, 1.5), inside=True), matte((0.8, 0.78, 0.7)))
    s.add(box((0.3, 0.02, -0.9), (0.9, 0.9, -0.3)), matte((0.3, 0.5, 0.8)))
    # a window in the wall behind the camera's left
    s.add(quad((-1.49, 1.2, 0.9), (0, 0, -0.8), (0, 0.8, 0)), lamp((12, 12, 13)))
    s.camera((0.9, 1.1, 1.3), (0.1, 0.7, -0.8), 1.0)


@scene("penumbra")
def _(s: Judged) -> None:
    """A panel with a picture, most of which is dark, above a sheet."""
    stage(s)
    s.add(quad((0, 1.0, -0.3), (0.7, 0, 0), (0, 0, -0.5)), matte((0.5, 0.5, 0.5), doubleSided=True))
    random = np.random.default_rng(4)
    picture = np.concatenate([255 * random.random((16, 16, 3)) ** 3, np.full((16, 16, 1), 255)], -1).astype(np.uint8)
    panel = lamp((60, 55, 50)) | {"emissiveTexture": {"index": s.writer.texture(picture, "clamp")}}
    s.add(quad((-0.2, 1.9, -0.6), (1.4, 0, 0), (0, 0, 0.8)), panel)


@scene("small-lamps")
def _(s: Judged) -> None:
    """150 small lamps of very different power that face all ways, near and far."""
    stage(s)
    random = np.random.default_rng(3)
    for _ in range(150):
        x, z = 4.4 * random.random(2) - (2.2, 2.8)
        y = 1.9 + 0.45 * max(z, 0) + 0.6 * random.random()
        u, v = np.cross(random.normal(size=(2, 3)), random.normal(size=3))
        u, v = unit(u), unit(np.cross(np.cross(u, v), u))
        if np.cross(u, v)[1] > 0:
            u, v = v, u
        s.add(quad((x, y, z), 0.06 * u, 0.06 * v), lamp(60 * random.lognormal(0, 1.5, 1) * (0.5 + random.random(3))))


@scene("glossy")
def _(s: Judged) -> None:
    """Rough metal that is lit by what rough metal reflects."""
    metal = surface((1, 1, 1), 1.0, 0.35)
    s.add(quad((0, 0, 0), (4, 0, 0), (0, 0, -4)), metal)
    s.add(quad((-0.2, 1, -1.2), (3, 0, 0), (0, 2, 0)), surface((1, 1, 1), 1.0, 0.25))
    s.add(box((-0.9, 0.02, -0.6), (-0.3, 0.6, 0.0)), matte((0.7, 0.4, 0.3)))
    s.add(icosphere((0.5, 0.45, -0.3), 0.4, 2), metal)
    s.option_light("rectangle position=0.3,2.8,0.4 direction=-0.1,-1,-0.4 size=0.8,0.8 radiance=12")
    s.camera((0.3, 1.5, 2.6), (0, 0.4, -0.2), 0.7)


@scene("sun-and-sky")
def _(s: Judged) -> None:
    """A room with a window that the sun shines through, and a sky."""
    for axis in range(3):
        for side in (-1, 1):
            if (axis, side) == (0, -1):
                continue
            middle, normal = np.array([0.0, 1.0, 0.0]), side * np.eye(3)[axis]
            u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
            size = np.array([3.0, 2.0, 3.0])
            middle = middle + 0.5 * normal * size
            u, v = u * size, v * size
            s.add(quad(middle, *((v, u) if side > 0 else (u, v))), matte((0.8, 0.78, 0.7), doubleSided=True))
    # the wall with the window, in four parts
    for middle, size in [((0.3, 0), (0.6, 3)), ((1.8, 0), (0.4, 3)), ((1.1, -1.0), (1.0, 1.0)), ((1.1, 1.0), (1.0, 1.0))]:
        s.add(quad((-1.5, *middle), (0, size[0], 0), (0, 0, size[1])), matte((0.8, 0.78, 0.7), doubleSided=True))
    s.add(box((0.3, 0.02, -0.9), (0.9, 0.9, -0.3)), matte((0.3, 0.5, 0.8)))
    s.sky(0.6, 0.8, 1.1)
    s.option_light("sun direction=0.8,-0.5,-0.2 irradiance=20 angle=0.53")
    s.camera((0.9, 1.1, 1.3), (-0.1, 0.6, -0.8), 1.0)


@scene("caustic")
def _(s: Judged) -> None:
    """A ball of glass, and a large lamp whose light it gathers on the floor. A mesh: `skylit render` knows nothing of the analytic spheres of tests/mitsuba."""
    s.floor(matte((0.6, 0.6, 0.6)))
    s.add(icosphere((0, 0.6, 0), 0.5, 4), glass())
    s.option_light("rectangle position=-1.2,2.6,-0.8 direction=0.4,-1,0.3 size=1.6,1.6 radiance=8")
    s.camera((0.4, 2.0, 2.6), (0.2, 0.2, 0.2), 0.6)


@scene("foliage")
def _(s: Judged) -> None:
    """Leaves cut by a mask, under a sky with a sun."""
    s.floor(matte((0.5, 0.45, 0.4)))
    leaf = s.writer.texture(patches(6, 8, lambda x, y: 255 if (x + y) % 3 else 60), nearest=True)
    material = matte((0.6, 1.0, 0.5), pbr={"baseColorTexture": {"index": leaf}}, alphaMode="MASK", alphaCutoff=0.4, doubleSided=True)
    random = np.random.default_rng(6)
    for _ in range(60):
        middle = random.uniform((-0.8, 0.3, -0.8), (0.8, 1.3, 0.8))
        u, v = random.normal(size=(2, 3))
        u = unit(u)
        s.add(quad(middle, 0.35 * u, 0.35 * unit(np.cross(u, v))), material)
    s.more["environment"] = scenes.ENVIRONMENT
    s.camera((0.4, 2.0, 3.2), (0, 0.6, 0), 0.6)


class Peer(render.Builder):
    """Mitsuba's own rough metal, too: of albedo 1 it is glTF's."""

    def stock(self, part: Any) -> dict[str, Any] | None:
        pbr = part.material["pbrMetallicRoughness"]
        if pbr.get("metallicFactor") == 1 and pbr["roughnessFactor"] > 0 and pbr["baseColorFactor"] == [1, 1, 1, 1]:
            metal = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": pbr["roughnessFactor"] ** 2}
            return {"type": "twosided", "bsdf": metal}
        return super().stock(part)


def skylit(binary: Path, gltf: Path, entry: dict[str, Any], size: int, spp: int, seed: int, out: Path) -> np.ndarray:
    """Radiance of one rendering, rows by columns by channels."""
    command = [str(binary), "render", str(gltf), "--integrator", "path", "--spp", str(spp), "--seed", str(seed)]
    command += ["--size", f"{size}x{size}", "-o", str(out)]
    for light in entry.get("lights", []):
        command += ["--light", light]
    environment = entry.get("environment")
    if environment is not None:
        file = isinstance(environment, str)
        command += ["--environment", str(scenes.TESTS / "scenes" / environment) if file else ",".join(map(str, environment))]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}\n{done.stderr}")
    bitmap = mi.Bitmap(str(out))
    names = [field.name for field in bitmap.struct_()]
    planes = np.array(bitmap, np.float64)
    return planes[..., [names.index(c) for c in "RGB"]]


class Mitsuba:
    """A scene with a sensor for each sampler."""

    def __init__(self, gltf: Path, entry: dict[str, Any], folder: Path) -> None:
        builder = Peer(read(gltf), entry, folder)
        self.world = builder.build()
        self.sensors = {k: mi.load_dict(builder.sensor() | {"sampler": {"type": k}}) for k in SAMPLERS}
        self.integrator = mi.load_dict({"type": "path", "max_depth": -1, "rr_depth": 5})

    def render(self, sampler: str, spp: int, seed: int) -> np.ndarray:
        image = mi.render(self.world, sensor=self.sensors[sampler], integrator=self.integrator, spp=spp, seed=seed)
        return np.array(image, np.float64)[..., :3]


class Reference:
    """The mean of several renderings, and the variance of that mean per pixel and channel."""

    def __init__(self, parts: np.ndarray) -> None:
        self.mean, self.variance = parts.mean(0), parts.var(0, ddof=1) / len(parts)
        # of the image's mean; pixels of one seed need not be independent of each other
        of_means = parts.mean((1, 2, 3)).std(ddof=1) / np.sqrt(len(parts))
        self.error = max(of_means, np.sqrt(self.variance.sum()) / self.mean.size)

    def mse(self, images: np.ndarray) -> np.ndarray:
        """Of each image, without what the reference's noise adds."""
        return np.mean(np.square(images - self.mean), (1, 2, 3)) - self.variance.mean()


def measure(name: str, args: argparse.Namespace, folder: Path) -> list[dict[str, Any]]:
    """A row of the table for each number of samples."""
    s = Judged(name, "", "stock", more={"size": [args.size, args.size]})
    SCENES[name](s)
    gltf, entry = folder / f"{name}.gltf", {"name": name, "judge": "stock"} | s.more
    s.writer.write(gltf)
    # as many seeds for 16 samples as for 64
    seeds = {spp: range(FIRST_SEED, FIRST_SEED + args.seeds * 128 // max(spp, 64)) for spp in SPP}
    reference_seeds = range(FIRST_REFERENCE_SEED, FIRST_REFERENCE_SEED + args.reference_parts)

    def all_of(draw: Callable[[int, int], np.ndarray]) -> dict[str, np.ndarray]:
        images = {str(spp): np.array([draw(spp, seed) for seed in seeds[spp]]) for spp in SPP}
        return images

    def ours(spp: int, seed: int) -> np.ndarray:
        return skylit(args.binary, gltf, entry, args.size, spp, seed, folder / "image.exr")

    begin = time.time()
    our_images = all_of(ours)
    our_reference = Reference(np.array([ours(args.reference_spp, seed) for seed in reference_seeds]))
    our_seconds = time.time() - begin

    begin = time.time()
    settings = [gltf.read_text(), entry, args.size, args.seeds, args.reference_parts, args.reference_spp]
    key = hashlib.sha256(json.dumps(settings).encode()).hexdigest()[:16]
    kept = args.mitsuba / f"{name}-{key}.npz" if args.mitsuba else None
    if kept and kept.exists():
        data = dict(np.load(kept))
    else:
        peer = Mitsuba(gltf, entry, folder)
        data = {f"{k} {spp}": images for k in SAMPLERS for spp, images in all_of(lambda n, seed: peer.render(k, n, seed)).items()}
        data["reference"] = np.array([peer.render("multijitter", args.reference_spp, seed) for seed in reference_seeds])
        if kept:
            kept.parent.mkdir(parents=True, exist_ok=True)
            np.savez_compressed(kept, **{k: v.astype(np.float32) for k, v in data.items()})
    reference = Reference(data["reference"].astype(np.float64))
    their_seconds = time.time() - begin

    difference = our_reference.mean.mean() - reference.mean.mean()
    error = np.hypot(our_reference.error, reference.error)
    rows = []
    for spp in SPP:
        mse = {"skylit": our_reference.mse(our_images[str(spp)])}
        mse |= {k: reference.mse(data[f"{k} {spp}"].astype(np.float64)) for k in SAMPLERS}
        rmse = {k: float(np.sqrt(max(v.mean(), 0))) for k, v in mse.items()}
        best = min(SAMPLERS, key=lambda k: rmse[k])

        def spread(k: str) -> float:
            """Standard error of the RMSE, of itself: seeds are independent."""
            return float(mse[k].std(ddof=1) / np.sqrt(len(mse[k])) / mse[k].mean() / 2)

        ratio = rmse["skylit"] / rmse[best]
        rows.append(
            {"scene": name, "spp": spp, "best": best, "ratio": ratio, "ratio_error": ratio * np.hypot(spread("skylit"), spread(best))}
            | {"mean": float(reference.mean.mean()), "difference": difference / reference.mean.mean(), "sigmas": difference / error}
            | {"seconds": [our_seconds, their_seconds], "rmse": rmse}
        )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary", type=Path, help="skylit, built for release")
    parser.add_argument("names", nargs="*", help=f"scenes of {', '.join(SCENES)}; all without")
    parser.add_argument("--size", type=int, default=48, help="side of the images, pixels (48)")
    parser.add_argument("--seeds", type=int, default=8, help="half of them for 256 samples, twice as many for 16 and 64 (8)")
    parser.add_argument("--reference-spp", type=int, default=2048, help="samples of each part of a reference (2048)")
    parser.add_argument("--reference-parts", type=int, default=4, help="parts of a reference, with seeds of their own (4)")
    parser.add_argument("--mitsuba", type=Path, help="folder that keeps Mitsuba's images for the next run")
    parser.add_argument("--json", type=Path, help="the rows, for other programs")
    args = parser.parse_args()
    unknown = [n for n in args.names if n not in SCENES]
    if unknown:
        sys.exit(f"no such scene: {', '.join(unknown)}; there are {', '.join(SCENES)}")
    print(f"RMSE of {args.size}x{args.size} images against references of {args.reference_parts} x {args.reference_spp} samples; Mitsuba {mi.__version__}\n")
    print("| scene | mean | samples | skylit | " + " | ".join(SAMPLERS) + " | skylit / best | references differ by (sigmas) |")
    print("|" + "---|" * (6 + len(SAMPLERS)), flush=True)
    rows = []
    for name in args.names or SCENES:
        with tempfile.TemporaryDirectory() as folder:
            rows += measure(name, args, Path(folder))
        for row in rows[-len(SPP) :]:
            numbers = " | ".join(f"{row['rmse'][k]:.5f}" for k in ["skylit", *SAMPLERS])
            means = f"{100 * row['difference']:+.3f} % ({row['sigmas']:+.1f})" if row["spp"] == SPP[0] else ""
            print(
                f"| {name if means else ''} | {row['mean']:.3f} | {row['spp']} | {numbers} "
                f"| {row['ratio']:.3f} +- {row['ratio_error']:.3f} | {means} |",
                flush=True,
            )
    if args.json:
        args.json.write_text(json.dumps(rows, indent=1) + "\n")
    worst = max(rows, key=lambda r: r["ratio"])
    print(f"\nworst: {worst['scene']} at {worst['spp']} samples, {worst['ratio']:.3f} of {worst['best']}")


if __name__ == "__main__":
    main()
