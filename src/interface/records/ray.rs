//! Rays, hits, the push constants of every stream, and queues of rays.

records! {
    "ray" values {
        /// Names nothing: no instance, no texture, no light.
        INVALID: uint = u32::MAX;
    };

    /// One ray: the points `origin + t * direction` with `tmin < t < tmax`. 32 bytes, the record of RAYS.bin. A ray with `tmax <= tmin` is no ray: it is not
    /// traced, and its callback reports a miss.
    ///
    /// The direction need not be of unit length; `t` is measured in units of it. Lengths are world units (metres in glTF) relative to the scene's origin
    /// (`Scene::origin`).
    Ray: structure {
        /// Start.
        origin: vec3,
        /// Hits at or before this parameter do not count. At least 0.
        tmin: float,
        /// Direction, not necessarily of unit length, never zero.
        direction: vec3,
        /// Hits at or beyond this parameter do not count. May be infinite.
        tmax: float,
    }

    /// What a ray met. 20 bytes, the record of HITS.bin.
    Hit: structure {
        /// Ray parameter of the hit; infinite for a miss. A stream that only asks whether something is in the way writes 0 for "occluded".
        t: float,
        /// Index into the scene's instances; all ones for a miss.
        instance: uint,
        /// Index of the triangle or sphere in the instance's mesh; all ones for a miss.
        primitive: uint,
        /// Barycentric weight of the triangle's second vertex (0 for a sphere).
        u: float,
        /// Barycentric weight of the triangle's third vertex (0 for a sphere).
        v: float,
    }

    /// The push constants of every stream and pass.
    Push: push {
        /// `SceneRoot` of what is traced (`Tracer::scene_address`).
        scene: address,
        /// The pass's own parameters.
        pass: address,
        /// Ray number `first`, where the rays of this launch are in memory: a queue's, or the compute tracer's own; 0 for streams that make their own. Where
        /// those were rasterized: what was (trace/visibility.glsl).
        rays: address,
        /// A `uint`: how many rays the queue holds; 0 when `count` says it.
        queued: address,
        /// Index of the first ray of this launch.
        first: uint,
        /// Rays in this launch; of a queue: at most.
        count: uint,
        /// The first sample of each pixel.
        sample_index: uint,
        /// A launch takes `2^sample_bits` samples of each of its pixels; their rays follow each other.
        sample_bits: uint,
    }
}
