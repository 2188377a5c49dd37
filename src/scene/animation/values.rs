//! Animated numbers of materials, lights and cameras, and the visibility of nodes: what glTF's
//! `KHR_animation_pointer` animates beside the transforms of nodes.

use glam::{Affine2, Mat2, Vec2, Vec3};

use super::{Interpolation, Sampler};
use crate::scene::material::AlphaMode;
use crate::scene::{Camera, Light, LightKind, Material, Projection};

/// Number of textures of a material.
pub const SLOTS: usize = 19;

/// A number or colour of a material that a channel animates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MaterialProperty {
    /// Linear base colour and alpha; four numbers.
    BaseColor,
    /// Metalness.
    Metallic,
    /// Perceptual roughness.
    Roughness,
    /// Scale of the normal map.
    NormalScale,
    /// Strength of the occlusion texture.
    OcclusionStrength,
    /// Emitted colour, which [`MaterialProperty::EmissiveStrength`] multiplies; three numbers.
    EmissiveFactor,
    /// Factor of the emitted colour.
    EmissiveStrength,
    /// Alpha below which a masked surface is not there.
    AlphaCutoff,
    /// Index of refraction.
    Ior,
    /// Strength of the clearcoat.
    Clearcoat,
    /// Roughness of the clearcoat.
    ClearcoatRoughness,
    /// Scale of the clearcoat's normal map.
    ClearcoatNormalScale,
    /// Colour of the sheen; three numbers.
    SheenColor,
    /// Roughness of the sheen.
    SheenRoughness,
    /// Fraction of light that is transmitted.
    Transmission,
    /// Thickness of the volume, in object units.
    Thickness,
    /// Colour of white light after the attenuation distance; three numbers.
    AttenuationColor,
    /// Attenuation distance, in scene units.
    AttenuationDistance,
    /// Strength of the specular reflection.
    Specular,
    /// Colour of the specular reflection; three numbers.
    SpecularColor,
    /// Strength of the anisotropy.
    AnisotropyStrength,
    /// Direction of the anisotropy, in radians.
    AnisotropyRotation,
    /// Strength of the thin film.
    Iridescence,
    /// Index of refraction of the thin film.
    IridescenceIor,
    /// Thickness of the thin film where its texture is 0, in nanometres.
    IridescenceThicknessMinimum,
    /// Thickness of the thin film where its texture is 1, in nanometres.
    IridescenceThicknessMaximum,
    /// Share of diffuse light that goes to the other side.
    DiffuseTransmission,
    /// Colour of diffuse transmission; three numbers.
    DiffuseTransmissionColor,
    /// Offset of the texture coordinates of a slot (an index into
    /// [`Material::texture_slots_mut`]); two numbers.
    TextureOffset(usize),
    /// Rotation of the texture coordinates of a slot, in radians.
    TextureRotation(usize),
    /// Scale of the texture coordinates of a slot; two numbers.
    TextureScale(usize),
}

/// Least and largest value of a share.
const SHARE: [f32; 2] = [0.0, 1.0];
/// Least and largest value of an amount.
const AMOUNT: [f32; 2] = [0.0, f32::MAX];
/// Least and largest value of a number without bounds.
const ANY: [f32; 2] = [f32::MIN, f32::MAX];

impl MaterialProperty {
    /// Number of components of a value.
    pub fn width(self) -> usize {
        match self {
            Self::BaseColor => 4,
            Self::EmissiveFactor
            | Self::SheenColor
            | Self::AttenuationColor
            | Self::SpecularColor
            | Self::DiffuseTransmissionColor => 3,
            Self::TextureOffset(_) | Self::TextureScale(_) => 2,
            _ => 1,
        }
    }

    /// Least and largest value, those of the loader.
    fn bounds(self) -> [f32; 2] {
        match self {
            Self::NormalScale
            | Self::ClearcoatNormalScale
            | Self::AnisotropyRotation
            | Self::TextureOffset(_)
            | Self::TextureRotation(_)
            | Self::TextureScale(_) => ANY,
            Self::EmissiveFactor
            | Self::EmissiveStrength
            | Self::AlphaCutoff
            | Self::Thickness
            | Self::AttenuationDistance
            | Self::SpecularColor
            | Self::IridescenceThicknessMinimum
            | Self::IridescenceThicknessMaximum => AMOUNT,
            Self::Ior | Self::IridescenceIor => [1.0, f32::MAX],
            _ => SHARE,
        }
    }

