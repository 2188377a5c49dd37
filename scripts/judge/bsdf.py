"""glTF's materials as Mitsuba BSDFs, written from docs/materials.md: not from the shaders that they judge.

Directions are in world space up to `Local`, which has the surface's frame: z is the shading normal on the side from which it is seen. `o` points
to the viewer, `i` to the light. Values hold the cosine, as Mitsuba wants them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from gltf import Scene, Texture

# below this alpha a lobe is a perfect mirror
SMOOTH = 1e-3
LEAST_COSINE = 1e-4

# what plugins are made of: properties hold no Python objects
DESCRIPTIONS: list["Description"] = []


def bitmap(texture: Texture, values: np.ndarray) -> dict[str, Any]:
    """Mitsuba's own texture with these values per texel."""
    to_uv = np.eye(4)
    to_uv[:2, :2], to_uv[:2, 3] = texture.transform[:2, :2], texture.transform[:2, 2]
    return {
        "type": "bitmap",
        "data": mi.TensorXf(np.ascontiguousarray(values.astype(np.float32))),
        "raw": True,
        "format": "variant",
        "filter_type": "nearest" if texture.nearest else "bilinear",
        "wrap_mode": texture.wrap,
        "to_uv": mi.ScalarTransform4f(to_uv),
    }


@dataclass
class Description:
    """A glTF material, and which attributes its mesh has."""

    material: dict[str, Any]
    scene: Scene
    colors: bool
    tangents: bool

    @property
    def pbr(self) -> dict[str, Any]:
        return self.material.get("pbrMetallicRoughness", {})

    def extension(self, name: str) -> dict[str, Any] | None:
        return self.material.get("extensions", {}).get(f"KHR_materials_{name}")

    def texture(self, info: dict[str, Any] | None, linear: bool) -> dict[str, Any] | None:
        texture = self.scene.texture(info)
        return None if texture is None else bitmap(texture, (texture.linear() if linear else texture.raw())[..., :3])


def mix(a: Any, b: Any, t: Any) -> Any:
    return a + (b - a) * t


def mirrored(w: Any, n: Any) -> Any:
    return w - 2 * dr.dot(w, n) * n


# microfacets


def ggx_d(h: Any, ax: Any, ay: Any) -> Any:
    """Trowbridge and Reitz' distribution."""
    k = dr.square(h.x / ax) + dr.square(h.y / ay) + dr.square(h.z)
    return 1 / (dr.pi * ax * ay * dr.square(k))


def ggx_lambda(w: Any, ax: Any, ay: Any) -> Any:
    return 0.5 * (dr.sqrt(1 + (dr.square(ax * w.x) + dr.square(ay * w.y)) / dr.square(w.z)) - 1)


def ggx_g2(o: Any, i: Any, ax: Any, ay: Any) -> Any:
    """Smith's term, heights correlated."""
    return 1 / (1 + ggx_lambda(o, ax, ay) + ggx_lambda(i, ax, ay))


def ggx_visible_pdf(o: Any, h: Any, ax: Any, ay: Any) -> Any:
    """Density of `ggx_visible`."""
    return ggx_d(h, ax, ay) * dr.maximum(dr.dot(o, h), 0) / ((1 + ggx_lambda(o, ax, ay)) * o.z)


def ggx_visible(o: Any, u: Any, ax: Any, ay: Any) -> Any:
    """A normal as often as it is seen from o (Heitz 2018)."""
    v = dr.normalize(mi.Vector3f(ax * o.x, ay * o.y, o.z))
    length = dr.square(v.x) + dr.square(v.y)
    t1 = dr.select(length > 0, mi.Vector3f(-v.y, v.x, 0) * dr.rsqrt(dr.maximum(length, 1e-30)), mi.Vector3f(1, 0, 0))
    t2 = dr.cross(v, t1)
    r, phi = dr.sqrt(u.x), 2 * dr.pi * u.y
    x, y = r * dr.cos(phi), r * dr.sin(phi)
    s = 0.5 * (1 + v.z)
    y = mix(dr.safe_sqrt(1 - dr.square(x)), y, s)
    n = x * t1 + y * t2 + dr.safe_sqrt(1 - dr.square(x) - dr.square(y)) * v
    return dr.normalize(mi.Vector3f(ax * n.x, ay * n.y, dr.maximum(n.z, 1e-6)))


