//! The integrators that are made of paths: global illumination, direct light, the ground truth of
//! ambient occlusion, and views of surfaces.

use super::ambient::{Ambient, EnvironmentLight};
use super::report::{self, environment_text};
use super::{PathOptions, Strategy, TextureFilter, View, render, streams};
use crate::accel::features::Blend;
use crate::accel::flatten::FlatScene;
use crate::colour::srgb_decode;
use crate::error::Result;
use crate::film::Control;
use crate::integrators::{Integrator, IntegratorSettings, PictureOptions, RenderJob, Rendered};
use crate::output::{Image, Samples};
use crate::scene::Scene;
use crate::settings::Capability::{
    self, AmbientLight, AmbientOcclusion, CameraModel, Denoising, GlobalIllumination, LightTransport, PathLength,
    RealTimeFrames, SamplingStrategy, SceneLights, Textures, ToneMapping, WhiteSky,
};
use crate::shaders::StreamShaders;
use crate::tracer::{Needs, Tracer};

/// Path tracing.
pub static PATH: PathVariant = PathVariant {
    name: "path",
    help: "Path tracing: global illumination",
    kind: Kind::Light { max_depth: None },
    capabilities: &[
        LightTransport,
        GlobalIllumination,
        PathLength,
        SamplingStrategy,
        SceneLights,
        Textures,
        CameraModel,
        ToneMapping,
        Denoising,
        RealTimeFrames,
    ],
};
/// Paths of one bounce.
pub static DIRECT: PathVariant = PathVariant {
    name: "direct",
    help: "Direct lighting: paths of one bounce",
    kind: Kind::Light { max_depth: Some(1) },
    capabilities: &[
        LightTransport,
        SamplingStrategy,
        SceneLights,
        Textures,
        CameraModel,
        ToneMapping,
        Denoising,
        RealTimeFrames,
    ],
};
/// Direct light, and ambient light where ambient occlusion lets it through.
pub static LIT: PathVariant = PathVariant {
    name: "lit",
    help: "Direct lighting plus ambient light times ambient occlusion: what real-time renderers make of AO",
    kind: Kind::Lit,
    capabilities: &[
        LightTransport,
        SamplingStrategy,
        SceneLights,
        AmbientLight,
        AmbientOcclusion,
        Textures,
        CameraModel,
        ToneMapping,
        Denoising,
        RealTimeFrames,
    ],
};
/// Specular reflection and refraction, and direct lighting on all other surfaces.
pub static WHITTED: PathVariant = PathVariant {
    name: "whitted",
    help: "Whitted (1980): chains of mirrors and glass, direct light on everything else",
    kind: Kind::Whitted,
    capabilities: &[
        LightTransport,
        PathLength,
        SceneLights,
        Textures,
        CameraModel,
        ToneMapping,
        Denoising,
        RealTimeFrames,
    ],
};
/// The ground truth that ambient occlusion approximates.
pub static AO_SKY: PathVariant = PathVariant {
    name: "ao-sky",
    help: "Path traced grey diffuse surfaces under a white sky, divided by albedo: the ground truth that AO approximates",
    kind: Kind::WhiteSky,
    capabilities: &[
        LightTransport,
        PathLength,
        SamplingStrategy,
        WhiteSky,
        CameraModel,
        ToneMapping,
        Denoising,
        RealTimeFrames,
    ],
};
/// Shading normals.
pub static NORMALS: PathVariant = PathVariant {
    name: "normals",
    help: "Shading normals, in world space",
    kind: Kind::View(View::Normals),
    capabilities: &[Textures, CameraModel],
};
/// Base colours.
pub static ALBEDO: PathVariant = PathVariant {
    name: "albedo",
    help: "Base colours",
    kind: Kind::View(View::Albedo),
    capabilities: &[Textures, CameraModel, ToneMapping],
};
/// Distances.
pub static DEPTH: PathVariant = PathVariant {
    name: "depth",
    help: "Distance along camera rays",
    kind: Kind::View(View::Depth),
    capabilities: &[CameraModel],
};
/// Occlusion textures.
pub static BAKED_OCCLUSION: PathVariant = PathVariant {
    name: "baked-occlusion",
    help: "Baked occlusion textures",
    kind: Kind::View(View::BakedOcclusion),
    capabilities: &[Textures, CameraModel],
};

/// The quantity that an integrator computes.
enum Kind {
    /// Light, up to so many bounces; `None`: as many as settings say.
    Light { max_depth: Option<u32> },
    /// Light of one bounce, and ambient light.
    Lit,
    /// Radiance by delta lobes and light sampling only.
    Whitted,
    /// Radiance of grey surfaces under a white sky.
    WhiteSky,
    /// No light, but what camera rays see.
    View(View),
}

/// An integrator that traces paths.
pub struct PathVariant {
    name: &'static str,
    help: &'static str,
    kind: Kind,
    capabilities: &'static [Capability],
}

impl PathVariant {
    fn view(&self) -> Option<View> {
        if let Kind::View(view) = self.kind { Some(view) } else { None }
    }