    /// Whether a small value makes shaders need more than a large one does.
    fn needs_most_where_small(self) -> bool {
        matches!(self, Self::Roughness | Self::AttenuationColor | Self::AttenuationDistance | Self::AlphaCutoff)
    }

    /// The numbers of the material that it stands for; `None` for those of which it is a factor
    /// only, and for a cutoff where nothing is masked.
    fn numbers(self, m: &mut Material) -> Option<&mut [f32]> {
        let single = std::slice::from_mut::<f32>;
        Some(match self {
            Self::BaseColor => m.base_color.as_mut(),
            Self::Metallic => single(&mut m.metallic),
            Self::Roughness => single(&mut m.roughness),
            Self::NormalScale => single(&mut m.normal_scale),
            Self::OcclusionStrength => single(&mut m.occlusion_strength),
            Self::AlphaCutoff => match &mut m.alpha_mode {
                AlphaMode::Mask { cutoff } => single(cutoff),
                AlphaMode::Opaque | AlphaMode::Blend => return None,
            },
            Self::Ior => single(&mut m.ior),
            Self::Clearcoat => single(&mut m.clearcoat.factor),
            Self::ClearcoatRoughness => single(&mut m.clearcoat.roughness),
            Self::ClearcoatNormalScale => single(&mut m.clearcoat.normal_scale),
            Self::SheenColor => m.sheen.color.as_mut(),
            Self::SheenRoughness => single(&mut m.sheen.roughness),
            Self::Transmission => single(&mut m.transmission.factor),
            Self::Thickness => single(&mut m.transmission.thickness),
            Self::AttenuationColor => m.transmission.attenuation_color.as_mut(),
            Self::AttenuationDistance => single(&mut m.transmission.attenuation_distance),
            Self::Specular => single(&mut m.specular.factor),
            Self::SpecularColor => m.specular.color.as_mut(),
            Self::AnisotropyStrength => single(&mut m.anisotropy.strength),
            Self::AnisotropyRotation => single(&mut m.anisotropy.rotation),
            Self::Iridescence => single(&mut m.iridescence.factor),
            Self::IridescenceIor => single(&mut m.iridescence.ior),
            Self::IridescenceThicknessMinimum => &mut m.iridescence.thickness[..1],
            Self::IridescenceThicknessMaximum => &mut m.iridescence.thickness[1..],
            Self::DiffuseTransmission => single(&mut m.diffuse_transmission.factor),
            Self::DiffuseTransmissionColor => m.diffuse_transmission.color.as_mut(),
            Self::EmissiveFactor
            | Self::EmissiveStrength
            | Self::TextureOffset(_)
            | Self::TextureRotation(_)
            | Self::TextureScale(_) => return None,
        })
    }
}

/// Offset, rotation and scale of texture coordinates (KHR_texture_transform).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureTransform {
    /// Added last.
    pub offset: Vec2,
    /// Counter-clockwise as seen in an image, in radians.
    pub rotation: f32,
    /// Applied first.
    pub scale: Vec2,
}

impl Default for TextureTransform {
    fn default() -> Self {
        Self { offset: Vec2::ZERO, rotation: 0.0, scale: Vec2::ONE }
    }
}

impl TextureTransform {
    /// `translation * rotation * scale` of the extension. Its rotation is counter-clockwise as seen
    /// in an image whose v points down, hence the signs.
    pub fn affine(&self) -> Affine2 {
        let (s, c) = self.rotation.sin_cos();
        let rotation = Mat2::from_cols(Vec2::new(c, -s), Vec2::new(s, c));
        Affine2::from_mat2_translation(rotation * Mat2::from_diagonal(self.scale), self.offset)
    }
}

/// A material that a channel may animate. Some numbers of a [`Material`] are products of several
/// that are animated apart: these are kept here as they are at rest.
#[derive(Clone, Debug, PartialEq)]
pub struct AnimatedMaterial {
    /// The material and copies of it, as indices into [`crate::scene::Scene::materials`].
    pub materials: Vec<usize>,
    /// Emitted colour without its strength.
    pub emissive_factor: Vec3,
    /// Factor of the emitted colour.
    pub emissive_strength: f32,
    /// Transforms of the texture coordinates of all slots.
    pub transforms: [TextureTransform; SLOTS],
}

