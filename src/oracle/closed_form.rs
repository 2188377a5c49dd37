//! Analytic ambient visibility (1 - cosine-weighted occlusion) of simple scenes, in closed form or
//! by one-dimensional quadrature.
//!
//! Lengths are in scene units, angles in radians. For binary occlusion, cosine-weighted occlusion
//! is the form factor from a point to what occludes (Howell, "A Catalog of Radiation Heat Transfer
//! Configuration Factors"). With falloff, `c` is the base of `c^-d`, at least 1; 1 is binary.
//! Everything is tested against Monte Carlo integration by the oracle.

use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Ambient visibility of a point of an unoccluded plane: 1.
pub fn plane() -> f64 {
    1.0
}

/// Ambient visibility of a point inside a closed surface: 0.
pub fn closed_box() -> f64 {
    0.0
}

/// A point on a wall of an infinite V-groove that opens by `angle`: (1 - cos angle) / 2, at any
/// distance from the bottom.
///
/// In the plane across the groove the other wall covers the directions from the bottom of the
/// groove (angle 0 above the wall) to those parallel to the other wall (angle pi - `angle`), and
/// the form factor to an infinite strip between two such angles is half the difference of their
/// cosines (Hottel): (1 + cos angle) / 2.
pub fn v_groove(angle: f64) -> f64 {
    if angle >= PI { 1.0 } else { (1.0 - angle.cos()) / 2.0 }
}

/// A point of a wall of a finite V-groove: at `distance` from the bottom, `along` its middle; the
/// other wall is `length` long and `width` wide (along the groove).
pub fn v_groove_finite(angle: f64, distance: f64, along: f64, length: f64, width: f64) -> f64 {
    // this wall is the plane y = 0, the bottom of the groove the z axis, the point at (distance, 0,
    // along)
    let slope = DVec3::new(angle.cos(), angle.sin(), 0.0) * length;
    let (a, b) = (DVec3::Z * (-0.5 * width), DVec3::Z * (0.5 * width));
    let wall = [a, b, b + slope, a + slope];
    1.0 - polygon_form_factor(DVec3::new(distance, 0.0, along), DVec3::Y, &wall)
}

/// A point of a wall of an infinite V-groove with falloff, at `distance` from the bottom.
///
/// In cylindrical coordinates around the groove's direction, at angle `phi` above the wall and
/// elevation `beta` out of the cross-section, the other wall is at `rho(phi) / cos(beta)`. The
/// integral over `beta` is the Bickley-Naylor function Ki_3, which leaves 2/pi * integral of
/// sin(phi) Ki_3(rho ln c) over phi.
pub fn v_groove_falloff(angle: f64, distance: f64, c: f64) -> f64 {
    if angle >= PI {
        return 1.0;
    }
    let occlusion = integrate(0.0, PI - angle, 60, |phi| {
        let rho = distance * angle.sin() / (phi + angle).sin();
        phi.sin() * bickley_3(rho * c.ln())
    });
    1.0 - 2.0 / PI * occlusion
}

/// Ki_3(x) = integral of cos^2(beta) exp(-x / cos(beta)) over [0, pi/2].
pub fn bickley_3(x: f64) -> f64 {
    integrate(0.0, FRAC_PI_2, 60, |beta| {
        let c = beta.cos();
        c * c * (-x / c).exp()
    })
}

/// A point of a plane at `rho` from the foot of a sphere whose centre is `height` above the plane:
/// 1 - r^2 h / (rho^2 + h^2)^1.5. `None` unless the sphere is wholly above the plane, where the
/// formula holds.
pub fn sphere_over_plane(radius: f64, height: f64, rho: f64) -> Option<f64> {
    (height >= radius).then(|| 1.0 - radius * radius * height / (rho * rho + height * height).powf(1.5))
}

