//! Dimensions of the sampler, in pairs.

records! {
    "sampler" values {
        /// Position in the pixel.
        CAMERA_FILM: uint = 0;
        /// Position on the lens.
        CAMERA_LENS: uint = 1;
        /// Direction of an ambient occlusion ray.
        AO_DIRECTION: uint = 2;
        /// Dimension pair of the random number of each ray that decides stochastic alpha.
        RAY_SEED: uint = 3;
        /// Length of a ray of ambient light, where occlusion falls off with distance.
        AO_LENGTH: uint = 4;
        /// Wavelength of a path that is refracted by dispersive volumes.
        WAVELENGTH: uint = 5;
        /// First dimension pair of a path: vertex n begins at `PATH_FIRST + n * PATH_STRIDE`.
        PATH_FIRST: uint = 8;
        /// Number of dimension pairs per path vertex.
        PATH_STRIDE: uint = 8;
    };
}
