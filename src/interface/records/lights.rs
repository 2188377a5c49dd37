//! Light records, and the nodes of the light tree.

records! {
    "lights" values {
        /// Flag of a triangle or rectangle: it emits from both sides.
        LIGHT_TWO_SIDED: uint = 1;
        /// Flag of a triangle or rectangle: a mirroring transform has reversed its winding.
        LIGHT_MIRRORED: uint = 2;
        /// Flag of a triangle: its material has alpha, which scales what it emits.
        LIGHT_ALPHA: uint = 4;
        /// First of five bits in the flags of a triangle in parts, one with a picture: number of
        /// parts along an edge; 0: it is whole.
        LIGHT_SIDE_AT: uint = 8;
        /// First of five bits: cells before the part along the first edge.
        LIGHT_ROW_AT: uint = 13;
        /// First of five bits: cells before the part along the second edge.
        LIGHT_COLUMN_AT: uint = 18;
        /// Mask of five bits.
        LIGHT_FIVE_BITS: uint = 31;
        /// Flag of a part: it is turned around, its corner is opposite to that of its cell.
        LIGHT_TURNED: uint = 0x80_0000;
        /// Flag of `LightNode.link`: the node is a leaf.
        LIGHT_LEAF: uint = 0x8000_0000;
        /// Flag of `LightNode.link`: the lights emit along the axis and against it.
        LIGHT_BOTH_WAYS: uint = 0x4000_0000;
        /// Mask of the index in `LightNode.link`.
        LIGHT_LINK: uint = 0x3fff_ffff;
    };

    /// A light of the scene.
    LightRecord: Array(buffer: "LightRecords", access: "readonly", align: 16) {
        /// World-space position; corner of triangle, rectangle, portal; centre of a sphere.
        position: vec3,
        /// Sphere: radius; directional: 1 - cosine of half its angular diameter.
        radius: float,
        /// Direction of emission of lights from a position or directional; else the first edge.
        axis: vec3,
        /// First number of src/scene/lights/NAME.rs; spot: cosine of the inner cone angle.
        parameter_0: float,
        /// Triangle, rectangle, portal: second edge.
        edge: vec3,
        /// Second one; spot: cosine of the outer cone angle.
        parameter_1: float,
        /// Radiant intensity of lights from a position, irradiance of directional ones; else
        /// radiance, before any texture. Linear RGB.
        intensity: vec3,
        /// Lights from a position: range beyond which the light has no effect, scene units.
        range: float,
        /// Distant lights: probability of being chosen among them. Placed ones: the same, for the
        /// samples that choose without looking at the point.
        probability: float,
        /// Lower 32 bits of a placed light's trail: bit k is set for the second child at level k.
        trail_low: uint,
        /// Upper 32 bits.
        trail_high: uint,
        /// One of `LIGHT_*` of interface/light_kinds.glsl.
        kind: uint,
        /// Triangle, rectangle, sphere: index of its instance; else `INVALID`.
        instance: uint,
        /// Emissive surface: index in the mesh; environment: number of portals, which follow it.
        primitive: uint,
        /// Flags `LIGHT_TWO_SIDED`, `LIGHT_MIRRORED`, `LIGHT_ALPHA`, and those of parts.
        flags: uint,
        /// Distance from an emissive surface at which its light samples end, scene units: a bound
        /// on rounding, so that the shadow ray does not hit the light itself.
        lift: float,
    }

    /// A node of the light tree: emission bounds of the lights below it. They lie in a sphere,
    /// their normals within an angle o of an axis, and emission ends at an angle e beyond that.
    LightNode: Array(buffer: "LightNodes", access: "readonly", align: 16) {
        /// Centre of the bounding sphere.
        center: vec3,
        /// Radius of the bounding sphere, scene units.
        radius: float,
        /// Unit axis of the cone of normals.
        axis: vec3,
        /// Maximum intensity over all directions.
        intensity: float,
        /// Cosine of o.
        cos_o: float,
        /// Sine of o.
        sin_o: float,
        /// Cosine of e.
        cos_e: float,
        /// Inner node: index of the first of two children; leaf: index of its light; with flags.
        link: uint,
    }
}
