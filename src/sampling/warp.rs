//! Maps from the unit square to disks, hemispheres and frames.
//!
//! `f32`, without library functions other than the square root: the shaders hold the same
//! expressions in the same order, so that a driver's sine does not matter. Directions are in a
//! frame whose z axis is the normal.

/// Sine on [-pi/4, pi/4] by the minimax polynomial of Cephes' `sinf`. Error at most 1e-7, absolute
/// (tested).
pub fn sin_quarter(x: f32) -> f32 {
    let z = x * x;
    ((-1.951_529_6e-4 * z + 8.332_161e-3) * z - 1.666_665_5e-1) * z * x + x
}

/// Cosine on [-pi/4, pi/4] by the minimax polynomial of Cephes' `cosf`. Error at most 1e-7,
/// absolute (tested).
pub fn cos_quarter(x: f32) -> f32 {
    let z = x * x;
    ((2.443_315_7e-5 * z - 1.388_731_6e-3) * z + 4.166_664_6e-2) * z * z - 0.5 * z + 1.0
}

/// The concentric map of Shirley and Chiu, "A Low Distortion Map Between Disk and Square" (1997):
/// `(x, y, r)` with `x^2 + y^2 = r^2` and `-1 <= r <= 1` (the sign of `r` tells the wedge; its
/// magnitude is the radius).
pub fn concentric_disk(u: [f32; 2]) -> [f32; 3] {
    const PI_4: f32 = std::f32::consts::FRAC_PI_4;
    let (a, b) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if a.abs() > b.abs() {
        let phi = PI_4 * (b / a);
        [a * cos_quarter(phi), a * sin_quarter(phi), a]
    } else if b != 0.0 {
        // angle pi/2 - phi: sine and cosine change places
        let phi = PI_4 * (a / b);
        [b * sin_quarter(phi), b * cos_quarter(phi), b]
    } else {
        [0.0, 0.0, 0.0]
    }
}

/// A direction on the unit hemisphere around +z with density cos(theta) / pi, by Malley's method:
/// up from a uniform point of the disk. `z` is 0 only on the border of the square (probability
/// 2^-23 for 24-bit input).
pub fn cosine_hemisphere(u: [f32; 2]) -> [f32; 3] {
    let [x, y, r] = concentric_disk(u);
    // not 1 - r*r: near the horizon the difference would cancel
    [x, y, ((1.0 - r) * (1.0 + r)).sqrt()]
}

/// Density of [`cosine_hemisphere`] with respect to solid angle.
pub fn cosine_hemisphere_pdf(cos_theta: f32) -> f32 {
    cos_theta * std::f32::consts::FRAC_1_PI
}

/// A direction on the unit hemisphere around +z with constant density 1 / (2 pi).
pub fn uniform_hemisphere(u: [f32; 2]) -> [f32; 3] {
    let [x, y, r] = concentric_disk(u);
    let r2 = r * r;
    let scale = (2.0 - r2).sqrt();
    [x * scale, y * scale, 1.0 - r2]
}

/// Density of [`uniform_hemisphere`] with respect to solid angle.
pub const UNIFORM_HEMISPHERE_PDF: f32 = 0.5 * std::f32::consts::FRAC_1_PI;

/// Two unit vectors that make a right-handed frame with the unit vector `n`: Duff et al., "Building
/// an Orthonormal Basis, Revisited", JCGT 6(1), 2017. No singularity; error of a few ulp. Their
/// sign changes at z = 0, where walls have their normals: here a little below, so that rounding,
/// which differs from device to device, decides about no axis.
pub fn orthonormal_basis(n: [f32; 3]) -> ([f32; 3], [f32; 3]) {
    let sign = if n[2] >= -1e-4 { 1.0 } else { -1.0 };
    let a = -1.0 / (sign + n[2]);
    let b = n[0] * n[1] * a;
    ([1.0 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]], [b, sign + n[1] * n[1] * a, -n[1]])
}

/// `v`, given in the frame of [`orthonormal_basis`] around `n`, in the space of `n`.
pub fn to_world(n: [f32; 3], v: [f32; 3]) -> [f32; 3] {
    let (s, t) = orthonormal_basis(n);
    std::array::from_fn(|i| s[i] * v[0] + t[i] * v[1] + n[i] * v[2])
}
