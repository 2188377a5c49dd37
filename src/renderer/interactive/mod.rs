//! A scene for viewers: views of it that change at any moment, rendered in short, interruptible
//! steps.
//!
//! [`Interactive`] holds the scene's tracers, [`View`] an image of it in progress. Several views
//! share tracers, pipelines and the pose of the scene.

pub mod pick;
pub(super) mod view;

use std::sync::Arc;

use super::survey::framing;
use super::survey::radius::{self, Openness};
use super::{Renderer, TracerRequest};
use crate::accel::features::Blend;
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::Control;
use crate::gpu::Device;
use crate::integrators::lighting::LightingSettings;
use crate::realtime::sequence;
use crate::scene::animation::{AnimationRig, Playback, Pose};
use crate::scene::material_edit::MaterialEdit;
use crate::scene::{AlphaMode, Camera, Material, Motion, Scene};
use crate::shaders::StreamShaders;
use crate::tracer::shading::is_shown_alike;
use crate::tracer::{
    BuildStats, ComputeOptions, DeviceSettings, MaterialChange, MovedBounds, Needs, Tracer, TracerKind,
};

pub use pick::Pick;
pub use view::{
    View, ViewPicture, ViewStep, ViewValues, camera_placement, camera_settings, render_command, render_flags,
};

/// A scene with its tracers, for views that change ([`Renderer::interactive`]).
pub struct Interactive<'r> {
    device: &'r Arc<Device>,
    scene: &'r Scene,
    name: &'r str,
    kind: TracerKind,
    compute: ComputeOptions,
    settings: &'r DeviceSettings,
    shows_own_light: bool,
    animation: Option<PlayedAnimation<'r>>,
    traced: Vec<TracedScene<'r>>,
    /// Number of tracers built so far.
    built: u32,
    warnings: Vec<String>,
    /// Materials that are edited beyond the scene's own settings, and the edits in effect.
    edited: Vec<(usize, Material)>,
    edits: Vec<MaterialEdit>,
}

/// An animation and its current pose.
struct PlayedAnimation<'r> {
    rig: &'r AnimationRig,
    index: usize,
    pose: Pose,
    /// Seconds since its start.
    time: Option<f64>,
}

/// The scene as a tracer holds it. Integrators that interpret alpha blending differently need
/// tracers of their own, and so does a white sky without materials.
struct TracedScene<'r> {
    flat: FlatScene<'r>,
    tracer: Tracer,
    needs: Needs,
    /// A number of its own, by which views know whether their tracer is still there.
    number: u32,
    /// Number of poses so far.
    pose: u64,
    /// Bounds of all that the last change of pose moved.
    moved: Vec<MovedBounds>,
    /// The scene in its pose, if the animation moves lights or surfaces that emit light.
    posed: Option<Box<Scene>>,
    /// The change of materials by the last change of pose.
    materials: MaterialChange,
}

impl Renderer {
    /// Prepares views of the scene under these lights, with an animation (an index) to be played.
    ///
    /// # Errors
    /// Those of [`LightingSettings::apply`]; [`Error::Usage`] for an animation that does not exist.
    pub fn interactive(&mut self, lighting: &LightingSettings, animation: Option<usize>) -> Result<Interactive<'_>> {
        self.light_or_choose(lighting)?;
        self.lay_ground();
        // views build their own, and memory may not hold both
        self.tracer = None;
        let animation = match animation {
            None => None,
            Some(index) => {
                let none = || Error::Usage("the scene has no animation".into());
                let rig = self.scene.rig.as_ref().ok_or_else(none)?;
                rig.motion(index)?;
                Some(PlayedAnimation { rig, index, pose: Pose::default(), time: None })
            }
        };
        Ok(Interactive {
            device: &self.device,
            scene: &self.scene,
            name: &self.name,
            kind: self.kind,
            compute: self.compute,
            settings: &self.settings,
            shows_own_light: *lighting == LightingSettings::default() && !self.lighting.is_automatic,
            animation,
            traced: Vec::new(),
            built: 0,
            warnings: Vec::new(),
            edited: Vec::new(),
            edits: self.scene.edited.as_ref().map(|e| e.materials().to_vec()).unwrap_or_default(),
        })
    }
}

