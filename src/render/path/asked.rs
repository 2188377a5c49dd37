//! What a scene's lights and a render's options ask of paths: what nobody asks for is not compiled. `ASKED` of shaders/path/asked.glsl.

use super::lights::Lights;
use super::{PathOptions, PixelFilter, Strategy};
use crate::gpu::Specialization;

const CHOICE: u32 = 128;
const MAP: u32 = 256;
const LIGHT_SAMPLES: u32 = 512;
const MIS: u32 = 1024;
const COSINE: u32 = 2048;
const UNIFORM: u32 = 4096;
const GREY: u32 = 8192;
const VIEW: u32 = 16384;
const CLAMP: u32 = 32768;
const LENS: u32 = 65536;
const FILTER: u32 = 131_072;
const CONES: u32 = 262_144;

/// All of them, in words; first the kinds of lights, in the order of [`Lights::kinds`].
pub const ASKED: [(u32, &str); 19] = [
    (1, "lights at points"),
    (2, "spots"),
    (4, "directional lights"),
    (8, "triangles that shine"),
    (16, "spheres that shine"),
    (32, "light from around"),
    (64, "a tree of lights"),
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
];

/// What is asked for: bits of [`ASKED`]. `map`: the environment is an image; `cones`: textures are read over cones.
pub(super) fn asked(options: &PathOptions, lights: &Lights, map: bool, cones: bool) -> u32 {
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
    ];
    bits.iter().filter(|(_, asked)| *asked).map(|(bit, _)| bit).sum::<u32>() | if drawn { lights.kinds() } else { 0 }
}

/// What shaders get of it.
pub(super) fn constants(asked: u32) -> Specialization {
    Specialization::default().set(11, asked)
}
