"""glTF's materials as Mitsuba BSDFs, written from docs/reference/materials.md: not from the shaders that they judge.

Directions are in world space up to `Local`, which has the surface's frame: z is the shading normal on the side from which it is seen. `o` points
to the viewer, `i` to the light. Values hold the cosine, as Mitsuba wants them."""

from __future__ import annotations

from collections.abc import Callable
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


# copies of a texture along each axis, on either side of the unit square, where its axes wrap differently
COPIES = 3


def unwrapped(values: np.ndarray, wrap: tuple[str, str]) -> np.ndarray:
    """The texels from -`COPIES` to 1 + `COPIES` along both axes, each wrapped in its own way."""

    def texels(n: int, mode: str) -> np.ndarray:
        k = np.arange(-COPIES * n, (COPIES + 1) * n)
        if mode == "repeat":
            return k % n
        if mode == "clamp":
            return np.clip(k, 0, n - 1)
        return np.minimum(k % (2 * n), 2 * n - 1 - k % (2 * n))

    h, w = values.shape[:2]
    return values[texels(h, wrap[1])][:, texels(w, wrap[0])]


def bitmap(texture: Texture, values: np.ndarray) -> dict[str, Any]:
    """Mitsuba's own texture with these values per texel. Its axes wrap alike: where glTF's do not, the texels are copied as often as needed."""
    transform, wrap = texture.transform, texture.wrap[0]
    if texture.wrap[0] != texture.wrap[1]:
        values, wrap = unwrapped(values, texture.wrap), "clamp"
        scale = 1 / (2 * COPIES + 1)
        transform = np.array([[scale, 0, COPIES * scale], [0, scale, COPIES * scale], [0, 0, 1]]) @ transform
    to_uv = np.eye(4)
    to_uv[:2, :2], to_uv[:2, 3] = transform[:2, :2], transform[:2, 2]
    return {
        "type": "bitmap",
        "data": mi.TensorXf(np.ascontiguousarray(values.astype(np.float32))),
        "raw": True,
        "format": "variant",
        "filter_type": "nearest" if texture.nearest else "bilinear",
        "wrap_mode": wrap,
        "to_uv": mi.ScalarTransform4f(to_uv),
    }


@dataclass
class Description:
    """A glTF material, which attributes its mesh has, and whether energy is compensated."""

    material: dict[str, Any]
    scene: Scene
    colors: bool
    tangents: bool
    compensation: bool = False

    @property
    def pbr(self) -> dict[str, Any]:
        return self.material.get("pbrMetallicRoughness", {})

    def extension(self, name: str) -> dict[str, Any] | None:
        return self.material.get("extensions", {}).get(f"KHR_materials_{name}")

    def texture(self, info: dict[str, Any] | None, kind: str = "raw") -> Lookup | None:
        """`kind`: `raw`, `linear` (sRGB decoded), or `alpha` (the fourth channel, as all three)."""
        texture = self.scene.texture(info)
        if texture is None:
            return None
        values = texture.linear() if kind == "linear" else texture.raw()
        values = np.repeat(values[..., 3:], 3, -1) if kind == "alpha" else values[..., :3]
        return Lookup(mi.load_dict(bitmap(texture, values)), texture.set)


class Lookup:
    """A texture with the set of coordinates that it is looked up with: Mitsuba's meshes have one, so the second is an attribute."""

    def __init__(self, texture: Any, number: int) -> None:
        self.texture = texture
        self.coordinates = mi.load_dict({"type": "mesh_attribute", "name": "vertex_uv1"}) if number == 1 else None

    def __call__(self, si: Any, active: Any) -> Any:
        if self.coordinates is not None:
            uv = self.coordinates.eval_3(si, active)
            si = mi.SurfaceInteraction3f(si)
            si.uv = mi.Point2f(uv.x, uv.y)
        return mi.Color3f(self.texture.eval(si, active))


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


# energy compensation (Turquin 2019)


