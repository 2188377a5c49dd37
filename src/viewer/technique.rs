//! Techniques that a view can show: presets of real-time ambient occlusion and their buffers,
//! integrators of stills, and the truth of what is beside it.

use crate::integrators::backdrop::Backdrop;
use crate::integrators::{self, IntegratorName};
use crate::interface::ToneMap;
use crate::realtime::display::DisplayMode;
use crate::realtime::frame_settings::FrameSettings;
use crate::realtime::{FilterKind, Preset, Technique as AoTechnique};
use crate::renderer::RenderSettings;
use crate::sampling::Sequence;
use crate::scene::Ground;
use crate::settings::Capability;

/// Technique that a view shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Technique {
    /// Ambient occlusion in real time.
    Preset(Preset),
    /// Screen-space ambient occlusion in real time.
    Gtao,
    /// Light in real time.
    Frames(IntegratorName),
    /// A still, which converges while the camera rests.
    Still(IntegratorName),
    /// A buffer of real-time ambient occlusion.
    Buffer(DisplayMode),
    /// Ambient occlusion without filter, which converges while the camera rests: the truth of the
    /// real-time techniques.
    Converged,
}

/// Headings of the list of techniques.
pub const GROUPS: [&str; 5] =
    ["Ambient occlusion in real time", "Light in real time", "Converging images", "Buffers", "Research: Larsen (2019)"];

impl Technique {
    /// All of them, by [`GROUPS`].
    pub fn all() -> Vec<(usize, Self)> {
        let presets = [Preset::Fast, Preset::Balanced, Preset::Quality];
        let research = [Preset::Larsen, Preset::LarsenFixed].map(|preset| (4, Self::Preset(preset)));
        let stills = || integrators::ALL.iter().filter_map(|i| IntegratorName::find(i.name())).map(Self::Still);
        let buffers = DisplayMode::ALL.into_iter().filter(|m| *m != DisplayMode::Result);
        let realtime = presets.into_iter().map(Self::Preset).chain([Self::Gtao]).map(|t| (0, t));
        let converging =
            [Self::Converged].into_iter().chain(stills().filter(|t| !t.is_view_of_surfaces())).map(|t| (2, t));
        let light = stills().filter(|t| t.has_frames()).filter_map(|t| match t {
            Self::Still(integrator) => Some((1, Self::Frames(integrator))),
            _ => None,
        });
        // what frames have, and what only stills have: colours of materials
        let buffers = buffers.map(Self::Buffer).chain(stills().filter(|t| t.is_view_of_surfaces())).map(|t| (3, t));
        realtime.chain(light).chain(converging).chain(buffers).chain(research).collect()
    }

    /// Name in lists.
    pub fn label(self) -> String {
        let word = |text: &str| text.replace('-', " ");
        match self {
            Self::Preset(preset) => format!("AO {}", word(preset.name())),
            Self::Gtao => "GTAO (screen space)".into(),
            Self::Frames(integrator) => format!("{}, real time", word(integrator.name())),
            Self::Still(integrator) if integrator.can(Capability::AmbientVisibility) => "AO still".into(),
            Self::Still(integrator) if integrator.can(Capability::WhiteSky) => {
                format!("AO truth ({})", integrator.name())
            }
            Self::Still(integrator) if self.is_view_of_surfaces() && self.has_buffer() => {
                format!("{}, antialiased", word(integrator.name()))
            }
            Self::Still(integrator) => word(integrator.name()),
            Self::Buffer(mode) => word(mode.name()),
            Self::Converged => "AO converged".into(),
        }
    }

