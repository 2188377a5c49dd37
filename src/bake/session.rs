//! Baking of all textures, or of the vertices of all meshes, of a scene.

use std::borrow::Cow;
use std::sync::Arc;

use glam::{DVec3, Vec4};

use super::cage::Detailed;
use super::map::{self, BakedMap, Traced};
use super::plan::{PlannedTexture, meshes_by_material};
use super::vertices::{self, BakedVertices};
use super::{BakeSettings, Map, Occluders};
use crate::accel::features::Blend;
use crate::accel::flatten::FlatScene;
use crate::error::Result;
use crate::film::Control;
use crate::gpu::Device;
use crate::integrators::ao::Hemisphere;
use crate::scene::builtin::shapes;
use crate::scene::load::SourceFile;
use crate::scene::material::MaterialKind;
use crate::scene::{Instance, Material, Mesh, Motion, Scene};
use crate::tracer::{DeviceSettings, Needs, Tracer};

/// Side of the ground plane, in diagonals of the scene.
const GROUND: f64 = 20.0;
/// Linear base colour of the ground plane, which light maps see.
const GROUND_COLOR: Vec4 = Vec4::new(0.5, 0.5, 0.5, 1.0);

/// A scene and the device that bakes it.
pub struct BakeSession<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The device.
    pub device: &'a Arc<Device>,
    /// The tracer and its options.
    pub tracing: &'a DeviceSettings,
    /// The settings of what is baked.
    pub settings: &'a BakeSettings,
    /// A detailed model that is traced in place of the scene.
    pub detailed: Option<Detailed<'a>>,
    /// Models that occlude besides, where their files place them.
    pub occluding: &'a [Scene],
}