def visible_normals(cosine: float, alpha: float, points: int) -> tuple[np.ndarray, np.ndarray]:
    """A direction, and normals of GGX that are visible from it (Heitz 2018), at the middles of points x points cells."""
    u = (np.arange(points) + 0.5) / points
    phi, z = np.meshgrid(2 * np.pi * u, u)
    o = np.array([np.sqrt(1 - cosine * cosine), 0, cosine])
    v = o * [alpha, alpha, 1]
    v /= np.linalg.norm(v)
    # Dupuy and Benyoub (2023): a cap of the sphere, and the vector in the middle between it and the view
    z = (1 - z) * (1 + v[2]) - v[2]
    s = np.sqrt(np.maximum(1 - z * z, 0))
    h = np.stack([s * np.cos(phi), s * np.sin(phi), z], -1) + v
    h[..., :2] *= alpha
    return o, h / np.linalg.norm(h, axis=-1, keepdims=True)


def masked(o: float, i: np.ndarray, alpha: float) -> np.ndarray:
    """Smith's height-correlated term for both directions over that of the view alone."""

    def lambda_(c: Any) -> Any:
        return 0.5 * (np.sqrt(1 + alpha * alpha * (1 - c * c) / (c * c)) - 1)

    return (1 + lambda_(o)) / (1 + lambda_(o) + lambda_(np.maximum(np.abs(i), 1e-6)))


def ggx_albedo(cosine: float, roughness: float, points: int = 64) -> tuple[float, float]:
    """Of microfacets with Schlick's term: the albedo is f0 times the first and f90 times the second."""
    alpha = max(roughness, 1e-2) ** 2
    o, h = visible_normals(max(cosine, 1e-3), alpha, points)
    oh = h @ o
    i = 2 * oh * h[..., 2] - o[2]
    share = np.where(i > 0, masked(o[2], i, alpha), 0)
    weight = np.maximum(1 - oh, 0) ** 5
    return float(np.mean(share * (1 - weight))), float(np.mean(share * weight))


def glass_albedo(cosine: float, roughness: float, eta: float, points: int = 64) -> float:
    """Of all that microfacets of glass reflect and refract."""
    alpha = max(roughness, 1e-2) ** 2
    o, h = visible_normals(max(cosine, 1e-3), alpha, points)
    oh = h @ o
    sin2 = (1 - oh * oh) / (eta * eta)
    t = np.sqrt(np.maximum(1 - sin2, 0))
    s, p = (oh - eta * t) / (oh + eta * t), (eta * oh - t) / (eta * oh + t)
    f = np.where(sin2 >= 1, 1, 0.5 * (s * s + p * p))
    up, down = 2 * oh * h[..., 2] - o[2], (oh / eta - t) * h[..., 2] - o[2] / eta
    up = np.where(up > 0, f * masked(o[2], up, alpha), 0)
    down = np.where((sin2 < 1) & (down < 0), (1 - f) * masked(o[2], down, alpha), 0)
    return float(np.mean(up + down))


class Table:
    """A function of cosine and roughness, bilinear between its values at k / (SIZE - 1)."""

    SIZE = 48

    def __init__(self, function: Callable[[float, float], float]) -> None:
        at = np.arange(self.SIZE) / (self.SIZE - 1)
        self.values = mi.Float(np.array([function(c, r) for r in at for c in at], np.float32))

    def __call__(self, cosine: Any, roughness: Any) -> Any:
        x, y = (dr.clip(v, 0, 1) * (self.SIZE - 1) for v in (cosine, roughness))
        i, j = (dr.minimum(mi.UInt32(v), self.SIZE - 2) for v in (x, y))

        def value(di: int, dj: int) -> Any:
            return dr.gather(mi.Float, self.values, (j + dj) * self.SIZE + i + di)

        return mix(mix(value(0, 0), value(1, 0), x - i), mix(value(0, 1), value(1, 1), x - i), y - j)


# sheen


def charlie_lambda(c: Any, a: Any) -> Any:
    """Estevez and Kulla (2017), their fit."""
    t = (1 - a) * (1 - a)
    fit = [(21.5473, 25.3245), (3.82987, 3.32435), (0.19823, 0.16801), (-1.97760, -1.27393), (-4.32054, -4.85967)]
    p, q, r, s, z = (mix(rough, smooth, t) for rough, smooth in fit)

    def curve(x: Any) -> Any:
        return p / (1 + q * (x**r if isinstance(x, np.ndarray | float) else dr.power(x, r))) + s * x + z

    exp, where, most = (np.exp, np.where, np.maximum) if isinstance(c, np.ndarray) else (dr.exp, dr.select, dr.maximum)
    c = most(c, 1e-6)
    return where(c < 0.5, exp(curve(c)), exp(2 * curve(0.5) - curve(most(1 - c, 1e-6))))