    fn options(&self, job: &RenderJob) -> Result<PathOptions> {
        let options = PathOptions::new(job)?;
        Ok(match self.kind {
            Kind::Light { max_depth: Some(max_depth) } => PathOptions { max_depth, ..options },
            Kind::Light { max_depth: None } => options,
            Kind::Lit => PathOptions {
                max_depth: 1,
                ambient: Some(Ambient::new(job.settings)),
                background_only: job.settings.path.environment_light == Some(EnvironmentLight::Ambient),
                ..options
            },
            // only light sampling finds light on surfaces that scatter it
            Kind::Whitted => PathOptions { strategy: Strategy::Light, specular_only: true, ..options },
            Kind::WhiteSky => PathOptions { white_sky: Some(job.settings.path.sky_albedo()), ..options },
            Kind::View(view) => PathOptions { view: Some(view), ..options },
        })
    }
}

impl Integrator for PathVariant {
    fn name(&self) -> &'static str {
        self.name
    }

    fn help(&self) -> &'static str {
        self.help
    }

    fn capabilities(&self) -> &'static [Capability] {
        self.capabilities
    }

    fn channels(&self) -> &'static [&'static str] {
        &["R", "G", "B"]
    }

    fn quantity(&self) -> &'static str {
        match self.kind {
            Kind::View(_) => "value",
            Kind::Light { .. } | Kind::Lit | Kind::Whitted | Kind::WhiteSky => "radiance",
        }
    }

    fn blend(&self) -> Blend {
        Blend::Stochastic
    }

    fn needs(&self, settings: &IntegratorSettings) -> Needs {
        Needs {
            shading: true,
            white: matches!(self.kind, Kind::WhiteSky),
            compensation: settings.path.energy_compensation,
            baked_occlusion: self.view() == Some(View::BakedOcclusion),
            mip_levels: settings.path.texture_filter.unwrap_or_default() == TextureFilter::RayCone,
            ..Default::default()
        }
    }

    fn streams(&self, _: &IntegratorSettings) -> Vec<&'static StreamShaders> {
        streams().to_vec()
    }

    fn rays_per_sample(&self) -> u64 {
        6
    }

    /// Only if the environment is black, and no lens or wide filter sees beyond a pixel's area.
    fn skips_empty_tiles(&self, job: &RenderJob) -> bool {
        let is_white_sky = matches!(self.kind, Kind::WhiteSky);
        let black = !self.shows_environment(job.scene) || job.backdrop.hides_environment() && !is_white_sky;
        let settings = &job.settings.path;
        let is_pinhole = settings.f_number.is_none() || settings.focus_distance.is_none();
        black && is_pinhole && job.samples.pixel_filter.is_within_pixel()
    }

    fn shows_environment(&self, scene: &Scene) -> bool {
        match self.kind {
            Kind::View(_) => false,
            Kind::WhiteSky => true,
            Kind::Light { .. } | Kind::Lit | Kind::Whitted => scene.has_visible_sky(),
        }
    }

    fn sees_environment(&self) -> bool {
        matches!(self.kind, Kind::Light { .. } | Kind::Lit | Kind::Whitted)
    }

    fn identity(&self, job: &RenderJob) -> Vec<(&'static str, Option<String>)> {
        // invalid options are reported when the image is rendered
        let Ok(options) = self.options(job) else { return Vec::new() };
        let mut identity = vec![
            ("environment", Some(environment_text(job.scene, &options))),
            ("energy_compensation", job.settings.path.energy_compensation.then(|| "on".into())),
        ];
        identity.extend(options.identity());
        identity
    }

    fn render(
        &self,
        tracer: &Tracer,
        flat: &FlatScene,
        job: &RenderJob,
        control: &mut dyn Control,
    ) -> Result<Rendered> {
        let options = self.options(job)?;
        let result = render(tracer, flat, &job.camera_record(flat), &options, control)?;
        let report = report::report(tracer, flat, job, &options, &result);
        Ok(Rendered { image: result.image, report, ..Default::default() })
    }

    /// Tone maps radiance, maps normals from -1..1 to 0..1, divides depths by their maximum; what
    /// is baked is shown as what is traced.
    fn picture(&self, image: &Image, options: &PictureOptions) -> Image {
        let shown = |f: &dyn Fn(f32) -> f32| {
            let mut out = image.clone();
            out.channels.retain(|c| self.channels().contains(&c.name.as_str()));
            for channel in &mut out.channels {
                if let Samples::F32(values) = &mut channel.samples {
                    values.iter_mut().for_each(|v| *v = srgb_decode(f(*v)));
                }
            }
            out
        };
        match self.view() {
            Some(View::Normals) => shown(&|n| 0.5 * n + 0.5),
            Some(View::Depth) => {
                let greatest =
                    image.f32("R").map_or(0.0, |d| d.iter().copied().fold(0.0, f32::max)).max(f32::MIN_POSITIVE);
                shown(&|d| d / greatest)
            }
            // as ambient visibility that is traced
            Some(View::BakedOcclusion) => image.clone(),
            Some(View::Albedo) | None => options.tone_map.apply(image, options.exposure),
        }
    }

    fn path_options(&self, job: &RenderJob) -> Result<Option<PathOptions>> {
        self.options(job).map(Some)
    }
}
