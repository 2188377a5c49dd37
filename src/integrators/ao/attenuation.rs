//! How ambient occlusion fades with distance, for images and for frames.

/// Below this a hit's share is not looked for: half a step of an 8-bit image.
const CUTOFF: f64 = 1.0 / 510.0;

/// How far hits occlude, and how much. shaders/ao/sample.glsl applies it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attenuation {
    /// World units beyond which nothing occludes; infinite for no limit.
    pub radius: f64,
    /// c, at least 1: a hit at distance d counts c^-d; 1 counts every hit alike.
    pub falloff: f64,
}

impl Attenuation {
    /// Hits beyond this distance change nothing that can be seen: the radius, or where the falloff has faded.
    pub fn reach(self) -> f64 {
        if self.is_binary() { self.radius } else { self.radius.min(-CUTOFF.ln() / self.falloff.ln()) }
    }

    /// Does any hit do, or has the nearest one to be found?
    pub fn is_binary(self) -> bool {
        self.falloff <= 1.0
    }

    /// Exponent per world unit: what shaders are given.
    pub fn falloff_log2(self) -> f64 {
        self.falloff.log2()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reach_is_where_falloff_has_faded() {
        let of = |radius, falloff| Attenuation { radius, falloff };
        assert_eq!(of(3.0, 1.0).reach(), 3.0);
        assert_eq!(of(3.0, 2.0).reach(), 3.0);
        assert_eq!(of(f64::INFINITY, 1.0).reach(), f64::INFINITY);
        let faded = of(f64::INFINITY, 2.0);
        assert!((2f64.powf(-faded.reach()) - CUTOFF).abs() < 1e-12 && !faded.is_binary() && faded.falloff_log2() == 1.0);
    }
}
