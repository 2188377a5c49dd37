//! `.brhan`: the text scenes of Larsen's reference path tracer. A camera, render settings, OBJ (or
//! glTF) models with transforms and materials, spheres.
//!
//! Spheres stay analytic. A `SphericalLight` is a sphere with an emissive material and nothing
//! else: it is seen by camera rays and counted once, as an emissive surface, not again in
//! [`Scene::lights`].

mod parse;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DMat3, DVec3, Vec3};

use parse::Statement;

use super::find::Finder;
use super::model::read_model;
use super::nodes::NodeTreeBuilder;
use super::options::Loading;
use super::{find, finish, text};
use crate::error::{Error, Result};
use crate::scene::material::{Material, MaterialKind, Transmission};
use crate::scene::{AnimationRig, Camera, Geometry, Instance, Mesh, NodeTree, Scene, Sphere};

/// Reads a `.brhan` file and the models that it names.
pub(super) fn read(path: &Path, loading: Loading) -> Result<Scene> {
    let bytes = crate::files::read_regular(path).map_err(|e| Error::read(path, &e))?;
    loading.budget.read(bytes.len());
    let text = text::decode(&bytes);
    let wrong = |e: String| Error::input(path, text::shown(&e));
    let statements = parse::statements(&text).map_err(wrong)?;
    let (scene, models, finder) = (Scene::default(), HashMap::new(), Finder::new(&loading.options));
    let mut loader = Loader { path, loading, scene, nodes: NodeTreeBuilder::default(), models, finder };
    for mut statement in statements {
        loader.statement(&mut statement)?;
        statement.done().map_err(wrong)?;
    }
    loader.scene.nodes = loader.nodes.finish(&loader.scene);
    Ok(loader.scene)
}

struct Loader<'a> {
    path: &'a Path,
    loading: Loading<'a>,
    scene: Scene,
    /// Models, each with what is below it.
    nodes: NodeTreeBuilder,
    /// The instances of each loaded model with each material, relative to the model, and its nodes.
    models: HashMap<(PathBuf, Option<String>), (Vec<Instance>, NodeTree)>,
    finder: Finder,
}

