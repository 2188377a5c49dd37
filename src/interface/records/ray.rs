//! Rays, hits, the push constants of every stream, and queues of rays.

records! {
    "ray" values {
        /// The null index: no instance, no texture, no light.
        INVALID: uint = u32::MAX;
    };

    /// A ray: the points `origin + t * direction` with `tmin < t < tmax`, 32 bytes as in RAYS.bin.
    /// A ray with `tmax <= tmin` is inactive: it is not traced, and its callback reports a miss.
    /// The direction need not be of unit length; `t` is measured in units of it. Lengths are scene
    /// units (metres in glTF), relative to the scene's origin (`Scene::origin`).
    Ray: Structure {
        /// Origin.
        origin: vec3,
        /// Exclusive lower bound of `t`, at least 0.
        tmin: float,
        /// Direction, not necessarily of unit length, never zero.
        direction: vec3,
        /// Exclusive upper bound of `t`; may be infinite.
        tmax: float,
    }

    /// The result of tracing a ray. 20 bytes, the record of HITS.bin.
    Hit: Structure {
        /// Ray parameter of the hit; infinite for a miss. Any-hit streams write 0 if occluded.
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
    Push: Push {
        /// Address of the `SceneRoot` that is traced (`Tracer::scene_address`).
        scene: address,
        /// Address of the pass's own parameters.
        pass: address,
        /// Address of ray `first`, if the rays of this launch are in memory: those of a queue, or
        /// the compute tracer's own; 0 for streams that generate theirs. When camera rays are
        /// rasterized: the visibility buffer (trace/visibility.glsl).
        rays: address,
        /// A `uint`: number of rays in the queue; 0: `count` is the number.
        queued: address,
        /// Index of the first ray of this launch.
        first: uint,
        /// Number of rays in this launch; for a queue the maximum.
        count: uint,
        /// Index of the first sample of each pixel.
        sample_index: uint,
        /// A launch traces `2^sample_bits` consecutive samples of each of its pixels.
        sample_bits: uint,
        /// Each camera ray of this launch is shared by `2^shared_bits` consecutive samples of its
        /// pixel (shaders/primary.glsl).
        shared_bits: uint,
        /// Padding to a multiple of 8 bytes.
        reserved: uint,
    }
}
