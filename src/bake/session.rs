//! Baking of all textures, or of the vertices of all meshes, of a scene.

use std::borrow::Cow;
use std::sync::Arc;

use glam::DVec3;
use xxhash_rust::xxh3::Xxh3;

use super::cage::{Cage, Detailed, Projector};
use super::kept::KeptParts;
use super::map::{BakedMap, TextureBake, Traced};
use super::plan::{PlannedTexture, meshes_by_material};
use super::skew::Skew;
use super::vertices::{BakedVertices, VertexBaker};
use super::{BakeSettings, Map, Occluders};
use crate::accel::features::Blend;
use crate::accel::flatten::FlatScene;
use crate::error::Result;
use crate::film::Control;
use crate::gpu::Device;
use crate::integrators::ao::Hemisphere;
use crate::scene::builtin::shapes;
use crate::scene::load::SourceFile;
use crate::scene::{Motion, Scene, fingerprint, laid_ground};
use crate::tracer::{DeviceSettings, Needs, Tracer};

/// Side of the ground plane, in diagonals of the scene.
const GROUND: f64 = 20.0;

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
        self.bake_textures_in_parts(planned, None, control)
    }

    /// Bakes each texture, of which `kept` has and gets finished parts.
    ///
    /// # Errors
    /// Those of [`Self::bake_textures`], and of `kept`.
    pub fn bake_textures_in_parts(
        &self,
        planned: &[PlannedTexture],
        mut kept: Option<&mut KeptParts>,
        control: &mut dyn Control,
    ) -> Result<Vec<BakedMap>> {
        // textures, or each material of a texture where that decides what occludes
        let materials = |number: usize| -> Vec<(usize, Option<usize>)> {
            match self.settings.occluders {
                Occluders::Scene => vec![(number, None)],
                Occluders::Material => (0..planned[number].materials.len()).map(|m| (number, Some(m))).collect(),
            }
        };
        let jobs: Vec<(usize, Option<usize>)> = (0..planned.len()).flat_map(materials).collect();
        let meshes = |(number, material): &(usize, Option<usize>)| -> Vec<usize> {
            let surfaces = planned[*number].surfaces.iter();
            surfaces.filter(|s| material.is_none_or(|m| s.material == m)).map(|s| s.mesh).collect()
        };
        let groups: Vec<Vec<usize>> = jobs.iter().map(meshes).collect();

        // one after the other
        let (mut maps, mut under_way) = (Vec::new(), None);
        let share = u64::from(self.settings.spp) << 20;
        self.with_each(&groups, share, control, |flat, tracer, nth, control| {
            let (number, material) = jobs[nth];
            let traced = Traced { scene: flat.scene, tracer, flat, detailed: self.detailed };
            let begin = || TextureBake::new(self.scene, &planned[number], self.settings);
            let mut bake = under_way.take().unwrap_or_else(begin);
            bake.sample(traced, material, kept.as_deref_mut(), control)?;
            if jobs.get(nth + 1).is_some_and(|next| next.0 == number) {
                under_way = Some(bake);
            } else {
                maps.push(bake.finish());
            }
            Ok(())
        })?;
        Ok(maps)
    }

    /// 32 hexadecimal digits that stand for all that the values of textures depend on: scenes,
    /// settings, the device, and where surfaces lie in the textures.
    pub fn fingerprint(&self, planned: &[PlannedTexture]) -> String {
        let mut hash = Xxh3::new();
        let add = |hash: &mut Xxh3, text: &str| {
            hash.update(&(text.len() as u64).to_le_bytes());
            hash.update(text.as_bytes());
        };
        add(&mut hash, env!("CARGO_PKG_VERSION"));
        let Self { settings, tracing, device, .. } = self;
        add(&mut hash, &format!("{settings:?} {tracing:?} {} {}", device.info.name, device.info.driver));

        // scenes
        let cage = self.detailed.map(|detailed| detailed.cage);
        let cage_model = if let Some(Cage::Model(model)) = cage { Some(model) } else { None };
        let other = self.detailed.map(|detailed| detailed.scene).into_iter().chain(cage_model).chain(self.occluding);
        for scene in std::iter::once(self.scene).chain(other) {
            add(&mut hash, &fingerprint::of_scene(scene));
            add(&mut hash, &fingerprint::of_environment(&scene.environment));
        }
        if let Some(Cage::Distance(distance)) = cage {
            add(&mut hash, &distance.to_bits().to_string());
        }
        if let Some(detailed) = self.detailed {
            add(&mut hash, &format!("{:?}", detailed.behind.map(f64::to_bits)));
            match detailed.skew {
                Skew::Uniform(share) => add(&mut hash, &share.to_bits().to_string()),
                Skew::Map(map) => hash.update(map.texture().texels.as_bytes()),
            }
        }

        // textures
        for texture in planned {
            add(&mut hash, &format!("{:?} {} {:?}", texture.size, texture.texcoord, texture.tile));
            for surface in &texture.surfaces {
                add(&mut hash, &format!("{} {} {:?}", surface.mesh, surface.material, surface.instances));
                hash.update(bytemuck::cast_slice(surface.corners.as_flattened()));
            }
        }
        format!("{:032x}", hash.digest128())
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
            let projector = self.detailed.map(|detailed| Projector::new(detailed, tracer, flat.origin));
            let baker = VertexBaker { scene: self.scene, tracer, file, settings: self.settings, projector };
            for &mesh in &groups[nth] {
                if let Some((vertices, traced)) = baker.bake(mesh, control)? {
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
            laid_ground::add_plane(scene.to_mut(), floor, DVec3::ZERO);
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