    /// Description in one line.
    pub fn help(self) -> &'static str {
        match self {
            Self::Preset(preset) => preset.help(),
            Self::Gtao => AoTechnique::Gtao.help(),
            Self::Still(integrator) | Self::Frames(integrator) => integrator.get().help(),
            Self::Buffer(mode) => mode.help(),
            Self::Converged => {
                "Every ray counts, no filter: what the real-time techniques approximate, with their radius and falloff"
            }
        }
    }

    /// Returns true for stills that show a property of surfaces rather than light or occlusion.
    fn is_view_of_surfaces(self) -> bool {
        let Self::Still(integrator) = self else { return false };
        !integrator.can(Capability::AmbientVisibility) && !integrator.can(Capability::LightTransport)
    }

    /// Returns true for views that are buffers of frames, too.
    fn has_buffer(self) -> bool {
        // `normals` is the buffer `normal`
        DisplayMode::ALL.iter().any(|mode| self.integrator().name().starts_with(mode.name()))
    }

    /// Returns true for images of the light of a scene, which a camera would see.
    pub fn is_seen_by_camera(self) -> bool {
        matches!(self, Self::Still(_) | Self::Frames(_)) && self.integrator().can(Capability::SceneLights)
    }

    /// Returns true for stills of light that can be frames in real time, too.
    fn has_frames(self) -> bool {
        let Self::Still(integrator) = self else { return false };
        integrator.can(Capability::LightTransport) && integrator.can(Capability::RealTimeFrames)
    }

    /// The technique that settings select: what the viewer shows first with them.
    pub fn of_settings(settings: &RenderSettings) -> Self {
        let preset = settings.frames.preset.unwrap_or(Preset::Balanced);
        let buffer = settings.frames.show.filter(|show| *show != DisplayMode::Result);
        match (settings.integrator, buffer) {
            (Some(integrator), _) if settings.realtime_setting().is_none() => Self::Still(integrator),
            (Some(integrator), None) if !integrator.can(Capability::AmbientVisibility) => Self::Frames(integrator),
            (_, Some(buffer)) => Self::Buffer(buffer),
            _ if settings.frames.technique == Some(AoTechnique::Gtao) => Self::Gtao,
            _ => Self::Preset(preset),
        }
    }

    /// The integrator of its values; of a buffer it is that of the ambient occlusion behind it.
    pub fn integrator(self) -> IntegratorName {
        match self {
            Self::Still(integrator) | Self::Frames(integrator) => integrator,
            Self::Preset(_) | Self::Gtao | Self::Buffer(_) | Self::Converged => IntegratorName::default(),
        }
    }

    /// Returns what it estimates: the truth that it is compared with unless another is chosen.
    pub fn truth(self) -> Self {
        let integrator = self.integrator();
        if integrator.can(Capability::AmbientVisibility) { Self::Converged } else { Self::Still(integrator) }
    }

    /// Settings of an image of it: those of `base` that apply to it.
    pub fn settings(self, base: &RenderSettings) -> RenderSettings {
        let mut settings = RenderSettings {
            camera: Default::default(),
            lighting: Default::default(),
            film: Default::default(),
            ..base.clone()
        };

        // size, samples and time are the window's affair
        (settings.image.size, settings.image.spp, settings.image.time_limit) = (None, None, None);
        settings.integrator = None;

        // what moves is the viewer's affair
        let own = FrameSettings {
            frames: None,
            fps: None,
            animate: None,
            time: None,
            camera_path: None,
            orbit: None,
            warm_up: None,
            lead_in: None,
            show: None,
            ..base.frames.clone()
        };

        // each technique decides what its name says, and leaves the rest to the user
        settings.frames = match self {
            Self::Preset(preset @ Preset::Larsen) => {
                FrameSettings { preset: Some(preset), primary: own.primary, ..Default::default() }
            }
            Self::Preset(preset) => FrameSettings { preset: Some(preset), technique: None, ..own },
            Self::Gtao => {
                let preset = own.preset.filter(|p| *p != Preset::Larsen).unwrap_or_default();
                FrameSettings { preset: Some(preset), technique: Some(AoTechnique::Gtao), ..own }
            }
            Self::Buffer(mode) => {
                let preset = own.preset.filter(|p| *p != Preset::Larsen).unwrap_or_default();
                FrameSettings { preset: Some(preset), technique: None, show: Some(mode), ..own }
            }
            Self::Converged => FrameSettings {
                preset: Some(Preset::Balanced),
                primary: own.primary,
                rays_per_pixel: Some(4),
                history: Some(512),
                filter: Some(FilterKind::None),
                sequence: Some(Sequence::Sobol),
                ..Default::default()
            },
            Self::Frames(integrator) => {
                settings.integrator = Some(integrator);
                let preset =
                    own.preset.filter(|p| !matches!(p, Preset::Larsen | Preset::Reference)).unwrap_or_default();
                FrameSettings { preset: Some(preset), technique: None, primary: None, ..own }
            }
            Self::Still(integrator) => {
                settings.integrator = Some(integrator);
                FrameSettings::default()
            }
        };
        // bright light keeps its colour, as in a photograph
        if self.is_seen_by_camera() {
            settings.picture.tone_map.get_or_insert(ToneMap::Agx);
        }
        settings.clear_unused();
        settings.image.background =
            settings.image.background.filter(|b| b.hides_environment() || self.sees_environment());
        if settings.image.ground == Some(Ground::Catcher) && !self.catches_shadows() {
            settings.image.ground = Some(Ground::Plane);
        }
        settings
    }

    /// Whether its images may show an environment.
    fn sees_environment(self) -> bool {
        matches!(self, Self::Frames(integrator) | Self::Still(integrator) if integrator.get().sees_environment())
    }

    /// Whether its images are on black with this background: ambient occlusion has no environment.
    pub fn is_on_black(self, background: Backdrop) -> bool {
        self.integrator().can(Capability::AmbientVisibility) && !background.hides_environment()
    }

    /// Whether its images can show what a ground catches, and not only a plane: those of light and
    /// of ambient occlusion, but for Larsen's pipeline.
    pub fn catches_shadows(self) -> bool {
        let integrator = self.integrator();
        let is_caught = integrator.can(Capability::LightTransport) || integrator.can(Capability::AmbientVisibility);
        is_caught && self != Self::Preset(Preset::Larsen)
    }
}