def charlie(o: Any, i: Any, a: Any) -> Any:
    """Charlie's lobe without its colour, with the cosine of i."""
    h = dr.normalize(o + i)
    sine = dr.safe_sqrt(1 - h.z * h.z)
    d = (2 + 1 / a) * dr.power(sine, 1 / a) / (2 * dr.pi)
    return d / (4 * o.z) / (1 + charlie_lambda(o.z, a) + charlie_lambda(i.z, a))


def charlie_albedo(a: float, n: int = 64, m: int = 512) -> np.ndarray:
    """What Charlie's lobe reflects in all, for cosines k / (n - 1), by the midpoint rule; at most 1."""
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


def shadowing(n: Any, ng: Any, i: Any) -> Any:
    """What a shading normal n leaves of the light from i, or of the light that goes there, of a surface whose true normal is ng (Chiang, Li and
    Burley 2019). Both normals are on the viewer's side, i on the same side of both."""
    g = dr.abs(dr.dot(ng, i)) / dr.maximum(dr.abs(dr.dot(n, i)) * dr.dot(ng, n), 1e-12)
    return dr.select(dr.dot(ng, n) <= 0, 0, dr.select(g >= 1, 1, g * (1 + g * (1 - g))))


@dataclass
class Point:
    """The material at a point, seen from o. Frames: about the base's normal, and about the clearcoat's."""

    frame: Any
    clearcoat_frame: Any
    ng: Any
    o: Any
    front: Any
    base: Any
    metallic: Any
    roughness: Any
    ax: Any
    ay: Any
    specular: Any
    specular_color: Any
    transmission: Any
    clearcoat: Any
    clearcoat_alpha: Any
    sheen: Any
    sheen_max: Any
    sheen_roughness: Any


@dataclass
class LobeProbabilities:
    diffuse: Any
    specular: Any
    transmission: Any
    clearcoat: Any


