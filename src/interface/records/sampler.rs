//! Dimensions of the sampler, in pairs.

records! {
    "sampler" values {
        /// Position in the pixel.
        CAMERA_FILM: uint = 0;
        /// Position on the lens.
        CAMERA_LENS: uint = 1;
        /// Direction of an ambient occlusion ray.
        AO_DIRECTION: uint = 2;
        /// In place of a dimension pair, for the random number of each ray by which partial coverage is decided.
        RAY_SEED: uint = 3;
        /// The first of a path's: vertex n begins at `PATH_FIRST + n * PATH_STRIDE`.
        PATH_FIRST: uint = 8;
        /// Of a vertex of a path.
        PATH_STRIDE: uint = 8;
    };
}
