//! Interpolation between keyframes, as in appendix C of the glTF 2.0 specification.

use std::sync::Arc;

use glam::{DQuat, DVec3, DVec4};

/// Interpolation between two keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// The value of the key before.
    Step,
    /// Linear; rotations by slerp, the shorter way.
    #[default]
    Linear,
    /// Cubic Hermite splines with stored tangents; rotations are normalized afterwards.
    CubicSpline,
}

/// Keyframes of one animated property.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampler {
    /// Interpolation between keys.
    pub interpolation: Interpolation,
    /// Times of the keys in seconds, in order; of two keys at one time the second counts from then
    /// on: a jump. Channels of a file often share them.
    pub times: Arc<[f32]>,
    /// The numbers of each key, one key after the other; for splines those of the incoming tangent,
    /// the value and the outgoing tangent (per second).
    pub values: Vec<f32>,
}

/// The position of a time between keys: a fraction `share` (0 to 1) of the way from key `key` to
/// the next one, which is `seconds` later (0 without a next key).
struct KeyInterval {
    key: usize,
    share: f64,
    seconds: f64,
}

impl Sampler {
    /// Brings the keys of a file into order: those whose time or value is not finite are removed,
    /// the others sorted by their times. Returns what there is to say about them, in words; nothing
    /// about keys that cannot be told apart because there are not as many values as times.
    pub(in crate::scene) fn repair(&mut self, width: usize) -> Vec<String> {
        let mut said = Vec::new();
        let size = width * self.stride();
        if size == 0 || self.times.len().checked_mul(size) != Some(self.values.len()) {
            return said;
        }
        let is_finite =
            |key: usize| self.times[key].is_finite() && self.values[key * size..][..size].iter().all(|v| v.is_finite());
        let mut order: Vec<usize> = (0..self.times.len()).filter(|&key| is_finite(key)).collect();
        let removed = self.times.len() - order.len();
        if removed > 0 {
            said.push(format!("{removed} keys have a time or a value that is not finite: left out"));
        }
        if !order.is_sorted_by(|&a, &b| self.times[a] <= self.times[b]) {
            said.push("its keys are not in the order of their times: sorted".to_owned());
            order.sort_by(|&a, &b| self.times[a].total_cmp(&self.times[b]));
        }
        if let Some(pair) = order.windows(2).find(|pair| self.times[pair[0]] == self.times[pair[1]]) {
            said.push(format!("has more than one key at {} s: it jumps there", self.times[pair[0]]));
        }
        if !order.iter().copied().eq(0..self.times.len()) {
            self.values = order.iter().flat_map(|&key| &self.values[key * size..][..size]).copied().collect();
            self.times = order.iter().map(|&key| self.times[key]).collect();
        }
        said
    }

