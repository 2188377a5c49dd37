//! Cube maps of six images, resampled to the equirectangular projection of environment maps.

use std::f64::consts::PI;
use std::path::Path;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{MAX_SIDE, Pixels};
use crate::error::{Error, Result};
use crate::memory::Budget;

/// File names of the faces, without extension: the axes through their centres.
const FACES: [&str; 6] = ["px", "nx", "py", "ny", "pz", "nz"];
const EXTENSIONS: [&str; 6] = ["hdr", "exr", "png", "jpg", "jpeg", "webp"];
/// Number of samples per texel along each axis.
const POINTS: u32 = 3;

/// Reads the faces that lie in a folder; a texel of the result is about as large as one of theirs.
pub(super) fn read(folder: &Path, budget: &Budget) -> Result<Pixels> {
    let faces = FACES.map(|name| face(folder, name, budget));
    let faces: Vec<Pixels> = faces.into_iter().collect::<Result<_>>()?;
    let side = faces[0].width;
    if let Some(k) = faces.iter().position(|f| f.width != side || f.height != side) {
        let (w, h) = (faces[k].width, faces[k].height);
        return Err(Error::input(
            folder,
            format!("face {} is {w}x{h}, not {side}x{side}: all faces must be square and of one size", FACES[k]),
        ));
    }
    let mut pixels = resample(&faces);
    let warnings: Vec<String> = faces.into_iter().filter_map(|f| f.warning).collect();
    pixels.warning = (!warnings.is_empty()).then(|| warnings.join("; "));
    Ok(pixels)
}

/// Resamples six square faces of one size.
pub(super) fn resample(faces: &[Pixels]) -> Pixels {
    let side = faces[0].width;
    let (width, height) = ((4 * side).min(MAX_SIDE), (2 * side).min(MAX_SIDE / 2));
    let radiance =
        (0..width * height).into_par_iter().with_min_len(4096).map(|k| texel(faces, [width, height], k)).collect();
    Pixels { width, height, radiance, warning: None }
}

fn face(folder: &Path, name: &str, budget: &Budget) -> Result<Pixels> {
    let candidates = EXTENSIONS.map(|e| folder.join(name).with_extension(e));
    let Some(path) = candidates.iter().find(|p| p.is_file()) else {
        let all = FACES.join(", ");
        return Err(Error::input(
            folder,
            format!("has no face {name} (.hdr, .exr, .png, .jpg, .webp): a cube has {all}"),
        ));
    };
    super::read(path, budget)
}

fn texel(faces: &[Pixels], [width, height]: [u32; 2], k: u32) -> Vec3 {
    let (x, y) = (k % width, k / width);
    let mut sum = Vec3::ZERO;
    for p in 0..POINTS * POINTS {
        let at = |pixel: u32, point: u32, n: u32| {
            (f64::from(pixel) + (f64::from(point) + 0.5) / f64::from(POINTS)) / f64::from(n)
        };
        // from the upper left corner; -z is in the middle, +x to the right of it
        // (shaders/path/map.glsl)
        let (phi, theta) = (2.0 * PI * (at(x, p % POINTS, width) - 0.5), PI * at(y, p / POINTS, height));
        sum += look_up(faces, DVec3::new(theta.sin() * phi.sin(), theta.cos(), -theta.sin() * phi.cos()));
    }
    sum / (POINTS * POINTS) as f32
}

/// Samples the cube map with OpenGL's face orientation (OpenGL 4.6, table 8.19), bilinearly within
/// a face.
fn look_up(faces: &[Pixels], d: DVec3) -> Vec3 {
    let a = d.abs();
    let (face, s, t, m) = if a.x >= a.y && a.x >= a.z {
        if d.x > 0.0 { (0, -d.z, -d.y, a.x) } else { (1, d.z, -d.y, a.x) }
    } else if a.y >= a.z {
        if d.y > 0.0 { (2, d.x, d.z, a.y) } else { (3, d.x, -d.z, a.y) }
    } else if d.z > 0.0 {
        (4, d.x, -d.y, a.z)
    } else {
        (5, -d.x, -d.y, a.z)
    };
    let pixels = &faces[face];
    let last = pixels.width - 1;
    let texel = |x: f64| {
        let p = ((x / m + 1.0) * 0.5 * f64::from(pixels.width) - 0.5).clamp(0.0, f64::from(last));
        let low = (p as u32).min(last);
        (low, (low + 1).min(last), (p - f64::from(low)) as f32)
    };
    let ((x0, x1, fx), (y0, y1, fy)) = (texel(s), texel(t));
    let at = |x: u32, y: u32| pixels.radiance[(y * pixels.width + x) as usize];
    at(x0, y0).lerp(at(x1, y0), fx).lerp(at(x0, y1).lerp(at(x1, y1), fx), fy)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Faces of one colour each: every direction sees the face that it points at.
    #[test]
    fn directions_find_their_faces() {
        let faces: Vec<Pixels> = (0..6)
            .map(|k| Pixels { width: 4, height: 4, radiance: vec![Vec3::splat(k as f32); 16].into(), warning: None })
            .collect();
        let axes = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
        for (k, axis) in axes.into_iter().enumerate() {
            assert_eq!(look_up(&faces, (axis + DVec3::new(0.1, 0.2, -0.15)).normalize()).x, k as f32);
        }
        // a texel in the middle of the image looks along -z, one a quarter to the right of it along
        // +x
        let [w, h] = [64, 32];
        assert_eq!(texel(&faces, [w, h], 16 * w + 32).x, 5.0);
        assert_eq!(texel(&faces, [w, h], 16 * w + 48).x, 0.0);
        assert_eq!(texel(&faces, [w, h], 32).x, 2.0);
    }

    /// The upper left texel of four faces.
    #[test]
    fn faces_are_the_right_way_round() {
        let mut radiance = vec![Vec3::ZERO; 16];
        radiance[0] = Vec3::ONE;
        let faces: Vec<Pixels> =
            (0..6).map(|_| Pixels { width: 4, height: 4, radiance: radiance.clone().into(), warning: None }).collect();
        assert_eq!(look_up(&faces, DVec3::new(0.9, 0.9, -1.0)).x, 1.0);
        assert_eq!(look_up(&faces, DVec3::new(-0.9, 0.9, 1.0)).x, 1.0);
        assert_eq!(look_up(&faces, DVec3::new(1.0, 0.9, 0.9)).x, 1.0);
        assert_eq!(look_up(&faces, DVec3::new(-0.9, 1.0, -0.9)).x, 1.0);
    }
}
