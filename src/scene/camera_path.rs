//! A camera over time: keyframes and their interpolation.

use glam::DVec3;

use super::Camera;

/// Interpolation between two keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Interpolation {
    /// A cubic through the keys, once continuously differentiable in time. No coordinate leaves the
    /// range of the two keys that it is between, so a camera that rests stays where it is (Fritsch
    /// and Butland 1984).
    #[default]
    Smooth,
    /// A straight line at constant speed.
    Linear,
}

/// A keyframe of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Key {
    /// Time in frames, which may be fractional.
    pub frame: f64,
    /// Position, in scene units.
    pub eye: DVec3,
    /// Point at the centre of the image, in scene units.
    pub target: DVec3,
    /// Up in the image; need not be perpendicular to the view, nor of unit length.
    pub up: DVec3,
    /// Full vertical field of view in radians, of 0.001 to 179 degrees.
    pub fov_y: f64,
    /// A cut: the camera stands still at the key before this one until this one's frame, and is
    /// here then.
    pub cut: bool,
}

/// A key without its frame, as numbers that are interpolated one by one: eye, target, up, field of
/// view.
type Pose = [f64; 10];

/// A perspective camera that moves from key to key, but for cuts. Each number is interpolated by
/// itself: keys must be near enough to each other that eye and target do not pass through one
/// another on the way, nor the view through up.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraPath {
    fps: f64,
    interpolation: Interpolation,
    keys: Vec<Key>,
    /// Derivative per frame at each key; empty when linear.
    slopes: Vec<Pose>,
}

impl CameraPath {
    /// A path through at least one key, in the order of their frames; `fps` is frames per second,
    /// in [0.001, 1000].
    ///
    /// # Errors
    /// A line that names the key and says what is wrong with it: frames that do not increase,
    /// numbers that are not finite (or beyond 1e30), an eye in its target, an up that is zero or
    /// along the view, a field of view out of range.
    pub fn new(keys: Vec<Key>, interpolation: Interpolation, fps: f64) -> Result<Self, String> {
        if !(0.001..=1000.0).contains(&fps) {
            return Err(format!("fps is {fps}; it must be between 0.001 and 1000"));
        }
        if keys.is_empty() {
            return Err("there are no keys; a path needs at least one".into());
        }
        for (k, key) in keys.iter().enumerate() {
            check(key, k.checked_sub(1).map(|before| keys[before].frame)).map_err(|e| format!("key {}: {e}", k + 1))?;
        }
        let slopes = match interpolation {
            // each shot is a path of its own
            Interpolation::Smooth => keys.chunk_by(|_, next| !next.cut).flat_map(slopes).collect(),
            Interpolation::Linear => Vec::new(),
        };
        Ok(Self { fps, interpolation, keys, slopes })
    }

    /// Keys of the path, in order.
    pub fn keys(&self) -> &[Key] {
        &self.keys
    }

    /// Frames per second.
    pub fn fps(&self) -> f64 {
        self.fps
    }

    /// Interpolation between keys.
    pub fn interpolation(&self) -> Interpolation {
        self.interpolation
    }

    /// Frames of the first and last key.
    pub fn range(&self) -> (f64, f64) {
        // there is at least one key
        (self.keys[0].frame, self.keys[self.keys.len() - 1].frame)
    }

    /// Returns true if there is a cut between two frames: after `before`, and at `frame` or
    /// earlier.
    pub fn has_cut(&self, before: f64, frame: f64) -> bool {
        // what precedes the first key is no other shot
        self.keys.iter().skip(1).any(|key| key.cut && before < key.frame && key.frame <= frame)
    }

    /// The camera at a frame, which may be fractional; before the first key and after the last it
    /// does not move.
    pub fn camera_at(&self, frame: f64) -> Camera {
        let Key { eye, target, up, fov_y, .. } = self.key_at(frame);
        Camera::look_at(eye, target, up, fov_y)
    }

    /// The interpolated key at a frame. The frame of a key gives that key exactly.
    pub fn key_at(&self, frame: f64) -> Key {
        let (first, last) = self.range();
        // NaN counts as the start
        let frame = if frame.is_nan() { first } else { frame.clamp(first, last) };
        let k = self.keys.partition_point(|key| key.frame <= frame).saturating_sub(1);
        let a = &self.keys[k];
        let cut = a.cut && frame == a.frame;
        let Some(b) = self.keys.get(k + 1).filter(|b| !b.cut) else { return Key { frame, cut, ..*a } };
        let span = b.frame - a.frame;
        let t = (frame - a.frame) / span;
        let (p, q) = (pose(a), pose(b));
        let between = |i: usize| match self.interpolation {
            Interpolation::Linear => p[i] + (q[i] - p[i]) * t,
            Interpolation::Smooth => {
                let (m, n) = (self.slopes[k][i] * span, self.slopes[k + 1][i] * span);
                let rest = 1.0 - t;
                p[i] + (q[i] - p[i]) * (t * t * (3.0 - 2.0 * t)) + t * rest * (rest * m - t * n)
            }
        };
        Key { cut, ..key(frame, &std::array::from_fn(between)) }
    }
}