/// The point of a plane straight below a sphere, with falloff. Quadrature over the angle from the
/// normal; the sphere is met at h cos - sqrt(r^2 - h^2 sin^2). `None` unless the sphere is wholly
/// above the plane.
pub fn sphere_over_plane_falloff(radius: f64, height: f64, c: f64) -> Option<f64> {
    (height >= radius).then(|| {
        // theta = widest * sin(x): removes the root's singularity at the rim
        let widest = (radius / height).min(1.0).asin();
        let occlusion = integrate(0.0, FRAC_PI_2, 200, |x| {
            let (theta, scale) = (widest * x.sin(), widest * x.cos());
            let (sin, cos) = theta.sin_cos();
            let distance = height * cos - (radius * radius - height * height * sin * sin).max(0.0).sqrt();
            c.powf(-distance) * sin * cos * scale
        });
        1.0 - 2.0 * occlusion
    })
}

/// A point of a plane `gap` below a parallel rectangle that spans `[x0, x1]` by `[y0, y1]` relative
/// to the point's perpendicular: the classic form factor to a rectangle's corner, four times with
/// signs.
pub fn parallel_rectangle(gap: f64, [x0, x1]: [f64; 2], [y0, y1]: [f64; 2]) -> f64 {
    let corner = |x: f64, y: f64| {
        let (x, y) = (x / gap, y / gap);
        let (p, q) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
        (x / p * (y / p).atan() + y / q * (x / q).atan()) / TAU
    };
    1.0 - (corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0))
}

/// A point of a plane `gap` below the middle of a parallel disk (of infinite radius: a parallel
/// plane), with falloff and an occlusion radius. Binary and unlimited it is gap^2 / (gap^2 +
/// disk^2).
///
/// With the cosine `mu` from the normal the disk is met at `gap / mu`: 1 - 2 * integral of mu
/// c^(-gap / mu) over the cosines at which the disk lies within its rim and within the radius.
pub fn parallel_disk(gap: f64, disk: f64, c: f64, radius: f64) -> f64 {
    let least = (gap / gap.hypot(disk)).max(gap / radius);
    if least >= 1.0 {
        return 1.0;
    }
    if c == 1.0 {
        return least * least;
    }
    1.0 - 2.0 * integrate(least, 1.0, 400, |mu| mu * c.powf(-gap / mu))
}

/// Form factor from a point with unit normal `normal` to a planar convex polygon, either side: the
/// share of cosine-weighted directions that meet it. Lambert's formula (Baum et al. 1989), after
/// clipping the polygon at the horizon.
pub fn polygon_form_factor(point: DVec3, normal: DVec3, polygon: &[DVec3]) -> f64 {
    let corners: Vec<DVec3> = polygon.iter().map(|p| *p - point).collect();
    let mut above = Vec::with_capacity(corners.len() + 1);
    for (k, &a) in corners.iter().enumerate() {
        let b = corners[(k + 1) % corners.len()];
        let (x, y) = (a.dot(normal), b.dot(normal));
        if x >= 0.0 {
            above.push(a);
        }
        if (x > 0.0 && y < 0.0) || (x < 0.0 && y > 0.0) {
            above.push(a + (b - a) * (x / (x - y)));
        }
    }
    let mut sum = 0.0;
    for (k, &a) in above.iter().enumerate() {
        let b = above[(k + 1) % above.len()];
        let cross = a.cross(b);
        let sine = cross.length();
        // an edge that points at the point itself subtends nothing
        if sine > 0.0 {
            sum += sine.atan2(a.dot(b)) * cross.dot(normal) / sine;
        }
    }
    (sum / TAU).abs()
}

/// Integral of `f` over `[a, b]`: Gauss-Legendre with five points on each of `panels` equal parts.
fn integrate(a: f64, b: f64, panels: u32, f: impl Fn(f64) -> f64) -> f64 {
    const NODES: [(f64, f64); 5] = [
        (0.0, 128.0 / 225.0),
        (-0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
        (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
        (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
        (0.906_179_845_938_664, 0.236_926_885_056_189_08),
    ];
    let half = 0.5 * (b - a) / panels as f64;
    let panel = |k: u32| {
        let middle = a + half * (2 * k + 1) as f64;
        NODES.iter().map(|(x, w)| w * f(middle + half * x)).sum::<f64>()
    };
    half * (0..panels).map(panel).sum::<f64>()
}