def schlick(f0: Any, f90: Any, c: Any) -> Any:
    return f0 + (f90 - f0) * dr.power(dr.maximum(1 - c, 0), 5)


def dielectric(c: Any, eta: Any) -> Any:
    """Fresnel's term for unpolarised light; eta: index beyond the surface over that on the viewer's side."""
    sin2 = (1 - c * c) / (eta * eta)
    t = dr.safe_sqrt(1 - sin2)
    s, p = (c - eta * t) / (c + eta * t), (eta * c - t) / (eta * c + t)
    return dr.select(sin2 >= 1, 1, 0.5 * (s * s + p * p))


# sheen


def charlie_lambda(c: Any, a: float) -> Any:
    """Estevez and Kulla (2017), their fit."""
    t = (1 - a) ** 2
    fit = [(21.5473, 25.3245), (3.82987, 3.32435), (0.19823, 0.16801), (-1.97760, -1.27393), (-4.32054, -4.85967)]
    p, q, r, s, z = (mix(rough, smooth, t) for rough, smooth in fit)

    def curve(x: Any) -> Any:
        return p / (1 + q * x**r) + s * x + z

    exp, where, most = (np.exp, np.where, np.maximum) if isinstance(c, np.ndarray) else (dr.exp, dr.select, dr.maximum)
    c = most(c, 1e-6)
    return where(c < 0.5, exp(curve(c)), exp(2 * curve(0.5) - curve(most(1 - c, 1e-6))))


def charlie(o: Any, i: Any, a: float) -> Any:
    """Charlie's lobe without its colour, with the cosine of i."""
    h = dr.normalize(o + i)
    sine = dr.safe_sqrt(1 - h.z * h.z)
    d = (2 + 1 / a) * sine ** (1 / a) / (2 * dr.pi)
    return d / (4 * o.z) / (1 + charlie_lambda(o.z, a) + charlie_lambda(i.z, a))


def charlie_albedo(a: float, n: int = 64) -> np.ndarray:
    """What Charlie's lobe reflects in all, for cosines k / (n - 1), by the midpoint rule; at most 1."""
    m = 512
    z = (np.arange(m) + 0.5) / m
    phi = (np.arange(m) + 0.5) / m * np.pi
    z, phi = np.meshgrid(z, phi)
    i = np.stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z], -1)
    albedo = []
    for c in np.maximum(np.arange(n) / (n - 1), 1e-3):
        h = i + np.array([np.sqrt(1 - c * c), 0, c])
        h /= np.linalg.norm(h, axis=-1, keepdims=True)
        d = (2 + 1 / a) * np.sqrt(np.maximum(1 - h[..., 2] ** 2, 0)) ** (1 / a) / (2 * np.pi)
        value = d / (4 * c) / (1 + charlie_lambda(np.array(c), a) + charlie_lambda(z, a))
        # the hemisphere has a solid angle of 2 pi
        albedo.append(min(value.mean() * 2 * np.pi, 1.0))
    return np.array(albedo, np.float32)


@dataclass
class Point:
    """What a material is at a point, seen from o. Frames: about the base's normal, and about the coat's."""

    frame: Any
    coat_frame: Any
    ng: Any
    o: Any
    front: Any
    base: Any
    metallic: Any
    ax: Any
    ay: Any