fn pose(k: &Key) -> Pose {
    [k.eye.x, k.eye.y, k.eye.z, k.target.x, k.target.y, k.target.z, k.up.x, k.up.y, k.up.z, k.fov_y]
}

fn key(frame: f64, p: &Pose) -> Key {
    let vector = |k: usize| DVec3::new(p[k], p[k + 1], p[k + 2]);
    Key { frame, eye: vector(0), target: vector(3), up: vector(6), fov_y: p[9], cut: false }
}

/// Checks that a key defines a camera, and that it comes after the previous key.
fn check(key: &Key, frame_before: Option<f64>) -> Result<(), String> {
    const BEYOND: f64 = 1e30;
    if !(pose(key).iter().chain([&key.frame]).all(|v| v.abs() <= BEYOND)) {
        return Err("contains a number that is not finite, or beyond 1e30".into());
    }
    if let Some(before) = frame_before.filter(|before| *before >= key.frame) {
        return Err(format!(
            "frame {} does not come after frame {before} of the key before; frames must increase",
            key.frame
        ));
    }
    let degrees = key.fov_y.to_degrees();
    // the ends themselves are allowed whatever the conversion rounds them to
    if !(0.000_999_999..=179.000_001).contains(&degrees) {
        return Err(format!("a field of view of {degrees} degrees; it must be between 0.001 and 179"));
    }
    let Some(view) = (key.target - key.eye).try_normalize() else {
        return Err("eye and target are the same point; move one of them".into());
    };
    let Some(up) = key.up.try_normalize() else {
        return Err("up has no length; [0, 1, 0] is usual".into());
    };
    if up.cross(view).length() < 1e-9 {
        return Err("up lies along the view; choose another, such as [0, 0, -1] for a view from above".into());
    }
    Ok(())
}

/// The slope of every number at every key, of a piecewise cubic that stays monotone where the keys
/// are.
fn slopes(keys: &[Key]) -> Vec<Pose> {
    let poses: Vec<Pose> = keys.iter().map(pose).collect();
    let spans: Vec<f64> = keys.windows(2).map(|k| k[1].frame - k[0].frame).collect();
    let number = |i: usize| -> Vec<f64> {
        let chords: Vec<f64> = spans.iter().zip(poses.windows(2)).map(|(h, p)| (p[1][i] - p[0][i]) / h).collect();
        match chords.len() {
            0 => vec![0.0],
            1 => vec![chords[0]; 2],
            n => {
                let inner = (1..n).map(|k| inner_slope(spans[k - 1], spans[k], chords[k - 1], chords[k]));
                let first = end_slope(spans[0], spans[1], chords[0], chords[1]);
                let last = end_slope(spans[n - 1], spans[n - 2], chords[n - 1], chords[n - 2]);
                std::iter::once(first).chain(inner).chain([last]).collect()
            }
        }
    };
    let numbers: [Vec<f64>; 10] = std::array::from_fn(number);
    (0..keys.len()).map(|k| std::array::from_fn(|i| numbers[i][k])).collect()
}

/// A weighted harmonic mean of the chords' slopes; none where the direction changes.
fn inner_slope(h0: f64, h1: f64, d0: f64, d1: f64) -> f64 {
    if d0 * d1 <= 0.0 {
        return 0.0;
    }
    let (w0, w1) = (2.0 * h1 + h0, h1 + 2.0 * h0);
    (w0 + w1) / (w0 / d0 + w1 / d1)
}

/// The slope of a parabola through the three keys at an end, kept from overshooting. `h0` and `d0`
/// are nearest the end.
fn end_slope(h0: f64, h1: f64, d0: f64, d1: f64) -> f64 {
    let slope = ((2.0 * h0 + h1) * d0 - h0 * d1) / (h0 + h1);
    if slope * d0 <= 0.0 {
        0.0
    } else if d0 * d1 <= 0.0 && slope.abs() > 3.0 * d0.abs() {
        3.0 * d0
    } else {
        slope
    }
}
