//! What a scene's lights and a render's options ask of paths: what nobody asks for is not compiled. `ASKED` of shaders/path/asked.glsl.

use super::lights::Lights;
use super::{PathOptions, PixelFilter, Strategy, media};
use crate::gpu::Specialization;
use crate::scene::flatten::FlatScene;
use crate::tracer::shading;

const CHOICE: u32 = 256;
const MAP: u32 = 512;
pub(super) const LIGHT_SAMPLES: u32 = 1024;
const MIS: u32 = 2048;
const COSINE: u32 = 4096;
const UNIFORM: u32 = 8192;
const GREY: u32 = 16384;
const VIEW: u32 = 32768;
const CLAMP: u32 = 65536;
const LENS: u32 = 131_072;
const FILTER: u32 = 262_144;
const CONES: u32 = 524_288;
const DISKS: u32 = 1_048_576;
pub(super) const MEDIA: u32 = 2_097_152;
pub(super) const CLEAR_WALLS: u32 = 4_194_304;

/// All of them, in words; first the kinds of lights, in the order of [`Lights::kinds`].
pub const ASKED: [(u32, &str); 23] = [
    (1, "lights at points"),
    (2, "spots"),
    (4, "directional lights"),
    (8, "triangles that shine"),
    (16, "spheres that shine"),
    (32, "light from around"),
    (64, "a tree of lights"),
    (128, "rectangles that shine"),
    (CHOICE, "a choice among lights"),
    (MAP, "an image around"),
    (LIGHT_SAMPLES, "light samples"),
    (MIS, "MIS weights"),
    (COSINE, "cosine-distributed directions"),
    (UNIFORM, "even directions"),
    (GREY, "grey surfaces"),
    (VIEW, "a view without light"),
    (CLAMP, "a clamp of fireflies"),
    (LENS, "a lens"),
    (FILTER, "a pixel filter"),
    (CONES, "ray cones"),
    (DISKS, "directional lights that paths meet"),
    (MEDIA, "volumes within volumes"),
    (CLEAR_WALLS, "light straight through thin walls"),
];

/// What is asked for: bits of [`ASKED`]. `map`: the environment is an image; `cones`: textures are read over cones.
pub(super) fn asked(options: &PathOptions, flat: &FlatScene, lights: &Lights, map: bool, cones: bool) -> u32 {
    let plain = options.white_sky.is_some() || options.view.is_some();
    let drawn = options.strategy.draws_lights() && !lights.records.is_empty();
    let bits = [
        (CHOICE, drawn && lights.choices() > 1),
        (MAP, map),
        (LIGHT_SAMPLES, drawn),
        (MIS, drawn && options.strategy == Strategy::Mis),
        (COSINE, options.strategy == Strategy::Cosine),
        (UNIFORM, options.strategy == Strategy::Uniform),
        (GREY, options.white_sky.is_some()),
        (VIEW, options.view.is_some()),
        (CLAMP, options.firefly_clamp.is_finite()),
        (LENS, options.lens.is_some_and(|l| l.radius > 0.0)),
        (FILTER, options.pixel_filter != PixelFilter::Box),
        (CONES, cones),
        (DISKS, lights.has_disks),
        (MEDIA, !plain && media::matter(flat)),
        (CLEAR_WALLS, !plain && flat.scene.materials.iter().any(shading::has_clear_walls)),
    ];
    bits.iter().filter(|(_, asked)| *asked).map(|(bit, _)| bit).sum::<u32>() | if drawn { lights.kinds() } else { 0 }
}

/// What shaders get of it.
pub(super) fn constants(asked: u32) -> Specialization {
    Specialization::default().set(11, asked)
}
