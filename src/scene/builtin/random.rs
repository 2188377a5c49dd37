//! Random numbers for the layout of scenes.

/// Random numbers for the layout of scenes, the same on every machine.
pub(super) struct Rng {
    seed: u32,
    counter: u32,
}

impl Rng {
    /// The numbers that follow from a seed.
    pub fn new(seed: u32) -> Self {
        Self { seed, counter: 0 }
    }

    /// Uniform in [lo, hi).
    pub fn range(&mut self, lo: f64, hi: f64) -> f64 {
        self.counter = self.counter.wrapping_add(1);
        let x = crate::sampling::sobol::hash_combine(self.seed, self.counter);
        lo + (hi - lo) * crate::sampling::to_unit(x) as f64
    }

    /// A uniformly distributed rotation (Shoemake 1992).
    pub fn rotation(&mut self) -> glam::DQuat {
        let (a, b, c) =
            (self.range(0.0, 1.0), self.range(0.0, std::f64::consts::TAU), self.range(0.0, std::f64::consts::TAU));
        let (p, q) = ((1.0 - a).sqrt(), a.sqrt());
        glam::DQuat::from_xyzw(p * b.sin(), p * b.cos(), q * c.sin(), q * c.cos()).normalize()
    }
}
