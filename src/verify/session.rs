//! The device that frames are rendered on, and the renderer of the last one.

use std::path::PathBuf;
use std::sync::Arc;

use super::baked::{self, BakedFrame};
use super::golden::Golden;
use super::manifest::{Frame, Manifest, Tracers};
use crate::error::{Error, Result};
use crate::film::Control;
use crate::gpu::{Device, DeviceInfo, Options};
use crate::output::Image;
use crate::renderer::Renderer;
use crate::scene::load::{self, Confine, GeometryOptions};
use crate::tracer::{DeviceSettings, TracerChoice, TracerKind};

/// Compiled pipelines kept from scene to scene: most of what small images cost on a CPU driver.
const KEPT_PIPELINES: usize = 64;

/// An open device, and the renderer of the last frame, which the next one reuses.
pub struct VerifySession<'m> {
    manifest: &'m Manifest,
    device: Arc<Device>,
    settings: DeviceSettings,
    open: Option<OpenRenderer>,
}

struct OpenRenderer {
    scene: String,
    gltf_scene: Option<String>,
    geometry: GeometryOptions,
    kind: TracerKind,
    renderer: Renderer,
}

impl<'m> VerifySession<'m> {
    pub fn open(manifest: &'m Manifest, settings: &DeviceSettings) -> Result<Self> {
        settings.check()?;
        let device = Device::open(&Options { keep_pipelines: KEPT_PIPELINES, ..settings.options() })?;
        Ok(Self { manifest, device, settings: settings.clone(), open: None })
    }

    pub fn info(&self) -> &DeviceInfo {
        &self.device.info
    }

    /// The tracers for a frame, each with whether the device supports it.
    pub fn tracers(&self, tracers: &Tracers) -> Vec<(TracerKind, bool)> {
        let supports = |kind: TracerKind| kind.is_supported_by(&self.device.info);
        match tracers {
            Tracers::Auto => vec![(TracerKind::auto(&self.device.info).0, true)],
            Tracers::All => TracerKind::ALL.into_iter().filter(|k| supports(*k)).map(|k| (k, true)).collect(),
            Tracers::Some(kinds) => kinds.iter().map(|&k| (k, supports(k))).collect(),
        }
    }

    /// Renders a frame: a still, or the last of its frames in real time. `seed`: one in place of
    /// its own. What was chosen for `golden` (camera, AO radius, light) is not chosen anew, so that
    /// a scene which has moved makes another image.
    pub fn render(
        &mut self,
        frame: &Frame,
        kind: TracerKind,
        seed: Option<u32>,
        golden: Option<&Golden>,
        control: &mut dyn Control,
    ) -> Result<Image> {
        if let Some(baked) = self.manifest.baked(frame) {
            return self.bake(frame, kind, baked, seed, golden, control);
        }
        let mut settings = self.manifest.settings(frame);
        settings.image.seed = seed.or(settings.image.seed);
        let renderer = self.renderer(frame, kind)?;
        if let Some(golden) = golden {
            golden.freeze(&mut settings, !renderer.scene().cameras.is_empty())?;
        }
        let image = renderer.image(&settings, control);
        if image.is_err() {
            // what it left half-made is not used again
            self.open = None;
        }
        image
    }

    /// Bakes the map that a frame is.
    fn bake(
        &mut self,
        frame: &Frame,
        kind: TracerKind,
        BakedFrame { mut options, .. }: BakedFrame,
        seed: Option<u32>,
        golden: Option<&Golden>,
        control: &mut dyn Control,
    ) -> Result<Image> {
        options.seed = seed.unwrap_or(options.seed);
        // without the lights of the frame before
        self.open = None;
        let tracing = DeviceSettings { tracer: Some(choice(kind)), ..self.settings.clone() };
        let renderer = self.renderer(frame, kind)?;
        baked::bake(renderer, &tracing, &options, golden.map(|golden| &golden.image), control)
    }

    pub fn load(&mut self, frame: &Frame, kind: TracerKind) -> Result<()> {
        self.renderer(frame, kind).map(drop)
    }

    fn renderer(&mut self, frame: &Frame, kind: TracerKind) -> Result<&mut Renderer> {
        let confine = self.manifest.confine.as_deref().map_or(Confine::Nowhere, Confine::Folder);
        let is_scene = |open: &OpenRenderer| {
            open.scene == frame.scene && open.gltf_scene == frame.gltf_scene && open.geometry == frame.geometry
        };
        let open = match self.open.take() {
            Some(open) if is_scene(&open) && open.kind == kind => open,
            before => {
                let scene = match before {
                    Some(open) if is_scene(&open) => open.renderer.into_scene(),
                    _ => load::load_with(&self.manifest.scene(frame), &frame.load_options(confine))?,
                };
                let settings = DeviceSettings { tracer: Some(choice(kind)), ..self.settings.clone() };
                // the manifest's name: a golden image is the same whichever folder it was made in
                let renderer = Renderer::new(self.device.clone(), scene, &settings)?.with_name(&frame.scene);
                let (scene, gltf_scene) = (frame.scene.clone(), frame.gltf_scene.clone());
                OpenRenderer { scene, gltf_scene, geometry: frame.geometry, kind, renderer }
            }
        };
        Ok(&mut self.open.insert(open).renderer)
    }

    /// The files of the scene of the last frame.
    pub fn scene_files(&self) -> &[PathBuf] {
        self.open.as_ref().map_or(&[], |open| &open.renderer.scene().report.files)
    }

    /// Fails if the validation layer, where it is on, has reported anything.
    pub fn check_validation(&self) -> Result<(), Error> {
        self.device.check_validation()
    }
}

/// The setting that chooses a tracer.
fn choice(kind: TracerKind) -> TracerChoice {
    match kind {
        TracerKind::Pipeline => TracerChoice::Pipeline,
        TracerKind::Query => TracerChoice::Query,
        TracerKind::Compute => TracerChoice::Compute,
    }
}