impl Loader<'_> {
    fn statement(&mut self, s: &mut Statement) -> Result<()> {
        if s.key == "Model" {
            return self.model(s);
        }
        let made = match s.key {
            "Camera" => self.camera(s),
            "Integrator" => self.integrator(s),
            "Sphere" => self.sphere(s),
            "SphericalLight" => self.light(s),
            "SaveIntervals" => s.own_counts().map(|n| self.scene.hints.save_intervals = n),
            "GenDepthImage" => match s.own() {
                Ok("true" | "false") => {
                    self.scene.hints.depth_image = s.own() == Ok("true");
                    Ok(())
                }
                Ok(other) => Err(format!("line {}: GenDepthImage[{other}]: true or false expected", s.line)),
                Err(e) => Err(e),
            },
            key => Err(format!(
                "line {}: unknown key `{key}` (Camera, Integrator, Model, Sphere, SphericalLight, SaveIntervals and \
                 GenDepthImage are known)",
                s.line
            )),
        };
        made.map_err(|e| Error::input(self.path, text::shown(&e)))
    }

    fn camera(&mut self, s: &mut Statement) -> Result<(), String> {
        let line = s.line;
        let eye = s.vector("position")?.unwrap_or(DVec3::ZERO);
        let direction = s.vector("view_direction")?.unwrap_or(DVec3::NEG_Z);
        let fov = s.number("vertical_fov")?.unwrap_or(45.0);
        let direction =
            direction.try_normalize().ok_or_else(|| format!("line {line}: Camera: view_direction[] is zero"))?;
        if !(fov > 0.0 && fov < 180.0) {
            return Err(format!("line {line}: Camera: vertical_fov[{fov}]: between 0 and 180 degrees expected"));
        }
        let mut camera = Camera::look_at(eye, eye + direction, DVec3::Y, fov.to_radians());
        if let (Some(width), Some(height)) = (s.count("width", 1)?, s.count("height", 1)?) {
            self.scene.hints.size = Some([width, height]);
            camera.aspect = Some(f64::from(width) / f64::from(height));
        }
        self.scene.cameras.push(camera);
        Ok(())
    }

    fn integrator(&mut self, s: &mut Statement) -> Result<(), String> {
        if let Some(other) = s.text("type").filter(|t| *t != "path") {
            let warning = format!("line {}: the integrator `{other}` is unknown: ignored", s.line);
            self.scene.report.warnings.push(warning);
        }
        self.scene.hints.spp = s.count("spp", 1)?;
        self.scene.hints.max_depth = s.count("max_depth", 0)?;
        Ok(())
    }

    fn sphere(&mut self, s: &mut Statement) -> Result<(), String> {
        let (sphere, place) = sphere(s)?;
        let material = material(s)?.unwrap_or_else(|| Material { kind: MaterialKind::Matte, ..Material::default() });
        self.push_sphere("Sphere", sphere, place, material);
        Ok(())
    }

    fn light(&mut self, s: &mut Statement) -> Result<(), String> {
        let (sphere, place) = sphere(s)?;
        let emissive = s.color("emittance")?.unwrap_or(Vec3::ONE);
        let black = Vec3::ZERO.extend(1.0);
        let material = Material { kind: MaterialKind::Matte, base_color: black, emissive, ..Material::default() };
        self.push_sphere("SphericalLight", sphere, place, material);
        Ok(())
    }

    fn push_sphere(&mut self, name: &str, sphere: Sphere, place: DVec3, material: Material) {
        let scene = &mut self.scene;
        let mesh = scene.meshes.len();
        let object_to_world = DAffine3::from_translation(place);
        scene.instances.push(Instance { name: name.to_owned(), mesh, object_to_world });
        scene.meshes.push(Mesh {
            name: name.to_owned(),
            geometry: Geometry::Spheres(vec![sphere]),
            material: scene.materials.len(),
            source: None,
        });
        scene.materials.push(Material { name: name.to_owned(), ..material });
    }

    fn model(&mut self, s: &mut Statement) -> Result<()> {
        let here = |e: String| Error::input(self.path, text::shown(&e));
        let file = s.need("file").map_err(here)?;
        let to_world = transform(s).map_err(here)?;
        let material = material(s).map_err(here)?;
        let found = self.finder.find(&[file], &[self.path]);
        self.finder.check(self.path)?;
        let found = found.map_err(|searched| {
            let searched = find::list(&searched);
            here(format!("line {}: the model {file} does not exist; searched in {searched}", s.line))
        })?;
        // a model that is used twice with one material is read once
        let key = (found, material.as_ref().map(|m| format!("{m:?}")));
        if !self.models.contains_key(&key) {
            let mut model = read_model(&key.0, self.loading)?;
            if model.rig.is_some() {
                // its nodes are not this scene's
                AnimationRig::apply_rest_pose(&mut model);
                model.rig = None;
                let is_kept: Vec<bool> = (0..model.instances.len()).map(|k| !model.hidden.contains(&k)).collect();
                model.nodes.keep_instances(&is_kept);
                model.instances = model.shown_instances().cloned().collect();
                let file = text::shown(file);
                self.scene.report.warnings.push(format!("{file}: animations of models are not played"));
            }
            finish::check(&model, &key.0)?;
            if let Some(material) = material {
                for mesh in &mut model.meshes {
                    mesh.material = 0;
                }
                (model.materials, model.textures) = (vec![material], Vec::new());
            }
            self.scene.report.files.push(key.0.clone());
            let nodes = std::mem::take(&mut model.nodes);
            let placed = self.scene.append(model);
            self.models.insert(key.clone(), (placed, nodes));
        }

        // a node for each use of it
        let (instances, nodes) = &self.models[&key];
        let name = file.rsplit(['/', '\\']).next().unwrap_or(file);
        self.nodes.begin(0, &text::shown(name), &self.scene);
        self.nodes.append(nodes, &self.scene);
        for placed in instances {
            let object_to_world = to_world * placed.object_to_world;
            self.scene.instances.push(Instance { object_to_world, ..placed.clone() });
        }
        self.nodes.end(0, &self.scene);
        Ok(())
    }
}

