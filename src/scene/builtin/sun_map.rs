//! An environment map with a sun, in code.

use glam::{DVec3, Vec3};

use crate::scene::EnvironmentMap;

/// Pixels of the map: a texel is 0.7 degrees, about the sun.
const SIZE: [u32; 2] = [512, 256];

/// A sky: blue above, brown below, and a sun that is 10^4 times as bright as both.
pub fn sun_map() -> EnvironmentMap {
    let [width, height] = SIZE;
    let sun = DVec3::new(0.5, 0.6, 0.62).normalize();
    let texel = |k: u32| {
        let (x, y) = (f64::from(k % width) + 0.5, f64::from(k / width) + 0.5);
        let (phi, theta) =
            (std::f64::consts::TAU * (x / f64::from(width) - 0.5), std::f64::consts::PI * y / f64::from(height));
        let d = DVec3::new(theta.sin() * phi.sin(), theta.cos(), -theta.sin() * phi.cos());
        let sky = if d.y > 0.0 { Vec3::new(0.5, 0.7, 1.0) } else { Vec3::new(0.3, 0.25, 0.2) };
        // half a degree across, and no less than a texel
        if d.dot(sun) > 0.4f64.to_radians().cos() { Vec3::new(1.0e4, 9.0e3, 7.0e3) } else { sky }
    };
    EnvironmentMap::new("own sun map", SIZE, (0..width * height).map(texel).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn our_own_map_has_one_sun() {
        let map = sun_map();
        let bright = map.radiance.iter().filter(|r| r.x > 100.0).count();
        assert!((1..=4).contains(&bright), "{bright} texels of sun");
        // seen upwards
        let at = map.radiance.iter().position(|r| r.x > 100.0).unwrap();
        assert!(at / (SIZE[0] as usize) < SIZE[1] as usize / 2);
    }
}
