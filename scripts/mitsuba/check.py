#!/usr/bin/env python3
"""Holds the BSDFs of bsdf.py to themselves: what `sample` gives against integrals of `eval` and `pdf` over the sphere, and reciprocity.

    venv/bin/python scripts/mitsuba/check.py [SCENE ...]"""

from __future__ import annotations

import sys
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")

import bsdf  # noqa: E402
import gltf  # noqa: E402
from scenes import SCENES, TESTS  # noqa: E402

N = 1 << 21


def at(cosine: float, phi: float = 0.4, tilt: float = 0.0) -> Any:
    """A point of a plane seen under this cosine (negative: from behind), whose shading normal has this angle to the plane's."""
    si = dr.zeros(mi.SurfaceInteraction3f, N)
    si.n = mi.Normal3f(0, 0, 1)
    si.sh_frame = mi.Frame3f(mi.Normal3f(float(np.sin(tilt)), 0, float(np.cos(tilt))))
    si.t = dr.full(mi.Float, 0.3, N)
    sine = np.sqrt(1 - cosine * cosine)
    o = mi.Vector3f(*(dr.full(mi.Float, float(x), N) for x in (sine * np.cos(phi), sine * np.sin(phi), cosine)))
    si.wi = si.to_local(o)
    return si


def summed(value: Any) -> tuple[np.ndarray, np.ndarray]:
    """Mean and its standard error."""
    v = np.atleast_2d(np.array(value, np.float64))
    v = v if v.shape[-1] == N else v.T
    return v.mean(-1), v.std(-1) / np.sqrt(v.shape[-1])


def check(name: str, model: Any) -> bool:
    """Prints what is wrong with a model, and says whether nothing is."""
    rng, ctx, fine = mi.PCG32(size=N), mi.BSDFContext(), True

    def uniform() -> Any:
        return mi.Point2f(rng.next_float32(), rng.next_float32())

    for cosine, tilt in ((0.9, 0.0), (0.4, 0.0), (-0.7, 0.0), (0.5, 0.6), (-0.3, 1.0)):
        si = at(cosine, tilt=tilt)
        bs, weight = model.sample(ctx, si, rng.next_float32(), uniform())
        delta = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
        sampled, sampled_error = summed(dr.select(delta, 0, weight))
        rough, _ = summed(dr.select(~delta & (bs.pdf > 0), mi.Float(1), 0))
        # uniform over the sphere
        wo = mi.warp.square_to_uniform_sphere(uniform())
        value, pdf = model.eval_pdf(ctx, si, wo)
        # directions that are lost have a density of their own: it is of what is sampled in vain
        whole, whole_error = summed(value * (4 * dr.pi))
        density, density_error = summed(dr.select(dr.max(value) > 0, pdf, 0) * (4 * dr.pi))
        quantities = [("value", sampled, whole, np.hypot(sampled_error, whole_error)), ("density", rough, density, density_error)]
        if model.null:
            null = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Null)
            passed, passed_error = summed(dr.select(null, weight, 0))
            quantities.append(("transmittance", passed, summed(model.eval_null_transmission(si))[0], passed_error))
        for what, a, b, error in quantities:
            off = np.abs(a - b) / np.maximum(error, 1e-5)
            if (off > 5).any():
                fine = False
                print(f"{name}, cosine {cosine}, tilt {tilt}: {what} sampled {a}, integrated {b}, {off.max():.1f} sigmas")
        if tilt != 0 or model.compensation:
            continue
        # f(o, i) = f(i, o), but that refraction scales radiance by the square of the index
        wo = mi.warp.square_to_uniform_sphere(uniform())
        there = model.eval(ctx, si, wo) / dr.abs(mi.Frame3f.cos_theta(wo))
        back = at(cosine)
        back.wi, wi = wo, mi.Vector3f(si.wi)
        # nothing is absorbed on the way to a point
        si.t, back.t = mi.Float(0), mi.Float(0)
        there = model.eval(ctx, si, wo) / dr.abs(mi.Frame3f.cos_theta(wo))
        here = model.eval(ctx, back, wi) / dr.abs(mi.Frame3f.cos_theta(wi))
        across = mi.Frame3f.cos_theta(wo) * cosine < 0
        if model.volume:
            here *= dr.select(across, model.ior**2 if cosine < 0 else model.ior**-2, 1)
        usual = (dr.abs(mi.Frame3f.cos_theta(wo)) > 1e-2) & dr.isfinite(dr.max(there))
        unlike = np.array(dr.select(usual, dr.max(dr.abs(there - here) / (dr.abs(there) + dr.abs(here) + 1e-3)), 0))
        if np.mean(unlike > 2e-3) > 1e-3:
            fine = False
            print(f"{name}, cosine {cosine}: not reciprocal, {100 * np.mean(unlike > 2e-3):.1f} % of directions, by up to {unlike.max():.2g}")
    return fine


def without_textures(value: Any) -> Any:
    if not isinstance(value, dict):
        return value
    return {key: without_textures(v) for key, v in value.items() if not key.endswith("Texture")}


def main() -> None:
    bsdf.register()
    fine = True
    for name in sys.argv[1:] or SCENES:
        scene = gltf.read(TESTS / "scenes" / f"{name}.gltf")
        compensation = SCENES[name]().more.get("compensation", False)
        for k, material in enumerate(scene.document["materials"]):
            # tangents and textures are of meshes
            if "extensions" in material and "KHR_materials_unlit" in material["extensions"] or "emissiveFactor" in material:
                continue
            bsdf.DESCRIPTIONS.append(bsdf.Description(without_textures(material), scene, False, False, compensation))
            model = mi.load_dict({"type": "gltf", "description": len(bsdf.DESCRIPTIONS) - 1})
            fine &= check(f"{name}, material {k}", model)
    print("fine" if fine else "not fine")
    sys.exit(not fine)


if __name__ == "__main__":
    main()