/// A sphere, and the point that its centre is relative to: the centre itself where single precision
/// would move it by more than it rounds the sphere's own extent, and zero else.
fn sphere(s: &mut Statement) -> Result<(Sphere, DVec3), String> {
    let line = s.line;
    let center = s.vector("center")?.unwrap_or(DVec3::ZERO);
    let radius = s.number("radius")?.unwrap_or(1.0) as f32;
    if !(radius > 0.0 && radius.is_finite()) {
        return Err(format!("line {line}: {}: radius[{radius}]: a number above zero expected", s.key));
    }
    let rounded = (center - center.as_vec3().as_dvec3()).abs().max_element();
    let place = if rounded > f64::from(radius * f32::EPSILON) { center } else { DVec3::ZERO };
    Ok((Sphere { center: (center - place).as_vec3(), radius }, place))
}

/// `translate * rotate_z * rotate_y * rotate_x * scale`: a point is scaled, turned about x, y and z
/// in the order in which the angles are written, and moved. No description of the format says so;
/// turning about one axis, as most samples do, is the same in any order, and the one sample that
/// turns about three comes out closest to upright in this one.
fn transform(s: &mut Statement) -> Result<DAffine3, String> {
    let translate = s.vector("translate")?.unwrap_or(DVec3::ZERO);
    let degrees = s.vector("rotate")?.unwrap_or(DVec3::ZERO);
    let scale = s.vector("scale")?.unwrap_or(DVec3::ONE);
    let [x, y, z] = degrees.to_array().map(f64::to_radians);
    let rotate = DMat3::from_rotation_z(z) * DMat3::from_rotation_y(y) * DMat3::from_rotation_x(x);
    Ok(DAffine3::from_mat3_translation(rotate * DMat3::from_diagonal(scale), translate))
}

/// The material of a statement, if it has one.
fn material(s: &mut Statement) -> Result<Option<Material>, String> {
    let line = s.line;
    let name = s.text("material");
    let diffuse = s.color("diffuse")?;
    let specular = s.color("specular")?;
    let reflectance = s.color("reflectance")?;
    let transmittance = s.color("transmittance")?;
    let sigma = s.number("sigma")?;

    // a material without a name is the default
    let Some(name) = name else { return Ok(None) };
    let kind = match name {
        "matte" => MaterialKind::Matte,
        "mirror" => MaterialKind::Mirror,
        "glass" => MaterialKind::Glass,
        "copper" => MaterialKind::Copper,
        "gold" => MaterialKind::Gold,
        other => {
            let known = "matte, mirror, glass, copper and gold are known";
            return Err(format!("line {line}: unknown material `{other}` ({known})"));
        }
    };

    let metal = matches!(kind, MaterialKind::Mirror | MaterialKind::Copper | MaterialKind::Gold);
    // what the kind stands for, so that renderers that know metallic-roughness only come close
    let tint = match kind {
        MaterialKind::Copper => Vec3::new(0.955, 0.638, 0.538),
        MaterialKind::Gold => Vec3::new(1.0, 0.782, 0.344),
        _ => Vec3::ONE,
    };

    let specular_color =
        specular.or(reflectance).unwrap_or(if kind == MaterialKind::Matte { Vec3::ZERO } else { tint });
    let glass = kind == MaterialKind::Glass;
    Ok(Some(Material {
        name: name.to_owned(),
        kind,
        base_color: diffuse.unwrap_or(tint).extend(1.0),
        metallic: if metal { 1.0 } else { 0.0 },
        roughness: match kind {
            MaterialKind::Mirror | MaterialKind::Glass => 0.0,
            MaterialKind::Copper | MaterialKind::Gold => 0.3,
            _ => 1.0,
        },
        specular_color,
        transmittance: if glass { transmittance.unwrap_or(Vec3::ONE) } else { Vec3::ZERO },
        transmission: Transmission { factor: if glass { 1.0 } else { 0.0 }, ..Default::default() },
        double_sided: true,
        parameters: sigma.map(|v| ("sigma".to_owned(), v as f32)).into_iter().collect(),
        ..Material::default()
    }))
}
