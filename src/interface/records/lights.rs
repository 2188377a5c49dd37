//! Lights, and the tree over many.

records! {
    "lights" values {
        /// Triangle, rectangle: it emits from its back, too.
        LIGHT_TWO_SIDED: uint = 1;
        /// Triangle, rectangle: a transform that mirrors has turned its winding.
        LIGHT_MIRRORED: uint = 2;
        /// Triangle: its material's alpha says how much of it is there.
        LIGHT_ALPHA: uint = 4;
        /// Of `LightNode.link`: the node is a leaf.
        LIGHT_LEAF: uint = 0x8000_0000;
        /// Of `LightNode.link`: it emits along its axis and against it.
        LIGHT_BOTH_WAYS: uint = 0x4000_0000;
        /// Of `LightNode.link`: the number.
        LIGHT_LINK: uint = 0x3fff_ffff;
    };

    /// A light.
    LightRecord: array LightRecords readonly 16 {
        /// Point, spot: position; triangle, rectangle, portal: a corner; sphere: centre. World space.
        position: vec3,
        /// Sphere: radius; directional: 1 - cosine of half its angular diameter.
        radius: float,
        /// Spot, directional: direction of its light; triangle, rectangle, portal: first edge.
        axis: vec3,
        /// Spot: cosine of the angle up to which it is undiminished.
        cos_inner: float,
        /// Triangle, rectangle, portal: second edge.
        edge: vec3,
        /// Spot: cosine of the angle beyond which it is dark.
        cos_outer: float,
        /// Point, spot: radiant intensity; directional: irradiance; else: radiance, before any texture. Linear RGB.
        intensity: vec3,
        /// Point, spot: without effect beyond, world units.
        range: float,
        /// Of being chosen by power.
        probability: float,
        /// Of a light in the tree: its way from the root, bit k set where it is in the second child at level k.
        trail: uint,
        /// To a multiple of 16 bytes.
        reserved: uint,
        /// One of `LIGHT_*` of light_kinds.
        kind: uint,
        /// Triangle, rectangle, sphere: index of its instance; else `INVALID`.
        instance: uint,
        /// Triangle, rectangle, sphere: index in the instance's mesh; environment: number of portals, which follow it.
        primitive: uint,
        /// `LIGHT_TWO_SIDED`, `LIGHT_MIRRORED`, `LIGHT_ALPHA`.
        flags: uint,
        /// Triangle, rectangle, sphere: how far off its surface a light sample ends, scene units: a bound on rounding, so that the shadow ray does not meet the light itself.
        lift: float,
    }

    /// Bounds of what the lights of a subtree emit: from a ball, within an angle o + e of an axis, fading beyond o.
    LightNode: array LightNodes readonly 16 {
        /// Of the ball.
        center: vec3,
        /// Of the ball, world units.
        radius: float,
        /// Unit.
        axis: vec3,
        /// Brightness per solid angle, in its best direction.
        intensity: float,
        /// Cosine of o.
        cos_o: float,
        /// Sine of o.
        sin_o: float,
        /// Cosine of e.
        cos_e: float,
        /// Of an inner node: its first child, the second follows; of a leaf: its light; with flags above.
        link: uint,
    }
}