impl<'r> Interactive<'r> {
    /// The scene.
    pub fn scene(&self) -> &'r Scene {
        self.scene
    }

    /// The device.
    pub fn device(&self) -> &'r Arc<Device> {
        self.device
    }

    /// Whether the only light is that of the scene's file.
    pub fn shows_own_light(&self) -> bool {
        self.shows_own_light
    }

    /// The tracer in use.
    pub fn tracer_kind(&self) -> TracerKind {
        self.kind
    }

    /// Time and memory that building the tracers took, one entry for each.
    pub fn build_stats(&self) -> Vec<BuildStats> {
        self.traced.iter().map(|w| w.tracer.stats()).collect()
    }

    /// Takes the warnings since the last call.
    pub fn take_warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    /// Moves the scene to a time of its animation, in seconds since its start; after its end it
    /// holds its last pose. Returns true if anything moved.
    ///
    /// # Errors
    /// Those of [`Tracer::update`].
    pub fn set_time(&mut self, seconds: f64) -> Result<bool> {
        let Some(animation) = &mut self.animation else { return Ok(false) };
        if animation.time == Some(seconds) {
            return Ok(false);
        }
        animation.time = Some(seconds);
        animation.rig.pose(animation.index, seconds, Playback::Once, &mut animation.pose)?;
        for traced in &mut self.traced {
            traced.update(&animation.pose)?;
        }
        Ok(true)
    }

    /// Materials that emit light and that the scene was prepared to have edited. They can be edited
    /// further.
    fn edited_emitters(&self) -> Vec<usize> {
        let all = self.scene.edited.iter().flat_map(|e| e.edited());
        all.filter(|k| self.scene.materials[*k].emissive.max_element() > 0.0).collect()
    }

    /// The edits of materials in effect.
    pub fn edits(&self) -> &[MaterialEdit] {
        &self.edits
    }

    /// Shows materials as these edits have them, in place of those before, by writing their records
    /// anew. Returns false and changes nothing where that is not enough: for light that a surface
    /// emits, or that it begins to transmit, the scene has to be prepared anew.
    ///
    /// # Errors
    /// Those of the device.
    pub fn edit_materials(&mut self, edits: &[MaterialEdit]) -> Result<bool> {
        // all that is edited, or was
        let mut edited = self.scene.edited_materials(edits);
        let before = self.edited.iter().map(|(k, _)| *k);
        let own = self.scene.edited.iter().flat_map(|e| e.edited()).chain(before);
        for k in own {
            if !edited.iter().any(|(at, _)| *at == k) {
                edited.push((k, self.scene.unedited_material(k).clone()));
            }
        }
        let rig = self.animation.as_ref().map(|a| a.rig.motion(a.index)).transpose()?.unwrap_or_default();
        let emitters = self.edited_emitters();
        let is_alike = |(k, m): &(usize, Material)| {
            let is_animated = rig.materials.contains_key(k);
            is_shown_alike(&self.scene.materials[*k], m, emitters.contains(k)) && !is_animated
        };
        if !edited.iter().all(is_alike) {
            return Ok(false);
        }
        for traced in &mut self.traced {
            traced.materials = traced.tracer.set_materials(&edited)?;
            traced.edit_lights(&edited);
            if traced.materials != MaterialChange::None {
                traced.moved.clear();
                traced.pose += 1;
            }
        }
        (self.edited, self.edits) = (edited, edits.to_vec());
        Ok(true)
    }

    /// A camera of the file as the animation has moved it; `None` if it does not move it.
    pub fn animated_camera(&self, index: usize) -> Option<Camera> {
        let pose = &self.animation.as_ref()?.pose;
        let placed = pose.cameras.iter().find(|(k, _)| *k == index);
        if placed.is_none() && !pose.lenses.iter().any(|(k, ..)| *k == index) {
            return None;
        }
        let mut camera = self.scene.cameras.get(index)?.clone();
        camera.camera_to_world = placed.map_or(camera.camera_to_world, |(_, to_world)| *to_world);
        pose.set_lens(Some(index), &mut camera);
        Some(camera)
    }

    /// The first camera, for images of `aspect` = width / height: the file's, or an automatic one.
    ///
    /// # Errors
    /// Those of the device; [`Error::Scene`] for a scene without geometry.
    pub fn choose_camera(&mut self, aspect: f64, control: &mut dyn Control) -> Result<Camera> {
        match self.scene.cameras.first() {
            Some(camera) => Ok(camera.clone()),
            None => self.automatic_camera(aspect, control),
        }
    }

    /// Returns true once the scene is traced, by a view or [`Self::trace`]: points can be picked.
    pub fn is_traced(&self) -> bool {
        !self.traced.is_empty()
    }

    /// Has the scene traced, without a view.
    ///
    /// # Errors
    /// Those of the device and of `control`.
    pub fn trace(&mut self, control: &mut dyn Control) -> Result<()> {
        if !self.is_traced() {
            self.traced_scene(Blend::Masked, Needs::default(), Vec::new(), control)?;
        }
        Ok(())
    }

    /// As [`Self::choose_camera`], errors included, but whatever cameras the file has.
    pub fn automatic_camera(&mut self, aspect: f64, control: &mut dyn Control) -> Result<Camera> {
        self.trace(control)?;
        Ok(framing::choose(self.scene, aspect, None, &|rays| self.visible_surfaces(rays))?.camera())
    }

    /// Openness of the surfaces that a camera sees, for an AO radius; `None` if it sees none.
    ///
    /// # Errors
    /// Those of the device.
    pub fn openness(&mut self, camera: &Camera, aspect: f64, control: &mut dyn Control) -> Result<Option<Openness>> {
        self.trace(control)?;
        let size = self.scene.bounds().map_or(0.0, |(lo, hi)| (hi - lo).length());
        radius::measure(camera, aspect, size, &|rays| self.visible_surfaces(rays))
    }

    /// Finds or builds the tracer for an integrator, and returns its index. A tracer that lacks
    /// scene data is replaced by one that has all that was needed so far.
    fn traced_scene(
        &mut self,
        blend: Blend,
        needs: Needs,
        streams: Vec<&'static StreamShaders>,
        control: &mut dyn Control,
    ) -> Result<usize> {
        // without blended materials all see the same scene
        let has_blended = self.scene.materials.iter().any(|m| m.alpha_mode == AlphaMode::Blend);
        let blend = if has_blended { blend } else { Blend::Masked };
        let found = self.traced.iter().position(|w| w.flat.blend == blend && w.needs.is_compatible(needs));
        let needs = match found {
            Some(k) if self.traced[k].needs.covers(needs) => return Ok(k),
            Some(k) => self.traced[k].needs.union(needs),
            None => needs,
        };

        // The old tracer goes before a new one is built: both may not fit into memory.
        let flat = match found {
            Some(k) => self.traced.swap_remove(k).flat,
            None => {
                let mut motion = match &self.animation {
                    Some(a) => a.rig.motion(a.index)?,
                    None => Motion::default(),
                };
                // those that emit no light can be edited while they are shown
                let dark = self.scene.materials.iter().enumerate().filter(|(_, m)| is_shown_alike(m, m, false));
                for k in dark.map(|(k, _)| k).chain(self.edited_emitters()) {
                    motion.materials.entry(k).or_default();
                }
                FlatScene::with_motion_and_blend(self.scene, motion, blend)?
            }
        };
        // about what a good still traces: the quality of the BVH follows from it
        const RAYS: u64 = 1 << 28;
        let request = TracerRequest { needs, streams, rays: RAYS, camera: None, control, warnings: &mut self.warnings };
        let tracer = request.build(self.device, self.kind, &flat, self.compute, self.settings)?;
        self.built += 1;

        // Put it into the pose that the scene is in.
        let moves_lights = match &self.animation {
            Some(a) => sequence::moves_lights(self.scene, a.rig, a.index)?,
            None => false,
        };
        let posed = (moves_lights || !self.edited_emitters().is_empty()).then(|| Box::new(self.scene.clone()));
        let mut traced = TracedScene {
            flat,
            tracer,
            needs,
            number: self.built,
            pose: 0,
            moved: Vec::new(),
            posed,
            materials: MaterialChange::None,
        };
        if let Some(animation) = self.animation.as_ref().filter(|a| a.time.is_some()) {
            traced.update(&animation.pose)?;
        }
        traced.tracer.set_materials(&self.edited)?;
        traced.edit_lights(&self.edited);
        self.traced.push(traced);
        Ok(self.traced.len() - 1)
    }

    /// The traced scene of this number, if it has not been replaced.
    fn find_traced(&self, number: u32) -> Option<&TracedScene<'r>> {
        self.traced.iter().find(|traced| traced.number == number)
    }
}

impl TracedScene<'_> {
    fn update(&mut self, pose: &Pose) -> Result<()> {
        if self.tracer.is_dynamic() {
            self.moved = self.tracer.update(&pose.changes())?.moved;
        }
        self.materials = self.tracer.set_materials(&pose.materials)?;
        if let Some(posed) = &mut self.posed {
            pose.apply(posed);
        }
        if self.tracer.is_dynamic() || self.posed.is_some() || self.materials != MaterialChange::None {
            self.pose += 1;
        }
        Ok(())
    }

    /// Gives surfaces that emit light the emission of edited materials.
    fn edit_lights(&mut self, edited: &[(usize, Material)]) {
        if let Some(posed) = &mut self.posed {
            edited.iter().for_each(|(k, material)| posed.materials[*k] = material.clone());
        }
    }

    /// The scene as its tracer holds it, with lights where they are in its pose.
    fn posed(&self) -> FlatScene<'_> {
        match &self.posed {
            Some(posed) => FlatScene { scene: posed, ..self.flat.clone() },
            None => self.flat.clone(),
        }
    }
}