    /// Checks that there are keys, with times that do not decrease, and a value of `width` numbers
    /// for each, all finite.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn check(&self, width: usize) -> Result<(), String> {
        let keys = self.times.len();
        if keys == 0 {
            return Err("has no keys".to_owned());
        }
        if let Some(k) = self.times.iter().position(|t| !t.is_finite()) {
            return Err(format!("the time of key {k} is not finite"));
        }
        if let Some(k) = self.times.windows(2).position(|t| t[0] > t[1]) {
            return Err(format!(
                "the time of key {} ({} s) is before that of the key before it",
                k + 1,
                self.times[k + 1]
            ));
        }
        let wanted = keys.checked_mul(width * self.stride());
        if wanted != Some(self.values.len()) {
            return Err(format!("has {} numbers for {keys} keys of {}", self.values.len(), width * self.stride()));
        }
        match self.values.iter().position(|v| !v.is_finite()) {
            Some(i) => Err(format!("a value of key {} is not finite", i / (width * self.stride()).max(1))),
            None => Ok(()),
        }
    }

    /// Number of values per key: splines have two tangents.
    fn stride(&self) -> usize {
        if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 }
    }

    /// Time of the last key in seconds.
    pub fn end(&self) -> f64 {
        self.times.last().map_or(0.0, |&t| f64::from(t))
    }

    /// The numbers of key `key`, `width` of them. `part`: 0 for the value, -1 and 1 for the
    /// tangents before and after it.
    fn numbers(&self, key: usize, width: usize, part: isize) -> &[f32] {
        let at = match self.interpolation {
            Interpolation::CubicSpline => (3 * key).saturating_add_signed(1 + part),
            _ => key,
        };
        self.values.get(at * width..(at + 1) * width).unwrap_or_default()
    }

    /// Finds the keys around a time. Times before the first key and after the last one are clamped.
    fn locate(&self, seconds: f64) -> KeyInterval {
        let next = self.times.partition_point(|&t| f64::from(t) <= seconds);
        if next == 0 || next == self.times.len() {
            return KeyInterval { key: next.saturating_sub(1), share: 0.0, seconds: 0.0 };
        }
        let (from, to) = (f64::from(self.times[next - 1]), f64::from(self.times[next]));
        KeyInterval { key: next - 1, share: (seconds - from) / (to - from), seconds: to - from }
    }

    /// Number `i` of a value of `width` numbers; straight lines for [`Interpolation::Linear`].
    fn number(&self, b: &KeyInterval, width: usize, i: usize) -> f64 {
        let at = |key, part| self.numbers(key, width, part).get(i).map_or(0.0, |&v| f64::from(v));
        let (here, u) = (at(b.key, 0), b.share);
        if b.seconds == 0.0 {
            return here;
        }
        match self.interpolation {
            Interpolation::Step => here,
            Interpolation::Linear => here + (at(b.key + 1, 0) - here) * u,
            Interpolation::CubicSpline => {
                let (u2, u3) = (u * u, u * u * u);
                (2.0 * u3 - 3.0 * u2 + 1.0) * here
                    + b.seconds * (u3 - 2.0 * u2 + u) * at(b.key, 1)
                    + (3.0 * u2 - 2.0 * u3) * at(b.key + 1, 0)
                    + b.seconds * (u3 - u2) * at(b.key + 1, -1)
            }
        }
    }

    /// A translation or scale.
    pub fn vector(&self, seconds: f64) -> DVec3 {
        let b = self.locate(seconds);
        DVec3::from_array([0, 1, 2].map(|i| self.number(&b, 3, i)))
    }

    /// A rotation, of unit length.
    pub fn rotation(&self, seconds: f64) -> DQuat {
        let b = self.locate(seconds);
        if self.interpolation == Interpolation::Linear && b.seconds > 0.0 {
            let [from, to] = [b.key, b.key + 1].map(|key| {
                let numbers = self.numbers(key, 4, 0);
                unit(DVec4::from_array([0, 1, 2, 3].map(|i| numbers.get(i).map_or(0.0, |&v| f64::from(v)))))
            });
            // the shorter way round: glam negates the end where the dot product is negative
            return from.slerp(to, b.share).normalize();
        }
        unit(DVec4::from_array([0, 1, 2, 3].map(|i| self.number(&b, 4, i))))
    }

    /// Weights of morph targets, as many as `out` holds.
    pub fn weights(&self, seconds: f64, out: &mut [f64]) {
        let b = self.locate(seconds);
        let width = out.len();
        for (i, w) in out.iter_mut().enumerate() {
            *w = self.number(&b, width, i);
        }
    }

    /// Whether all keys have one value, and `same` accepts it: nothing is animated.
    pub(super) fn is_constant(&self, width: usize, same: impl Fn(&[f32]) -> bool) -> bool {
        let spline = self.interpolation == Interpolation::CubicSpline;
        let first = self.numbers(0, width, 0);
        same(first)
            && (0..self.times.len()).all(|k| {
                let flat = |part| self.numbers(k, width, part).iter().all(|&t| t == 0.0);
                self.numbers(k, width, 0) == first && (!spline || (flat(-1) && flat(1)))
            })
    }
}