impl AnimatedMaterial {
    /// A material at rest with these values in place of its own.
    pub(super) fn changed(&self, rest: &Material, values: &[(MaterialProperty, [f32; 4])]) -> Material {
        let mut material = rest.clone();
        let (mut factor, mut strength, mut transforms) =
            (self.emissive_factor, self.emissive_strength, self.transforms);
        let (mut emits, mut turned) = (false, [false; SLOTS]);
        for (property, value) in values {
            let [least, most] = property.bounds();
            // glTF's 0 is no index of refraction, but a word for a Fresnel term of 1
            let is_word = *property == MaterialProperty::Ior && value[0] == 0.0;
            let v = if is_word { *value } else { value.map(|v| v.clamp(least, most)) };
            match *property {
                MaterialProperty::EmissiveFactor => (emits, factor) = (true, Vec3::new(v[0], v[1], v[2])),
                MaterialProperty::EmissiveStrength => (emits, strength) = (true, v[0]),
                MaterialProperty::TextureOffset(slot) => {
                    (turned[slot], transforms[slot].offset) = (true, Vec2::new(v[0], v[1]));
                }
                MaterialProperty::TextureRotation(slot) => (turned[slot], transforms[slot].rotation) = (true, v[0]),
                MaterialProperty::TextureScale(slot) => {
                    (turned[slot], transforms[slot].scale) = (true, Vec2::new(v[0], v[1]));
                }
                // a distance of 0 is that of a material which does not absorb
                MaterialProperty::AttenuationDistance => {
                    material.transmission.attenuation_distance = if v[0] > 0.0 { v[0] } else { f32::INFINITY };
                }
                _ => {
                    if let Some(numbers) = property.numbers(&mut material) {
                        let width = numbers.len();
                        numbers.copy_from_slice(&v[..width]);
                    }
                }
            }
        }

        // what is made of several
        if emits {
            material.emissive = (factor * strength).min(Vec3::splat(f32::MAX));
        }
        for (slot, (transform, _)) in
            material.texture_slots_mut().into_iter().zip(transforms.iter().zip(turned)).filter(|(_, (_, t))| *t)
        {
            if let Some(slot) = slot {
                slot.transform = transform.affine();
            }
        }
        material
    }

    /// Materials that between them need all that the material needs while these values change in
    /// these ranges: shaders are compiled for them.
    pub(super) fn extremes(&self, rest: &Material, ranges: &[(MaterialProperty, [[f32; 4]; 2])]) -> [Material; 2] {
        let pick = |small: &dyn Fn(MaterialProperty) -> bool| {
            let values: Vec<_> = ranges.iter().map(|(p, [lo, hi])| (*p, if small(*p) { *lo } else { *hi })).collect();
            self.changed(rest, &values)
        };
        let most = pick(&MaterialProperty::needs_most_where_small);
        // thin walls where the thickness is 0, a thin alpha, and the lowest index of refraction
        let thin = pick(&|p| match p {
            MaterialProperty::Thickness | MaterialProperty::Ior | MaterialProperty::BaseColor => true,
            MaterialProperty::AlphaCutoff => false,
            other => other.needs_most_where_small(),
        });
        [most, thin]
    }
}

/// A number or colour of a light that a channel animates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LightProperty {
    /// Linear colour; three numbers.
    Color,
    /// Intensity, in the unit of the light's kind.
    Intensity,
    /// Distance beyond which it has no effect, in scene units.
    Range,
    /// Angle from a spot's axis to where it begins to fade, in radians.
    InnerConeAngle,
    /// Angle from a spot's axis to where it has faded, in radians.
    OuterConeAngle,
}

/// A light of a file that a channel may animate, with the numbers that a [`Light`] has the product
/// of.
#[derive(Clone, Debug, PartialEq)]
pub struct AnimatedLight {
    /// The lights that nodes carry of it, as indices into [`crate::scene::Scene::lights`].
    pub lights: Vec<usize>,
    /// Linear colour at rest.
    pub color: Vec3,
    /// Intensity at rest.
    pub intensity: f32,
}