impl BakeSession<'_> {
    /// Bakes each texture.
    ///
    /// # Errors
    /// Those of the device, and [`crate::Error::Interrupted`].
    pub fn bake_textures(&self, planned: &[PlannedTexture], control: &mut dyn Control) -> Result<Vec<BakedMap>> {
        let mut maps = Vec::new();
        let groups = planned.iter().map(|t| t.surfaces.iter().map(|s| s.mesh).collect()).collect::<Vec<Vec<usize>>>();
        let share = u64::from(self.settings.spp) << 20;
        self.with_each(&groups, share, control, |flat, tracer, nth, control| {
            let traced = Traced { scene: flat.scene, tracer, flat, cage: self.detailed.map(|d| d.cage) };
            maps.push(map::bake(self.scene, traced, &planned[nth], self.settings, control)?);
            Ok(())
        })?;
        Ok(maps)
    }

    /// Bakes the vertices of each mesh that has a primitive in the file; also the number of rays.
    ///
    /// # Errors
    /// Those of the device, of the file, and [`crate::Error::Interrupted`].
    pub fn bake_vertices(&self, file: &SourceFile, control: &mut dyn Control) -> Result<(Vec<BakedVertices>, u64)> {
        let (mut baked, mut rays) = (Vec::new(), 0);
        let materials = &self.settings.materials;
        let named = |meshes: &Vec<usize>| {
            let name = &self.scene.materials[self.scene.meshes[meshes[0]].material].name;
            materials.is_empty() || materials.contains(name)
        };
        let groups: Vec<Vec<usize>> =
            meshes_by_material(self.scene).into_iter().map(|(_, meshes)| meshes).filter(named).collect();
        let share = u64::from(self.settings.spp) << 16;
        self.with_each(&groups, share, control, |flat, tracer, nth, control| {
            for &mesh in &groups[nth] {
                if let Some((vertices, traced)) =
                    vertices::bake(flat.scene, tracer, file, mesh, self.settings, control)?
                {
                    baked.push(vertices);
                    rays += traced;
                }
            }
            Ok(())
        })?;
        Ok((baked, rays))
    }

    /// Calls `bake` for each group of meshes with the scene that occludes it, and its tracer.
    /// `rays`: about how many each will trace.
    fn with_each(
        &self,
        groups: &[Vec<usize>],
        rays: u64,
        control: &mut dyn Control,
        mut bake: impl FnMut(&FlatScene, &Tracer, usize, &mut dyn Control) -> Result<()>,
    ) -> Result<()> {
        let total = groups.len() as u64;
        let mut run = |scene: &Scene, numbers: std::ops::Range<usize>, control: &mut dyn Control| {
            let of_occlusion =
                Needs { normals: self.settings.occlusion.hemisphere == Hemisphere::Shading, ..Needs::default() };
            let (flat, needs) = match self.settings.map {
                // some rays pass what is partly transparent
                Map::Light => {
                    let flat = FlatScene::with_motion_and_blend(scene, Motion::default(), Blend::Stochastic)?;
                    (flat, self.settings.light.needs()?)
                }
                _ => (FlatScene::new(scene), of_occlusion),
            };
            let (kind, _, compute) = self.tracing.choose(&self.device.info)?;
            let build = self.tracing.build_options(rays * numbers.len() as u64)?;
            let tracer = Tracer::with_build(self.device, kind, &flat, needs, compute, &build)?;
            build.take_warnings().iter().for_each(|w| control.warning(w));
            for number in numbers {
                let mut part = Part { control: &mut *control, done: number as u64, total };
                bake(&flat, &tracer, number, &mut part)?;
            }
            Ok(())
        };
        match self.settings.occluders {
            Occluders::Scene => run(&self.occluders(None), 0..groups.len(), control),
            Occluders::Material => (0..groups.len())
                .try_for_each(|number| run(&self.occluders(Some(&groups[number])), number..number + 1, control)),
        }
    }

    /// The scene that occludes: all of it, or these meshes alone, the ground, and other models.
    fn occluders(&self, meshes: Option<&[usize]>) -> Cow<'_, Scene> {
        let mut scene = Cow::Borrowed(self.detailed.map_or(self.scene, |d| d.scene));
        if let Some(meshes) = meshes {
            // what is hidden keeps its number
            let others = self.scene.instances.iter().enumerate().filter(|(_, i)| !meshes.contains(&i.mesh));
            let hidden: Vec<usize> = others.map(|(i, _)| i).collect();
            if !hidden.is_empty() {
                scene.to_mut().hidden.extend(hidden);
            }
        }
        if let Some((low, high)) = self.settings.has_ground.then(|| scene.bounds()).flatten() {
            let centre = 0.5 * (low + high);
            let floor = shapes::floor(DVec3::new(centre.x, low.y, centre.z), GROUND * (high - low).length());
            let scene = scene.to_mut();
            scene.instances.push(Instance {
                name: "ground".to_owned(),
                mesh: scene.meshes.len(),
                object_to_world: glam::DAffine3::IDENTITY,
            });
            // of no material of the scene, which may emit
            let material = scene.materials.len();
            scene.materials.push(Material {
                kind: MaterialKind::Matte,
                base_color: GROUND_COLOR,
                ..Material::default()
            });
            scene.meshes.push(Mesh { name: "ground".to_owned(), geometry: floor, material, source: None });
        }

        // other models, whose instances come last: the others keep their numbers
        for model in self.occluding {
            let scene = scene.to_mut();
            let (first, hidden) = (scene.instances.len(), model.hidden.clone());
            let placed = scene.append(model.clone());
            scene.instances.extend(placed);
            scene.hidden.extend(hidden.into_iter().map(|k| first + k));
        }
        scene
    }
}

/// A part of a longer work.
struct Part<'c> {
    control: &'c mut dyn Control,
    /// Parts before it, and all.
    done: u64,
    total: u64,
}

impl Control for Part<'_> {
    fn progress(&mut self, done: u64, total: u64) {
        self.control.progress(self.done * total + done, self.total * total);
    }

    fn warning(&mut self, text: &str) {
        self.control.warning(text);
    }

    fn should_stop(&mut self) -> Result<bool> {
        self.control.should_stop()
    }
}