/// Normalizes a quaternion; a zero quaternion stands for no rotation, as it does in nodes.
pub(super) fn unit(q: DVec4) -> DQuat {
    q.try_normalize().map_or(DQuat::IDENTITY, DQuat::from_vec4)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn sampler(interpolation: Interpolation, times: &[f32], values: &[f32]) -> Sampler {
        Sampler { interpolation, times: times.into(), values: values.to_vec() }
    }

    #[test]
    fn steps_and_lines_hold_their_ends() {
        let step = sampler(Interpolation::Step, &[1.0, 2.0, 4.0], &[1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 3.0, 6.0, 0.0]);
        let line = Sampler { interpolation: Interpolation::Linear, ..step.clone() };
        for (t, s, l) in [
            (-1.0, 1.0, 1.0),
            (1.0, 1.0, 1.0),
            (1.5, 1.0, 1.5),
            (2.0, 2.0, 2.0),
            (3.0, 2.0, 2.5),
            (4.0, 3.0, 3.0),
            (9.0, 3.0, 3.0),
        ] {
            assert_eq!((step.vector(t).x, line.vector(t).x), (s, l), "{t}");
        }
        assert_eq!(line.vector(2.5), DVec3::new(2.25, 1.5, 0.0));
        assert_eq!((line.end(), line.check(3), step.check(3)), (4.0, Ok(()), Ok(())));
    }

    /// The value by hand: keys at 1 and 3 s, values 2 and 5, tangents 1 (out) and -2 (in) a second;
    /// at 1.5 s, u = 1/4: (2/64 - 3/16 + 1) 2 + 2 (1/64 - 2/16 + 1/4) 1 + (-2/64 + 3/16) 5 + 2
    /// (1/64 - 1/16) (-2) = 1.6875 + 0.28125 + 0.78125 + 0.1875
    #[test]
    fn cubic_by_hand() {
        let s = sampler(Interpolation::CubicSpline, &[1.0, 3.0], &[9.0, 2.0, 1.0, -2.0, 5.0, 9.0]);
        assert_eq!(s.check(1), Ok(()));
        let at = |t| {
            let mut out = [0.0];
            s.weights(t, &mut out);
            out[0]
        };
        assert_eq!((at(0.0), at(1.0), at(3.0), at(4.0)), (2.0, 2.0, 5.0, 5.0));
        assert!((at(1.5) - 2.9375).abs() < 1e-15, "{}", at(1.5));
        // its slope at the keys is that of their tangents
        assert!(((at(1.0 + 1e-6) - 2.0) / 1e-6 - 1.0).abs() < 1e-4);
        assert!(((5.0 - at(3.0 - 1e-6)) / 1e-6 + 2.0).abs() < 1e-4);
    }

    #[test]
    fn rotations_turn_evenly_and_the_shorter_way() {
        let h = std::f32::consts::FRAC_1_SQRT_2;
        // a quarter turn about y, its end once written with the other sign
        for sign in [1.0, -1.0] {
            let s = sampler(Interpolation::Linear, &[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 0.0, sign * h, 0.0, sign * h]);
            for share in [0.0, 0.25, 1.0 / 3.0, 0.9, 1.0] {
                let truth = DQuat::from_rotation_y(FRAC_PI_2 * share);
                assert!(s.rotation(share).dot(truth).abs() > 1.0 - 1e-13, "{sign} {share}");
                assert!((s.rotation(share).length() - 1.0).abs() < 1e-14);
            }
        }
        // a spline without tangents: halfway it is the mean, brought to unit length
        let z = [0.0f32; 4];
        let spline = [z, [0.0, 0.0, 0.0, 1.0], z, z, [0.0, h, 0.0, h], z].concat();
        let s = sampler(Interpolation::CubicSpline, &[0.0, 2.0], &spline);
        assert!(s.rotation(1.0).dot(DQuat::from_rotation_y(FRAC_PI_2 * 0.5)) > 1.0 - 1e-13);
        let s = sampler(Interpolation::Step, &[0.0, 2.0], &[0.0, 3.0, 0.0, 3.0, 0.0, 0.0, 0.0, 0.0]);
        assert!(s.rotation(1.0).dot(DQuat::from_rotation_y(FRAC_PI_2)) > 1.0 - 1e-13);
        assert_eq!(s.rotation(2.0), DQuat::IDENTITY);
    }

    #[test]
    fn keys_at_one_time_are_a_jump() {
        let s = sampler(Interpolation::Linear, &[0.0, 1.0, 1.0, 1.0, 2.0], &[0.0, 4.0, 5.0, 6.0, 8.0]);
        assert_eq!(s.check(1), Ok(()));
        let at = |t| {
            let mut out = [0.0];
            s.weights(t, &mut out);
            out[0]
        };
        assert_eq!((at(0.5), at(1.0), at(1.5), at(2.0)), (2.0, 6.0, 7.0, 8.0));
        assert!((at(1.0 - 1e-9) - 4.0).abs() < 1e-6);
        // at the ends, too
        let s = sampler(Interpolation::Linear, &[0.0, 0.0, 1.0, 1.0], &[7.0, 1.0, 2.0, 9.0]);
        let at = |t| {
            let mut out = [0.0];
            s.weights(t, &mut out);
            out[0]
        };
        assert_eq!((at(0.0), at(0.5), at(1.0)), (1.0, 1.5, 9.0));
    }

    #[test]
    fn keys_are_repaired_and_it_is_said() {
        let mut good = sampler(Interpolation::Linear, &[0.0, 1.0], &[1.0, 2.0]);
        assert!(good.repair(1).is_empty());
        let mut bad = sampler(
            Interpolation::Step,
            &[2.0, f32::NAN, 0.0, 1.0, 1.0, 3.0],
            &[20.0, 20.5, 0.5, 0.0, 1.0, 1.5, 10.0, 10.5, 11.0, 11.5, f32::INFINITY, 0.0],
        );
        let said = bad.repair(2);
        assert_eq!(said.len(), 3, "{said:?}");
        assert_eq!(&bad.times[..], [0.0, 1.0, 1.0, 2.0]);
        // keys of one time stay in the file's order
        assert_eq!(bad.values, [1.0, 1.5, 10.0, 10.5, 11.0, 11.5, 20.0, 20.5]);
        assert_eq!(bad.check(2), Ok(()));
        let mut spline = sampler(Interpolation::CubicSpline, &[1.0, 0.0], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(spline.repair(1).len(), 1);
        assert_eq!(spline.values, [4.0, 5.0, 6.0, 1.0, 2.0, 3.0]);
        // values that belong to no key
        assert!(sampler(Interpolation::Linear, &[1.0, 0.0], &[1.0]).repair(1).is_empty());
    }

    #[test]
    fn what_is_wrong_is_said() {
        let check = |times: &[f32], values: &[f32]| sampler(Interpolation::Linear, times, values).check(1).unwrap_err();
        assert!(check(&[], &[]).contains("no keys"));
        assert!(check(&[0.0, f32::NAN], &[0.0, 0.0]).contains("time of key 1"));
        assert!(check(&[0.0, 1.0, 0.5], &[0.0; 3]).contains("key 2 (0.5 s) is before"));
        assert!(check(&[0.0, 1.0], &[0.0; 3]).contains("3 numbers for 2 keys of 1"));
        assert!(check(&[0.0, 1.0], &[0.0, f32::INFINITY]).contains("value of key 1"));
    }
}
