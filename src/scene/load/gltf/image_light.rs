//! `EXT_lights_image_based`: the environment of a scene.
//!
//! Its cube map has levels for rough surfaces, which a renderer that samples light has no use for:
//! the first one is the environment. Where it cannot be read, the irradiance coefficients stand in
//! for it: the environment is the one of second order that brings this irradiance, and 0 where that
//! would be negative.
//!
//! <https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Vendor/EXT_lights_image_based>

use std::f64::consts::PI;
use std::path::Path;

use glam::{DMat3, DQuat, DVec3, Vec3};
use serde::Deserialize;

use super::accessor::Reader;
use super::material::UnmodelledExtension;
use super::texture;
use crate::scene::load::environment;
use crate::scene::load::options::Loading;
use crate::scene::{Environment, EnvironmentMap, Scene};

/// Size of a map of spherical harmonics, which are smooth.
const HARMONICS_SIZE: [u32; 2] = [128, 64];

#[derive(Deserialize, Default)]
#[serde(default)]
struct Lights {
    lights: Vec<ImageLight>,
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
struct ImageLight {
    name: String,
    rotation: Option<[f64; 4]>,
    intensity: Option<f64>,
    irradiance_coefficients: Vec<[f64; 3]>,
    specular_images: Vec<Vec<usize>>,
}

impl UnmodelledExtension for Lights {
    const NAME: &str = "EXT_lights_image_based";
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Chosen {
    light: Option<usize>,
}

impl UnmodelledExtension for Chosen {
    const NAME: &str = "EXT_lights_image_based";
}

/// Gives the scene the environment that scene `chosen` of the file has, if any. What is wrong with
/// it is a warning: the scene is there without it.
pub(super) fn apply(
    reader: &Reader,
    path: &Path,
    chosen: Option<usize>,
    loading: Loading,
    scene: &mut Scene,
    warn: &mut dyn FnMut(String),
) {
    let document = reader.document;
    let extensions = chosen.and_then(|s| document.scenes.get(s)?.extensions.as_ref()).map(|e| &e.others);
    let light = Chosen::from_extensions(extensions).and_then(|chosen| {
        let Some(index) = chosen.light else { return Ok(None) };
        let all = Lights::from_extensions(document.extensions.as_ref().map(|e| &e.others))?.lights;
        let count = all.len();
        let light = all.into_iter().nth(index);
        light.map(Some).ok_or_else(|| format!("{}: light {index} does not exist (the file has {count})", Lights::NAME))
    });
    let light = match light {
        Ok(Some(light)) => light,
        Ok(None) => return,
        Err(e) => return warn(format!("{e}: ignored")),
    };
    if !loading.options.textures {
        scene.report.skipped_images += light.specular_images.first().map_or(0, Vec::len);
        return;
    }

    // the cube, or else the coefficients
    let map = cube(reader, path, loading, &light).or_else(|e| {
        let harmonics = harmonics(&light)?;
        warn(format!("{}: {e}: its irradiance coefficients are the environment", Lights::NAME));
        Ok::<_, String>(harmonics)
    });
    let mut map = match map {
        Ok(map) => map,
        Err(e) => return warn(format!("{}: {e}: ignored", Lights::NAME)),
    };
    let intensity = light.intensity.unwrap_or(1.0) as f32;
    if !(intensity.is_finite() && intensity >= 0.0) {
        return warn(format!("{}: an intensity of {intensity}: ignored", Lights::NAME));
    }
    map.factor = Vec3::splat(intensity);
    let rotation = light.rotation.map_or(DQuat::IDENTITY, DQuat::from_array);
    let turned = Some(rotation).filter(|q| q.is_finite() && q.length_squared() > 1e-30);
    map.to_map = DMat3::from_quat(turned.map_or(DQuat::IDENTITY, DQuat::normalize).inverse());
    scene.environment = Environment::Map(map);
}

/// The map of the first level of the cube.
///
/// # Errors
/// What is wrong, in words.
fn cube(reader: &Reader, path: &Path, loading: Loading, light: &ImageLight) -> Result<EnvironmentMap, String> {
    let faces = light.specular_images.first().ok_or("has no specular images")?;
    let faces: [usize; 6] =
        faces[..].try_into().map_err(|_| format!("its first level has {} images, not 6", faces.len()))?;
    let mut side = None;
    let mut read = |index: usize| {
        let image = texture::image(reader, path, loading, index).map_err(|e| format!("image {index} {e}"))?;
        let size = [image.width, image.height];
        if size[0] != size[1] || side.is_some_and(|side| side != size[0]) {
            return Err(format!("image {index} is {}x{}: all must be square and of one size", size[0], size[1]));
        }
        side = Some(size[0]);
        // integers are sRGB, and alpha divides them (RGBD) where there is some
        let texel = |i: usize| {
            let [r, g, b, alpha] = image.texels.decode_srgb(i);
            if alpha > 0.0 { Vec3::new(r, g, b) / alpha } else { Vec3::ZERO }
        };
        Ok((0..image.texels.len()).map(texel).collect::<Vec<Vec3>>())
    };
    let mut pixels = [const { Vec::new() }; 6];
    for (pixels, index) in pixels.iter_mut().zip(faces) {
        *pixels = read(index)?;
    }
    environment::of_faces(&light.name, side.unwrap_or(1), pixels, loading.budget)
}

/// The map of second order that brings the irradiance of the coefficients: those of each band
/// divided by what the cosine makes of it (Ramamoorthi, Hanrahan 2001).
///
/// # Errors
/// What is wrong, in words.
fn harmonics(light: &ImageLight) -> Result<EnvironmentMap, String> {
    let all = &light.irradiance_coefficients;
    let all: &[[f64; 3]; 9] =
        all[..].try_into().map_err(|_| format!("has {} irradiance coefficients, not 9", all.len()))?;
    if !all.iter().flatten().all(|c| c.is_finite()) {
        return Err("has irradiance coefficients that are not finite".to_owned());
    }
    let [width, height] = HARMONICS_SIZE;
    let texel = |k: u32| {
        // -z is in the middle, +x to the right of it, +y at the top
        let phi = 2.0 * PI * ((f64::from(k % width) + 0.5) / f64::from(width) - 0.5);
        let theta = PI * (f64::from(k / width) + 0.5) / f64::from(height);
        let d = DVec3::new(theta.sin() * phi.sin(), theta.cos(), -theta.sin() * phi.cos());
        let radiance: DVec3 = all.iter().zip(basis(d)).map(|(c, y)| DVec3::from_array(*c) * y).sum();
        radiance.max(DVec3::ZERO).as_vec3().min(Vec3::splat(f32::MAX))
    };
    let radiance = (0..width * height).map(texel).collect();
    Ok(EnvironmentMap::new(&light.name, [width, height], radiance))
}

/// The nine real spherical harmonics up to the second band, each over the factor by which the
/// cosine makes irradiance of its radiance: pi, 2 pi / 3 and pi / 4.
fn basis(d: DVec3) -> [f64; 9] {
    let [first, second, third] = [1.0 / PI, 1.5 / PI, 4.0 / PI];
    let constant = 0.5 * (1.0 / PI).sqrt() * first;
    let linear = 0.5 * (3.0 / PI).sqrt() * second;
    let product = 0.5 * (15.0 / PI).sqrt() * third;
    [
        constant,
        linear * d.y,
        linear * d.z,
        linear * d.x,
        product * d.x * d.y,
        product * d.y * d.z,
        0.25 * (5.0 / PI).sqrt() * third * (3.0 * d.z * d.z - 1.0),
        product * d.x * d.z,
        0.5 * product * (d.x * d.x - d.y * d.y),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The coefficients of a linear environment, 1 + d.x / 2 in red and 1 + d.z / 2 in green, are
    /// known.
    #[test]
    fn harmonics_bring_back_the_radiance() {
        let mut coefficients = vec![[0.0; 3]; 9];
        // the integral of the radiance times each harmonic, times the factor of its band
        coefficients[0] = [2.0 * PI.sqrt() * PI; 3];
        let linear = 0.5 * (4.0 * PI / 3.0).sqrt() * (2.0 * PI / 3.0);
        (coefficients[3][0], coefficients[2][1]) = (linear, linear);
        let light = ImageLight { irradiance_coefficients: coefficients, ..ImageLight::default() };
        let map = harmonics(&light).unwrap();
        let at = |x: u32, y: u32| map.radiance[(y * map.width + x) as usize];
        // a quarter to the right of the middle is +x, the middle is -z
        assert!((at(96, 32) - Vec3::new(1.5, 1.0, 1.0)).abs().max_element() < 0.02, "{}", at(96, 32));
        assert!((at(64, 32) - Vec3::new(1.0, 0.5, 1.0)).abs().max_element() < 0.02, "{}", at(64, 32));
        assert!(harmonics(&ImageLight::default()).unwrap_err().contains("0 irradiance coefficients"));
    }

    #[test]
    fn second_order_harmonics_are_orthonormal() {
        // over a grid of directions, each weighted by its solid angle
        let n = 200;
        let mut sums = [[0.0; 9]; 9];
        let bands = [PI, 2.0 * PI / 3.0, PI / 4.0];
        let factor = |k: usize| bands[[0, 1, 1, 1, 2, 2, 2, 2, 2][k]];
        for i in 0..n {
            let z = 2.0 * (f64::from(i) + 0.5) / f64::from(n) - 1.0;
            for j in 0..n {
                let phi = 2.0 * PI * (f64::from(j) + 0.5) / f64::from(n);
                let r = (1.0 - z * z).sqrt();
                let y = basis(DVec3::new(r * phi.cos(), r * phi.sin(), z));
                for (a, row) in sums.iter_mut().enumerate() {
                    for (b, sum) in row.iter_mut().enumerate() {
                        *sum += y[a] * factor(a) * y[b] * factor(b) * 4.0 * PI / f64::from(n * n);
                    }
                }
            }
        }
        for (a, row) in sums.iter().enumerate() {
            for (b, sum) in row.iter().enumerate() {
                assert!((sum - f64::from(u8::from(a == b))).abs() < 1e-3, "{a} {b}: {sum}");
            }
        }
    }
}
