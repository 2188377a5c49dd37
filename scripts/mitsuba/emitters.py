"""KHR_lights_punctual's points and spots as a Mitsuba emitter: its falloff between two cones and its range, which Mitsuba's own have not."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi


class Punctual(mi.Emitter):
    """A point or spot at `position`; a point has `cos_outer` -1 and `cos_inner` below it."""

    def __init__(self, props: mi.Properties) -> None:
        mi.Emitter.__init__(self, props)
        self.at = mi.ScalarPoint3f([props[f"position_{k}"] for k in "xyz"])
        self.axis = mi.ScalarVector3f([props[f"axis_{k}"] for k in "xyz"])
        self.candela = mi.ScalarColor3f([props[f"intensity_{k}"] for k in "rgb"])
        self.inner, self.outer = props["cos_inner"], props["cos_outer"]
        self.range = props["range"]
        self.m_flags = mi.EmitterFlags.DeltaPosition

    def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
        to = mi.Point3f(self.at) - it.p
        distance = dr.norm(to)
        wi = to / distance
        angular = dr.clip((-dr.dot(wi, mi.Vector3f(self.axis)) - self.outer) / max(self.inner - self.outer, 1e-4), 0, 1)
        window = dr.clip(1 - (distance / self.range) ** 4, 0, 1)
        ds = dr.zeros(mi.DirectionSample3f)
        ds.p, ds.n, ds.d, ds.dist = mi.Point3f(self.at), mi.Normal3f(-wi), wi, distance
        ds.pdf, ds.delta, ds.time = mi.Float(1), mi.Bool(True), it.time
        ds.emitter = mi.EmitterPtr(self)
        return ds, mi.Color3f(self.candela) * (dr.square(angular) * window / dr.square(distance)) & active

    def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
        return mi.Float(0)

    def eval_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
        return mi.Color3f(0)

    def eval(self, si: Any, active: Any = True) -> Any:
        return mi.Color3f(0)

    def bbox(self) -> Any:
        return mi.ScalarBoundingBox3f(self.at, self.at)

    def to_string(self) -> str:
        return "Punctual[]"


def register() -> None:
    """Once a variant is set."""
    mi.register_emitter("punctual", lambda props: Punctual(props))