impl AnimatedLight {
    /// A light at rest with these values in place of its own.
    pub(super) fn changed(&self, rest: &Light, values: &[(LightProperty, [f32; 4])]) -> Light {
        let mut light = rest.clone();
        let (mut color, mut intensity) = (self.color, self.intensity);
        for (property, v) in values {
            match property {
                LightProperty::Color => color = Vec3::new(v[0], v[1], v[2]).max(Vec3::ZERO),
                LightProperty::Intensity => intensity = v[0].max(0.0),
                LightProperty::Range => light.range = if v[0] > 0.0 { f64::from(v[0]) } else { f64::INFINITY },
                LightProperty::InnerConeAngle => {
                    if let LightKind::Spot { inner_angle, outer_angle } = &mut light.kind {
                        *inner_angle = v[0].clamp(0.0, *outer_angle);
                    }
                }
                LightProperty::OuterConeAngle => {
                    if let LightKind::Spot { inner_angle, outer_angle } = &mut light.kind {
                        *outer_angle = v[0].clamp(0.0, std::f32::consts::FRAC_PI_2);
                        *inner_angle = inner_angle.min(*outer_angle);
                    }
                }
            }
        }
        light.intensity = (color * intensity).min(Vec3::splat(f32::MAX));
        light
    }
}

/// A number of a camera that a channel animates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CameraProperty {
    /// Full vertical field of view of a perspective camera, in radians.
    FovY,
    /// Half the height of an orthographic camera's view, in scene units.
    HalfHeight,
    /// Distance of the near plane, in scene units.
    Near,
    /// Distance of the far plane, in scene units.
    Far,
}

impl CameraProperty {
    /// Gives a camera a value; one that no camera may have leaves it as it is.
    pub(super) fn set(self, camera: &mut Camera, value: f64) {
        match (self, &mut camera.projection) {
            (Self::FovY, Projection::Perspective { fov_y }) if value > 0.0 && value < std::f64::consts::PI => {
                *fov_y = value;
            }
            (Self::HalfHeight, Projection::Orthographic { half_height }) if value.abs() > 0.0 => {
                *half_height = value.abs();
            }
            (Self::Near, _) if value >= 0.0 && value < camera.clip.far => camera.clip.near = value,
            (Self::Far, _) if value > camera.clip.near => camera.clip.far = value,
            _ => {}
        }
    }
}

/// The target of a channel of values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Target {
    /// A property of a material, an index into [`super::RigParts::materials`].
    Material(usize, MaterialProperty),
    /// A property of a light, an index into [`super::RigParts::animated_lights`].
    Light(usize, LightProperty),
    /// A property of a camera, an index into [`super::RigParts::animated_cameras`].
    Camera(usize, CameraProperty),
    /// Whether a node, an index into [`super::RigParts::nodes`], and all below it are shown.
    Visibility(usize),
}

impl Target {
    /// Number of components of a value.
    pub fn width(self) -> usize {
        match self {
            Self::Material(_, property) => property.width(),
            Self::Light(_, LightProperty::Color) => 3,
            _ => 1,
        }
    }
}

/// The keyframes of a value that is no transform.
#[derive(Clone, Debug, PartialEq)]
pub struct ValueChannel {
    /// The animated value.
    pub target: Target,
    /// Values over time, in seconds.
    pub sampler: Sampler,
}

impl ValueChannel {
    /// The value at a time; what it does not have is 0.
    pub fn value(&self, seconds: f64) -> [f32; 4] {
        let (mut numbers, width) = ([0.0; 4], self.target.width());
        self.sampler.weights(seconds, &mut numbers[..width]);
        numbers.map(|x| x.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32)
    }

    /// The least and the largest value of each number at any time.
    pub(super) fn range(&self) -> [[f32; 4]; 2] {
        let width = self.target.width();
        let of_number = |i: usize| if i < width { self.sampler.range(width, i) } else { [0.0; 2] };
        let all: [[f32; 2]; 4] = std::array::from_fn(of_number);
        [all.map(|[lo, _]| lo), all.map(|[_, hi]| hi)]
    }
}

impl Sampler {
    /// Least and largest value of number `i` at any time. A spline stays between the control points
    /// of its Bezier curves.
    fn range(&self, width: usize, i: usize) -> [f32; 2] {
        let spline = self.interpolation == Interpolation::CubicSpline;
        let number = |key: usize, part: usize| {
            let at = if spline { 3 * key + part } else { key };
            self.values.get(at * width + i).copied().unwrap_or(0.0)
        };
        let mut range = [f32::INFINITY, f32::NEG_INFINITY];
        let mut include = |v: f32| range = [range[0].min(v), range[1].max(v)];
        for key in 0..self.times.len() {
            include(number(key, 1));
            if spline && key + 1 < self.times.len() {
                let third = (self.times[key + 1] - self.times[key]) / 3.0;
                include(number(key, 1) + third * number(key, 2));
                include(number(key + 1, 1) - third * number(key + 1, 0));
            }
        }
        range
    }
}