class Gltf(mi.BSDF):
    """Metallic-roughness with the KHR_materials extensions."""

    def __init__(self, props: mi.Properties) -> None:
        mi.BSDF.__init__(self, props)
        d = DESCRIPTIONS[int(props["description"])]
        pbr = d.pbr

        def loaded(t: dict[str, Any] | None) -> Any:
            return None if t is None else mi.load_dict(t)

        self.base_factor = mi.ScalarColor3f(pbr.get("baseColorFactor", [1, 1, 1])[:3])
        self.metallic, self.roughness = pbr.get("metallicFactor", 1.0), pbr.get("roughnessFactor", 1.0)
        self.base_texture = loaded(d.texture(pbr.get("baseColorTexture"), True))
        self.rough_texture = loaded(d.texture(pbr.get("metallicRoughnessTexture"), False))
        self.normal_texture = loaded(d.texture(d.material.get("normalTexture"), False))
        self.normal_scale = d.material.get("normalTexture", {}).get("scale", 1.0)
        self.colors = mi.load_dict({"type": "mesh_attribute", "name": "vertex_color"}) if d.colors else None
        self.tangents = mi.load_dict({"type": "mesh_attribute", "name": "vertex_tangent"}) if d.tangents else None

        specular = d.extension("specular") or {}
        self.ior = (d.extension("ior") or {}).get("ior", 1.5)
        self.specular = specular.get("specularFactor", 1.0)
        self.specular_color = mi.ScalarColor3f(specular.get("specularColorFactor", [1, 1, 1]))
        anisotropy = d.extension("anisotropy") or {}
        self.strength, self.turn = anisotropy.get("anisotropyStrength", 0.0), anisotropy.get("anisotropyRotation", 0.0)
        self.transmission = (d.extension("transmission") or {}).get("transmissionFactor", 0.0)
        volume = d.extension("volume") or {}
        self.volume = self.transmission > 0 and volume.get("thicknessFactor", 0.0) > 0
        distance = volume.get("attenuationDistance", float("inf"))
        self.sigma = mi.ScalarColor3f([-np.log(max(c, 1e-30)) / distance for c in volume.get("attenuationColor", [1, 1, 1])])
        coat = d.extension("clearcoat") or {}
        self.coat, self.coat_alpha = coat.get("clearcoatFactor", 0.0), coat.get("clearcoatRoughnessFactor", 0.0) ** 2
        sheen = d.extension("sheen") or {}
        self.sheen = mi.ScalarColor3f(sheen.get("sheenColorFactor", [0, 0, 0]))
        self.sheen_most = max(sheen.get("sheenColorFactor", [0]))
        self.sheen_alpha = max(sheen.get("sheenRoughnessFactor", 0.0) ** 2, 1e-3)
        if self.sheen_most > 0:
            table = charlie_albedo(self.sheen_alpha)
            self.sheen_table, self.sheen_size = mi.Float(table), len(table)

        # a lobe is rough or smooth as a whole
        self.smooth = self.roughness**2 < SMOOTH and self.rough_texture is None
        self.coat_smooth = self.coat_alpha < SMOOTH
        delta = mi.BSDFFlags.DeltaReflection | mi.BSDFFlags.DeltaTransmission
        rough = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.GlossyTransmission | mi.BSDFFlags.DiffuseReflection
        sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        self.m_components = [rough | sides] + ([delta | sides] if self.smooth or (self.coat > 0 and self.coat_smooth) else [])
        self.m_flags = self.m_components[0] | self.m_components[-1]

    # what is there

    def point(self, si: Any, active: Any) -> Point:
        o = si.to_world(si.wi)
        ng, ns = mi.Vector3f(si.n), mi.Vector3f(si.sh_frame.n)
        tangent = mi.Vector3f(si.sh_frame.s)
        if self.tangents is not None:
            tangent = mi.Vector3f(self.tangents.eval(si, active))
        front = dr.dot(ng, o) > 0

        def about(n: Any) -> Any:
            n = dr.select(front, n, -n)
            c = dr.dot(n, o)
            n = dr.select(c < LEAST_COSINE, dr.normalize(n + (LEAST_COSINE - c) * o), n)
            s = dr.normalize(tangent - n * dr.dot(n, tangent))
            t = dr.cross(n, s)
            # counter-clockwise as seen from the front
            turn = dr.select(front, self.turn, -self.turn)
            cos, sin = dr.cos(turn), dr.sin(turn)
            return mi.Frame3f(cos * s + sin * t, cos * t - sin * s, n)

        mapped = ns
        if self.normal_texture is not None:
            m = mi.Vector3f(self.normal_texture.eval(si, active)) * 2 - 1
            s = dr.normalize(tangent - ns * dr.dot(ns, tangent))
            mapped = dr.normalize(self.normal_scale * (m.x * s + m.y * dr.cross(ns, s)) + m.z * ns)
        base = mi.Color3f(self.base_factor)
        if self.base_texture is not None:
            base *= self.base_texture.eval(si, active)
        if self.colors is not None:
            base *= self.colors.eval(si, active)
        metallic, roughness = mi.Float(self.metallic), mi.Float(self.roughness)
        if self.rough_texture is not None:
            mr = mi.Color3f(self.rough_texture.eval(si, active))
            metallic, roughness = metallic * mr.z, roughness * mr.y
        alpha = dr.maximum(roughness * roughness, 1e-4)
        along = mix(alpha, 1, self.strength**2)
        return Point(about(mapped), about(ns), dr.select(front, ng, -ng), o, front, base, metallic, along, alpha)

    def eta(self, p: Point) -> Any:
        """Index beyond the surface over that on the viewer's side."""
        return dr.select(p.front, self.ior, 1 / self.ior) if self.volume else mi.Float(1)

    def fresnel(self, p: Point, c: Any) -> Any:
        c = dr.maximum(c, 1e-6)
        if not self.volume:
            f0 = dr.minimum(((self.ior - 1) / (self.ior + 1)) ** 2 * mi.Color3f(self.specular_color), 1) * self.specular
            return schlick(mix(f0, p.base, p.metallic), mix(mi.Float(self.specular), 1, p.metallic), c)
        f = dielectric(c, self.eta(p))
        tint = mi.Color3f(f) * dr.minimum(mi.Color3f(self.specular_color), 1) * self.specular
        # beyond the critical angle there is nothing else
        tint = dr.select(f >= 1, mi.Color3f(1), tint)
        return mix(tint, schlick(p.base, 1, c), p.metallic)

    def coat_fresnel(self, c: Any) -> Any:
        return self.coat * schlick(0.04, 1.0, dr.abs(c))

    def through_coat(self, p: Point, i: Any) -> Any:
        """What crosses the coat on the way in and out; i in world space."""
        if self.coat == 0:
            return mi.Float(1)
        n = p.coat_frame.n
        return (1 - self.coat_fresnel(dr.dot(n, p.o))) * (1 - self.coat_fresnel(dr.dot(n, i)))

    def under_sheen(self, p: Point, i: Any) -> Any:
        if self.sheen_most == 0:
            return mi.Float(1)

        def albedo(c: Any) -> Any:
            x = dr.clip(dr.abs(c), 0, 1) * (self.sheen_size - 1)
            k = dr.minimum(mi.UInt32(x), self.sheen_size - 2)
            a, b = (dr.gather(mi.Float, self.sheen_table, k + j) for j in (0, 1))
            return mix(a, b, x - k)

        n = p.frame.n
        return 1 - self.sheen_most * dr.maximum(albedo(dr.dot(n, p.o)), albedo(dr.dot(n, i)))

    # rough lobes, before what a shading normal sends to the wrong side is put right: values with cosine, and densities

    def reflected(self, p: Point, i_world: Any) -> tuple[Any, Any]:
        o, i = p.frame.to_local(p.o), p.frame.to_local(i_world)
        up = i.z > 0
        h = dr.normalize(o + i)
        f = self.fresnel(p, dr.dot(o, h))
        chance = self.chances(p)
        share = (1 - p.metallic) * (1 - self.transmission)
        value = p.base * (share * (1 - dr.max(f)) * i.z / dr.pi)
        pdf = chance.diffuse * i.z / dr.pi
        if not self.smooth:
            d, g = ggx_d(h, p.ax, p.ay), ggx_g2(o, i, p.ax, p.ay)
            value += f * (d * g / (4 * o.z))
            pdf += chance.specular * ggx_visible_pdf(o, h, p.ax, p.ay) / (4 * dr.maximum(dr.dot(o, h), 1e-9))
        value *= self.through_coat(p, i_world)
        value, pdf = dr.select(up, value, 0), dr.select(up, pdf, 0)
        if self.coat > 0 and not self.coat_smooth:
            co, ci = p.coat_frame.to_local(p.o), p.coat_frame.to_local(i_world)
            a = self.coat_alpha
            h = dr.normalize(co + ci)
            c = dr.dot(co, h)
            coat = self.coat_fresnel(c) * ggx_d(h, a, a) * ggx_g2(co, ci, a, a) / (4 * co.z)
            value += dr.select(ci.z > 0, mi.Color3f(coat), 0)
            pdf += dr.select(ci.z > 0, chance.coat * ggx_visible_pdf(co, h, a, a) / (4 * dr.maximum(c, 1e-9)), 0)
        value *= self.under_sheen(p, i_world)
        if self.sheen_most > 0:
            value += dr.select(up, mi.Color3f(self.sheen) * charlie(o, i, self.sheen_alpha), 0)
        return value, pdf

    def transmitted(self, p: Point, i_world: Any) -> tuple[Any, Any]:
        if self.transmission == 0 or self.smooth:
            return mi.Color3f(0), mi.Float(0)
        o, i = p.frame.to_local(p.o), p.frame.to_local(i_world)
        chance = self.chances(p)
        factor = p.base * ((1 - p.metallic) * self.transmission)
        if self.volume:
            eta = self.eta(p)
            h = dr.normalize(o + eta * i)
            h = dr.select(h.z < 0, -h, h)
            oh, ih = dr.dot(o, h), dr.dot(i, h)
            # Walter et al. (2007), equation 21; radiance by the square of the index, since rays come from the viewer
            bend = dr.abs(oh * ih) / dr.square(oh + eta * ih)
            value = factor * (1 - dr.max(self.fresnel(p, oh))) * (ggx_d(h, p.ax, p.ay) * ggx_g2(o, -i, p.ax, p.ay) * bend / o.z)
            density = ggx_visible_pdf(o, h, p.ax, p.ay) * eta * eta * dr.abs(ih) / dr.square(oh + eta * ih)
            possible = (i.z < 0) & (oh > 0) & (ih < 0)
        else:
            i = mi.Vector3f(i.x, i.y, -i.z)
            h = dr.normalize(o + i)
            oh = dr.dot(o, h)
            value = factor * (1 - dr.max(self.fresnel(p, oh))) * (ggx_d(h, p.ax, p.ay) * ggx_g2(o, i, p.ax, p.ay) / (4 * o.z))
            density = ggx_visible_pdf(o, h, p.ax, p.ay) / (4 * dr.maximum(oh, 1e-9))
            possible = i.z > 0
        value *= self.through_coat(p, i_world) * self.under_sheen(p, i_world)
        return dr.select(possible, value, 0), dr.select(possible, chance.transmission * density, 0)

    # Mitsuba's interface

    def chances(self, p: Point) -> "Chances":
        """How often each lobe is drawn."""
        c = dr.maximum(dr.dot(p.frame.n, p.o), LEAST_COSINE)
        # facets refract and reflect where the whole would not
        f = dr.clip(dr.max(self.fresnel(p, c)), 0.1, 0.9)
        inner = (1 - p.metallic) * dr.max(p.base)
        diffuse = inner * (1 - self.transmission) * (1 - 0.9 * f) + self.sheen_most
        transmission = inner * self.transmission * (1 - f)
        coat = dr.maximum(self.coat_fresnel(dr.dot(p.coat_frame.n, p.o)), 0.1 * self.coat)
        total = diffuse + transmission + f + coat
        return Chances(diffuse / total, f / total, transmission / total, coat / total)

    def absorbed(self, si: Any, p: Point) -> Any:
        """What is left of the light after its way through the body, which ends here."""
        if not self.volume:
            return mi.Color3f(1)
        return dr.select(p.front, mi.Color3f(1), dr.exp(-mi.Color3f(self.sigma) * si.t))

    def all_of(self, si: Any, p: Point, i: Any) -> tuple[Any, Any]:
        """All rough lobes, with what was mirrored at the true surface."""
        m = mirrored(i, p.ng)
        above = dr.dot(i, p.ng) > 0
        r, t = [self.reflected(p, w) for w in (i, m)], [self.transmitted(p, w) for w in (i, m)]
        value = dr.select(above, r[0][0] + r[1][0], t[0][0] + t[1][0])
        pdf = dr.select(above, r[0][1] + r[1][1], t[0][1] + t[1][1])
        return value * self.absorbed(si, p), pdf

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> tuple[Any, Any]:
        p = self.point(si, active)
        chance = self.chances(p)
        o, co = p.frame.to_local(p.o), p.coat_frame.to_local(p.o)
        eta = self.eta(p)
        up = mi.Vector3f(0, 0, 1)

        # which lobe
        bounds = [chance.diffuse, chance.diffuse + chance.specular, chance.diffuse + chance.specular + chance.transmission]
        diffuse = sample1 < bounds[0]
        specular = (sample1 >= bounds[0]) & (sample1 < bounds[1])
        through = (sample1 >= bounds[1]) & (sample1 < bounds[2])
        coat = sample1 >= bounds[2]

        h = up if self.smooth else ggx_visible(o, sample2, p.ax, p.ay)
        reflection = 2 * dr.dot(o, h) * h - o
        if self.volume:
            c = dr.dot(o, h)
            inner = 1 - (1 - c * c) / (eta * eta)
            passage, possible = (c / eta - dr.safe_sqrt(inner)) * h - o / eta, inner > 0
        else:
            passage, possible = mi.Vector3f(reflection.x, reflection.y, -reflection.z), reflection.z > 0
        a = self.coat_alpha
        ch = up if self.coat_smooth else ggx_visible(co, sample2, a, a)
        i = p.frame.to_world(mi.warp.square_to_cosine_hemisphere(sample2))
        i = dr.select(specular, p.frame.to_world(reflection), i)
        i = dr.select(through, p.frame.to_world(passage), i)
        i = dr.select(coat, p.coat_frame.to_world(2 * dr.dot(co, ch) * ch - co), i)

        # what fails: a lobe's own wrong side
        n = dr.dot(i, dr.select(coat, p.coat_frame.n, p.frame.n))
        valid = active & dr.select(through, (n < 0) & possible, n > 0)
        straight = i
        # the true surface has the last word
        wrong = (dr.dot(i, p.ng) > 0) == through
        i = dr.select(wrong, mirrored(i, p.ng), i)

        value, pdf = self.all_of(si, p, i)
        valid &= pdf > 0
        weight = dr.select(valid, value / dr.maximum(pdf, 1e-30), 0)
        delta = mi.Bool(False)
        if self.smooth:
            f = self.fresnel(p, o.z)
            layers = self.through_coat(p, straight) * self.under_sheen(p, straight) * self.absorbed(si, p)
            squared = 1 / (eta * eta)
            body = p.base * ((1 - p.metallic) * self.transmission * (1 - dr.max(f)) * squared)
            one = dr.select(through, body / dr.maximum(chance.transmission, 1e-9), f / dr.maximum(chance.specular, 1e-9))
            delta = specular | through
            sure = active & dr.select(through, possible, True)
            weight = dr.select(delta, dr.select(sure, one * layers, 0), weight)
            pdf = dr.select(delta, dr.select(sure, 1, 0), pdf)
            valid = dr.select(delta, sure, valid)
        if self.coat > 0 and self.coat_smooth:
            one = self.coat_fresnel(co.z) / chance.coat * self.under_sheen(p, straight) * self.absorbed(si, p)
            weight = dr.select(coat, one, weight)
            pdf, valid, delta = dr.select(coat, 1, pdf), dr.select(coat, active, valid), delta | coat

        bs = dr.zeros(mi.BSDFSample3f)
        bs.wo = si.to_local(i)
        bs.pdf = dr.select(valid, pdf, 0)
        bs.eta = dr.select(through, eta, 1)
        smooth_flag = dr.select(through, mi.UInt32(+mi.BSDFFlags.DeltaTransmission), mi.UInt32(+mi.BSDFFlags.DeltaReflection))
        bs.sampled_type = dr.select(delta, smooth_flag, mi.UInt32(+mi.BSDFFlags.GlossyReflection))
        bs.sampled_component = dr.select(delta, mi.UInt32(len(self.m_components) - 1), mi.UInt32(0))
        return bs, dr.select(valid, weight, 0)

    def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
        p = self.point(si, active)
        value, pdf = self.all_of(si, p, si.to_world(wo))
        return dr.select(active, value, 0), dr.select(active, pdf, 0)

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        return self.eval_pdf(ctx, si, wo, active)[1]

    def to_string(self) -> str:
        return "Gltf[]"


@dataclass
class Chances:
    diffuse: Any
    specular: Any
    transmission: Any
    coat: Any


def register() -> None:
    """Once a variant is set."""
    mi.register_bsdf("gltf", lambda props: Gltf(props))