class Gltf(mi.BSDF):
    """Metallic-roughness with the KHR_materials extensions."""

    def __init__(self, props: mi.Properties) -> None:
        mi.BSDF.__init__(self, props)
        d = DESCRIPTIONS[int(props["description"])]
        pbr = d.pbr
        self.base_factor = mi.ScalarColor3f(pbr.get("baseColorFactor", [1, 1, 1])[:3])
        self.metallic, self.roughness = pbr.get("metallicFactor", 1.0), pbr.get("roughnessFactor", 1.0)
        self.base_texture = d.texture(pbr.get("baseColorTexture"), "linear")
        self.rough_texture = d.texture(pbr.get("metallicRoughnessTexture"))
        self.normal_texture = d.texture(d.material.get("normalTexture"))
        self.normal_scale = d.material.get("normalTexture", {}).get("scale", 1.0)
        self.colors = mi.load_dict({"type": "mesh_attribute", "name": "vertex_color"}) if d.colors else None
        self.tangents = mi.load_dict({"type": "mesh_attribute", "name": "vertex_tangent"}) if d.tangents else None

        specular = d.extension("specular") or {}
        self.ior = (d.extension("ior") or {}).get("ior", 1.5)
        self.specular, self.specular_texture = specular.get("specularFactor", 1.0), d.texture(specular.get("specularTexture"), "alpha")
        self.specular_color = mi.ScalarColor3f(specular.get("specularColorFactor", [1, 1, 1]))
        self.specular_color_texture = d.texture(specular.get("specularColorTexture"), "linear")
        anisotropy = d.extension("anisotropy") or {}
        self.strength, self.turn = anisotropy.get("anisotropyStrength", 0.0), anisotropy.get("anisotropyRotation", 0.0)
        self.anisotropy_texture = d.texture(anisotropy.get("anisotropyTexture"))
        transmission = d.extension("transmission") or {}
        self.transmission = transmission.get("transmissionFactor", 0.0)
        self.transmission_texture = d.texture(transmission.get("transmissionTexture"))
        volume = d.extension("volume") or {}
        self.volume = self.transmission > 0 and volume.get("thicknessFactor", 0.0) > 0
        distance = volume.get("attenuationDistance", float("inf"))
        self.sigma = mi.ScalarColor3f([-np.log(max(c, 1e-30)) / distance for c in volume.get("attenuationColor", [1, 1, 1])])
        clearcoat = d.extension("clearcoat") or {}
        self.clearcoat, self.clearcoat_texture = clearcoat.get("clearcoatFactor", 0.0), d.texture(clearcoat.get("clearcoatTexture"))
        self.clearcoat_roughness = clearcoat.get("clearcoatRoughnessFactor", 0.0)
        self.clearcoat_roughness_texture = d.texture(clearcoat.get("clearcoatRoughnessTexture"))
        self.clearcoat_normal_texture = d.texture(clearcoat.get("clearcoatNormalTexture"))
        self.clearcoat_normal_scale = clearcoat.get("clearcoatNormalTexture", {}).get("scale", 1.0)
        sheen = d.extension("sheen") or {}
        self.sheen, self.sheen_texture = sheen.get("sheenColorFactor", [0, 0, 0]), d.texture(sheen.get("sheenColorTexture"), "linear")
        self.sheen_roughness = sheen.get("sheenRoughnessFactor", 0.0)
        self.sheen_roughness_texture = d.texture(sheen.get("sheenRoughnessTexture"), "alpha")
        if max(self.sheen) > 0:
            # one row where the roughness is the same everywhere
            varies = self.sheen_roughness_texture is not None
            rows = np.linspace(0, self.sheen_roughness, 33) if varies else [self.sheen_roughness]
            table = np.array([charlie_albedo(max(r * r, 1e-3), m=128 if varies else 512) for r in rows])
            self.sheen_table, self.sheen_rows, self.sheen_columns = mi.Float(table.ravel()), *table.shape

        self.compensation = d.compensation
        if self.compensation and self.volume:
            self.outside, self.inside = (Table(lambda c, r, eta=eta: glass_albedo(c, r, eta)) for eta in (self.ior, 1 / self.ior))
        if self.compensation and (not self.volume or self.clearcoat > 0):
            self.albedo = [Table(lambda c, r, k=k: ggx_albedo(c, r)[k]) for k in (0, 1)]

        # a lobe is rough or smooth as a whole
        self.smooth = self.roughness**2 < SMOOTH and self.rough_texture is None
        self.clearcoat_smooth = self.clearcoat_roughness**2 < SMOOTH and self.clearcoat_roughness_texture is None
        # light shines through smooth thin walls in straight lines
        self.null = self.smooth and self.transmission > 0 and not self.volume
        delta = mi.BSDFFlags.DeltaReflection | mi.BSDFFlags.DeltaTransmission
        if self.null:
            delta = delta | mi.BSDFFlags.Null
        rough = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.GlossyTransmission | mi.BSDFFlags.DiffuseReflection
        sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        has_delta = self.smooth or (self.clearcoat > 0 and self.clearcoat_smooth)
        self.m_components = [rough | sides] + ([delta | sides] if has_delta else [])
        self.m_flags = self.m_components[0] | self.m_components[-1]

    # the material at a point

    def point(self, si: Any, active: Any) -> Point:
        o = si.to_world(si.wi)
        ng, ns = mi.Vector3f(si.n), mi.Vector3f(si.sh_frame.n)
        tangent = mi.Vector3f(si.sh_frame.s)
        if self.tangents is not None:
            tangent = mi.Vector3f(self.tangents.eval(si, active))
        front = dr.dot(ng, o) > 0
        strength, turn = mi.Float(self.strength), mi.Float(self.turn)
        if self.anisotropy_texture is not None:
            t = self.anisotropy_texture(si, active)
            strength, turn = strength * t.z, turn + dr.atan2(t.y * 2 - 1, t.x * 2 - 1)

        def about(n: Any) -> Any:
            n = dr.select(front, n, -n)
            c = dr.dot(n, o)
            n = dr.select(c < LEAST_COSINE, dr.normalize(n + (LEAST_COSINE - c) * o), n)
            s = dr.normalize(tangent - n * dr.dot(n, tangent))
            t = dr.cross(n, s)
            # counter-clockwise as seen from the front
            angle = dr.select(front, turn, -turn)
            cos, sin = dr.cos(angle), dr.sin(angle)
            return mi.Frame3f(cos * s + sin * t, cos * t - sin * s, n)

        def mapped(texture: Lookup | None, scale: float) -> Any:
            if texture is None:
                return ns
            m = texture(si, active) * 2 - 1
            s = dr.normalize(tangent - ns * dr.dot(ns, tangent))
            return dr.normalize(scale * (m.x * s + m.y * dr.cross(ns, s)) + m.z * ns)

        def value(factor: Any, texture: Lookup | None) -> Any:
            factor = mi.Color3f(factor)
            return factor if texture is None else factor * texture(si, active)

        base = value(self.base_factor, self.base_texture)
        if self.colors is not None:
            base *= self.colors.eval(si, active)
        metallic, roughness = mi.Float(self.metallic), mi.Float(self.roughness)
        if self.rough_texture is not None:
            mr = self.rough_texture(si, active)
            metallic, roughness = metallic * mr.z, roughness * mr.y
        alpha = dr.maximum(roughness * roughness, 1e-4)
        sheen = value(self.sheen, self.sheen_texture)
        return Point(
            frame=about(mapped(self.normal_texture, self.normal_scale)),
            clearcoat_frame=about(mapped(self.clearcoat_normal_texture, self.clearcoat_normal_scale)),
            ng=dr.select(front, ng, -ng),
            o=o,
            front=front,
            base=base,
            metallic=metallic,
            roughness=roughness,
            ax=mix(alpha, 1, strength * strength),
            ay=alpha,
            specular=value(self.specular, self.specular_texture).x,
            specular_color=value(self.specular_color, self.specular_color_texture),
            transmission=value(self.transmission, self.transmission_texture).x,
            clearcoat=value(self.clearcoat, self.clearcoat_texture).x,
            clearcoat_alpha=dr.maximum(dr.square(value(self.clearcoat_roughness, self.clearcoat_roughness_texture).y), 1e-4),
            sheen=sheen,
            sheen_max=dr.max(sheen),
            sheen_roughness=value(self.sheen_roughness, self.sheen_roughness_texture).x,
        )

    def eta(self, p: Point) -> Any:
        """Index beyond the surface over that on the viewer's side."""
        return dr.select(p.front, self.ior, 1 / self.ior) if self.volume else mi.Float(1)

    def dielectric_ends(self, p: Point) -> tuple[Any, Any]:
        """Schlick's f0 and f90 of the dielectric."""
        return dr.minimum(((self.ior - 1) / (self.ior + 1)) ** 2 * p.specular_color, 1) * p.specular, p.specular

    def dielectric_fresnel(self, p: Point, c: Any) -> Any:
        if not self.volume:
            return schlick(*self.dielectric_ends(p), c)
        f = dielectric(c, self.eta(p))
        # beyond the critical angle everything is reflected
        return dr.select(f >= 1, mi.Color3f(1), f * dr.minimum(p.specular_color, 1) * p.specular)

    def gains(self, p: Point) -> tuple[Any, Any, Any]:
        """What compensation multiplies the reflection of the dielectric and of the metal by, and the dielectric's albedo then."""
        c = dr.dot(p.frame.n, p.o)
        a0, a90 = (table(c, p.roughness) for table in self.albedo)
        f0, f90 = self.dielectric_ends(p)
        lost = (1 - a0 - a90) / (a0 + a90)
        gain = 1 + f0 * lost
        return gain, 1 + p.base * lost, gain * (f0 * a0 + f90 * a90)

    def glass_gain(self, p: Point) -> Any:
        if not (self.volume and self.compensation) or self.smooth:
            return mi.Float(1)
        c = dr.dot(p.frame.n, p.o)
        return 1 / dr.select(p.front, self.outside(c, p.roughness), self.inside(c, p.roughness))

    def specular_fresnel(self, p: Point, c: Any) -> Any:
        """Of the dielectric and the metal as metallic mixes them, with compensation."""
        c = dr.maximum(c, 1e-6)
        f, metal = self.dielectric_fresnel(p, c), schlick(p.base, 1, c)
        if self.compensation and not self.volume and not self.smooth:
            gain, metal_gain, _ = self.gains(p)
            f, metal = f * gain, metal * metal_gain
        return mix(f, metal, p.metallic) * self.glass_gain(p)

    def below(self, p: Point, c: Any) -> Any:
        """Share of light that the dielectric lets through, to what is diffuse below it or to the other side; metals absorb it."""
        reflected = self.dielectric_fresnel(p, dr.maximum(c, 1e-6))
        if self.compensation and not self.volume and not self.smooth:
            reflected = self.gains(p)[2]
        return p.base * ((1 - p.metallic) * dr.clip(1 - dr.max(reflected), 0, 1))

    def clearcoat_fresnel(self, p: Point, c: Any) -> Any:
        return p.clearcoat * schlick(0.04, 1.0, dr.abs(c))

    def clearcoat_gain(self, p: Point) -> Any:
        """What compensation multiplies the clearcoat's reflection by."""
        if not self.compensation or self.clearcoat_smooth:
            return mi.Float(1)
        a0, a90 = (table(dr.dot(p.clearcoat_frame.n, p.o), dr.sqrt(p.clearcoat_alpha)) for table in self.albedo)
        return 1 + 0.04 * (1 - a0 - a90) / (a0 + a90)

    def clearcoat_albedo(self, p: Point) -> Any:
        c = dr.abs(dr.dot(p.clearcoat_frame.n, p.o))
        if self.clearcoat_smooth:
            return schlick(0.04, 1.0, c)
        a0, a90 = (table(c, dr.sqrt(p.clearcoat_alpha)) for table in self.albedo)
        return self.clearcoat_gain(p) * (0.04 * a0 + a90)

    def through_clearcoat(self, p: Point, i: Any) -> Any:
        """The share that crosses the clearcoat on the way in and out; i in world space."""
        if self.clearcoat == 0:
            return mi.Float(1)
        n = p.clearcoat_frame.n
        if self.compensation:
            return 1 - p.clearcoat * self.clearcoat_albedo(p)
        return (1 - self.clearcoat_fresnel(p, dr.dot(n, p.o))) * (1 - self.clearcoat_fresnel(p, dr.dot(n, i)))

    def sheen_albedo(self, p: Point, c: Any) -> Any:
        x = dr.clip(dr.abs(c), 0, 1) * (self.sheen_columns - 1)
        k = dr.minimum(mi.UInt32(x), self.sheen_columns - 2)

        def row(y: Any) -> Any:
            a, b = (dr.gather(mi.Float, self.sheen_table, y * self.sheen_columns + k + j) for j in (0, 1))
            return mix(a, b, x - k)

        if self.sheen_rows == 1:
            return row(mi.UInt32(0))
        y = dr.clip(p.sheen_roughness / self.sheen_roughness, 0, 1) * (self.sheen_rows - 1)
        r = dr.minimum(mi.UInt32(y), self.sheen_rows - 2)
        return mix(row(r), row(r + 1), y - r)

    def through_sheen(self, p: Point, i: Any) -> Any:
        if max(self.sheen) == 0:
            return mi.Float(1)
        n = p.frame.n
        return 1 - p.sheen_max * dr.maximum(self.sheen_albedo(p, dr.dot(n, p.o)), self.sheen_albedo(p, dr.dot(n, i)))

    # rough lobes: values with cosine, and densities. Directions on different sides of the true surface and of the shading normal are lost.

    def reflected(self, p: Point, i_world: Any) -> tuple[Any, Any]:
        o, i = p.frame.to_local(p.o), p.frame.to_local(i_world)
        up = i.z > 0
        h = dr.normalize(o + i)
        f = self.specular_fresnel(p, dr.dot(o, h))
        lobes = self.probabilities(p)
        value = self.below(p, dr.dot(o, h)) * ((1 - p.transmission) * i.z / dr.pi)
        pdf = lobes.diffuse * i.z / dr.pi
        if not self.smooth:
            d, g = ggx_d(h, p.ax, p.ay), ggx_g2(o, i, p.ax, p.ay)
            value += f * (d * g / (4 * o.z))
            pdf += lobes.specular * ggx_visible_pdf(o, h, p.ax, p.ay) / (4 * dr.maximum(dr.dot(o, h), 1e-9))
        value *= self.through_sheen(p, i_world)
        if max(self.sheen) > 0:
            a = dr.maximum(dr.square(p.sheen_roughness), 1e-3)
            value += p.sheen * charlie(o, i, a)
        value *= self.through_clearcoat(p, i_world) * shadowing(p.frame.n, p.ng, i_world)
        value, pdf = dr.select(up, value, 0), dr.select(up, pdf, 0)
        if self.clearcoat > 0 and not self.clearcoat_smooth:
            co, ci = p.clearcoat_frame.to_local(p.o), p.clearcoat_frame.to_local(i_world)
            a = p.clearcoat_alpha
            h = dr.normalize(co + ci)
            c = dr.dot(co, h)
            clearcoat = self.clearcoat_gain(p) * self.clearcoat_fresnel(p, c) * ggx_d(h, a, a) * ggx_g2(co, ci, a, a) / (4 * co.z)
            clearcoat *= shadowing(p.clearcoat_frame.n, p.ng, i_world)
            value += dr.select(ci.z > 0, mi.Color3f(clearcoat), 0)
            pdf += dr.select(ci.z > 0, lobes.clearcoat * ggx_visible_pdf(co, h, a, a) / (4 * dr.maximum(c, 1e-9)), 0)
        return value, pdf

    def transmitted(self, p: Point, i_world: Any) -> tuple[Any, Any]:
        if self.transmission == 0 or self.smooth:
            return mi.Color3f(0), mi.Float(0)
        o, i = p.frame.to_local(p.o), p.frame.to_local(i_world)
        lobes = self.probabilities(p)
        if self.volume:
            eta = self.eta(p)
            h = dr.normalize(o + eta * i)
            h = dr.select(h.z < 0, -h, h)
            oh, ih = dr.dot(o, h), dr.dot(i, h)
            # Walter et al. (2007), equation 21; radiance by the square of the index, since rays come from the viewer
            bend = dr.abs(oh * ih) / dr.square(oh + eta * ih)
            value = ggx_d(h, p.ax, p.ay) * ggx_g2(o, -i, p.ax, p.ay) * bend / o.z
            density = ggx_visible_pdf(o, h, p.ax, p.ay) * eta * eta * dr.abs(ih) / dr.square(oh + eta * ih)
            possible = (i.z < 0) & (oh > 0) & (ih < 0)
        else:
            i = mi.Vector3f(i.x, i.y, -i.z)
            h = dr.normalize(o + i)
            oh = dr.dot(o, h)
            value = ggx_d(h, p.ax, p.ay) * ggx_g2(o, i, p.ax, p.ay) / (4 * o.z)
            density = ggx_visible_pdf(o, h, p.ax, p.ay) / (4 * dr.maximum(oh, 1e-9))
            possible = i.z > 0
        value = self.below(p, oh) * self.glass_gain(p) * (p.transmission * value * shadowing(p.frame.n, p.ng, i_world))
        value *= self.through_clearcoat(p, i_world) * self.through_sheen(p, i_world)
        return dr.select(possible, value, 0), dr.select(possible, lobes.transmission * density, 0)

    # Mitsuba's interface

    def probabilities(self, p: Point) -> LobeProbabilities:
        """How often each lobe is sampled."""
        c = dr.maximum(dr.dot(p.frame.n, p.o), LEAST_COSINE)
        # facets refract and reflect where the whole would not
        f = dr.clip(dr.max(self.specular_fresnel(p, c)), 0.1, 0.9)
        inner = (1 - p.metallic) * dr.max(p.base)
        diffuse = inner * (1 - p.transmission) * (1 - 0.9 * f) + p.sheen_max
        transmission = inner * p.transmission * (1 - f)
        clearcoat = dr.maximum(self.clearcoat_fresnel(p, dr.dot(p.clearcoat_frame.n, p.o)), 0.1 * p.clearcoat)
        total = diffuse + transmission + f + clearcoat
        return LobeProbabilities(diffuse / total, f / total, transmission / total, clearcoat / total)

    def absorbed(self, si: Any, p: Point) -> Any:
        """Transmittance of the way through the body, which ends here."""
        if not self.volume:
            return mi.Color3f(1)
        return dr.select(p.front, mi.Color3f(1), dr.exp(-mi.Color3f(self.sigma) * si.t))

    def rough(self, si: Any, p: Point, i: Any) -> tuple[Any, Any]:
        """All rough lobes on the side of the true surface that i is on."""
        above = dr.dot(i, p.ng) > 0
        r, t = self.reflected(p, i), self.transmitted(p, i)
        return dr.select(above, r[0], t[0]) * self.absorbed(si, p), dr.select(above, r[1], t[1])

    def straight(self, p: Point) -> Any:
        """Transmittance of a smooth thin wall."""
        o = p.frame.to_local(p.o)
        layers = self.through_clearcoat(p, -p.o) * self.through_sheen(p, -p.o)
        return self.below(p, o.z) * (p.transmission * layers)

    def eval_null_transmission(self, si: Any, active: Any = True) -> Any:
        return self.straight(self.point(si, active)) if self.null else mi.Color3f(0)

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> tuple[Any, Any]:
        p = self.point(si, active)
        lobes = self.probabilities(p)
        o, co = p.frame.to_local(p.o), p.clearcoat_frame.to_local(p.o)
        eta = self.eta(p)
        up = mi.Vector3f(0, 0, 1)

        # which lobe
        bounds = [lobes.diffuse, lobes.diffuse + lobes.specular, lobes.diffuse + lobes.specular + lobes.transmission]
        specular = (sample1 >= bounds[0]) & (sample1 < bounds[1])
        through = (sample1 >= bounds[1]) & (sample1 < bounds[2])
        clearcoat = sample1 >= bounds[2]

        h = up if self.smooth else ggx_visible(o, sample2, p.ax, p.ay)
        reflection = 2 * dr.dot(o, h) * h - o
        if self.volume:
            c = dr.dot(o, h)
            inner = 1 - (1 - c * c) / (eta * eta)
            passage, possible = (c / eta - dr.safe_sqrt(inner)) * h - o / eta, inner > 0
        else:
            passage, possible = mi.Vector3f(reflection.x, reflection.y, -reflection.z), reflection.z > 0
        a = p.clearcoat_alpha
        ch = up if self.clearcoat_smooth else ggx_visible(co, sample2, a, a)
        i = p.frame.to_world(mi.warp.square_to_cosine_hemisphere(sample2))
        i = dr.select(specular, p.frame.to_world(reflection), i)
        i = dr.select(through, p.frame.to_world(passage), i)
        i = dr.select(clearcoat, p.clearcoat_frame.to_world(2 * dr.dot(co, ch) * ch - co), i)

        # the wrong side of the lobe's normal, or of the true surface
        n = dr.dot(i, dr.select(clearcoat, p.clearcoat_frame.n, p.frame.n))
        wrong = (dr.dot(i, p.ng) > 0) == through
        valid = active & dr.select(through, (n < 0) & possible, n > 0) & ~wrong
        value, pdf = self.rough(si, p, i)
        valid &= pdf > 0
        weight = dr.select(valid, value / dr.maximum(pdf, 1e-30), 0)

        # delta lobes, which are mirrored at the true surface
        delta, wi = mi.Bool(False), i
        if self.smooth:
            f = self.specular_fresnel(p, o.z)
            layers = self.through_clearcoat(p, i) * self.through_sheen(p, i) * self.absorbed(si, p)
            body = self.below(p, o.z) * (p.transmission / (eta * eta))
            one = dr.select(through, body / dr.maximum(lobes.transmission, 1e-9), f / dr.maximum(lobes.specular, 1e-9))
            delta = specular | through
            sure = active & dr.select(through, possible, True)
            weight = dr.select(delta, dr.select(sure, one * layers, 0), weight)
            pdf = dr.select(delta, dr.select(sure, 1, 0), pdf)
            valid = dr.select(delta, sure, valid)
        if self.clearcoat > 0 and self.clearcoat_smooth:
            one = self.clearcoat_fresnel(p, co.z) / dr.maximum(lobes.clearcoat, 1e-9) * self.absorbed(si, p)
            weight = dr.select(clearcoat, one, weight)
            pdf, valid, delta = dr.select(clearcoat, 1, pdf), dr.select(clearcoat, active, valid), delta | clearcoat
        wi = dr.select(delta & wrong, mirrored(i, p.ng), i)

        bs = dr.zeros(mi.BSDFSample3f)
        bs.wo = si.to_local(wi)
        bs.pdf = dr.select(valid, pdf, 0)
        bs.eta = dr.select(through, eta, 1)
        passes = mi.BSDFFlags.Null if self.null else mi.BSDFFlags.DeltaTransmission
        smooth_flag = dr.select(through, mi.UInt32(+passes), mi.UInt32(+mi.BSDFFlags.DeltaReflection))
        bs.sampled_type = dr.select(delta, smooth_flag, mi.UInt32(+mi.BSDFFlags.GlossyReflection))
        bs.sampled_component = dr.select(delta, mi.UInt32(len(self.m_components) - 1), mi.UInt32(0))
        return bs, dr.select(valid, weight, 0)

    def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
        p = self.point(si, active)
        value, pdf = self.rough(si, p, si.to_world(wo))
        return dr.select(active, value, 0), dr.select(active, pdf, 0)

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        return self.eval_pdf(ctx, si, wo, active)[1]

    def to_string(self) -> str:
        return "Gltf[]"


def register() -> None:
    """Once a variant is set."""
    mi.register_bsdf("gltf", lambda props: Gltf(props))
