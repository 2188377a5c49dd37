//! Lights that are not in a scene's file, described in a line of text:
//! `point position=0,2,0 intensity=100`.

use glam::{DAffine3, DVec3, Vec3};

use crate::scene::blackbody::blackbody;
use crate::scene::builtin::shapes;
use crate::scene::lights::PlacedLight;
use crate::scene::lights::keys::{Keys, colour, direction, position, positive, size};
use crate::scene::material::MaterialKind;
use crate::scene::{Geometry, Instance, Light, LightKind, Material, Mesh, Portal, Scene};

/// A light as it is asked for: `KIND key=value ...`. Files hold the text.
#[derive(Clone, Debug)]
pub struct LightSpec {
    text: String,
    shape: Shape,
    /// Colour times intensity, irradiance or radiance.
    power: Vec3,
}

/// Shape of the emitter.
#[derive(Clone, Debug)]
enum Shape {
    Punctual(PlacedLight),
    Sphere { position: DVec3, radius: f64 },
    Rectangle { position: DVec3, direction: DVec3, size: [f64; 2] },
    Disk { position: DVec3, direction: DVec3, radius: f64 },
    Portal { position: DVec3, direction: DVec3, size: [f64; 2] },
}

/// Triangles of a disk. Its corners are where its area is the disk's, so its power is exact.
const DISK_CORNERS: u32 = 128;

/// Words of the kinds that are not in [`LightKind::TYPES`].
const OTHER_KINDS: &str = "sphere, rectangle, disk or portal";

/// Words of all kinds, for messages: `sun, point, ... or portal`.
pub fn kinds() -> String {
    LightKind::TYPES.iter().map(|t| format!("{}, ", t.word)).collect::<String>() + OTHER_KINDS
}

/// The long help of `--light`: what is said in short, then all kinds with their keys.
pub fn help() -> String {
    let punctual: String = LightKind::TYPES.iter().map(|t| format!("{}: {}; ", t.word, t.keys)).collect();
    format!(
        "Add a light: its kind, then key=value, like \"sun direction=0,-1,0 irradiance=3\"; may be repeated\n\n\
         Kinds and their keys. {punctual}sphere: position, radius, radiance; rectangle: position, direction, size=W,H, \
         radiance; disk: position, direction, radius, radiance; portal: position, direction, size=W,H of an opening \
         through which the environment is sampled, which lessens the noise of rooms. Direction is that in which it \
         emits; color=R,G,B or temperature=K tints it."
    )
}

/// Reads a light's description.
///
/// # Errors
/// What is wrong with it, in a line.
pub fn parse(text: &str) -> Result<LightSpec, String> {
    let mut words = text.split_whitespace();
    let kind = words.next().ok_or_else(|| format!("empty: {}, then key=value", kinds()))?;
    let given =
        words.map(|w| w.split_once('=').ok_or_else(|| format!("'{w}' is no key=value"))).collect::<Result<_, _>>()?;
    let mut keys = Keys::new(kind, given);

    // the shape
    let punctual = LightKind::TYPES.iter().find(|t| t.word == kind);
    let (shape, unit) = match (punctual, kind) {
        (Some(light), _) => (Shape::Punctual((light.read)(&mut keys)?), light.strength),
        (None, "sphere") => {
            let (position, radius) = (keys.needed("position", position)?, keys.needed("radius", positive)?);
            (Shape::Sphere { position, radius }, "radiance")
        }
        (None, "rectangle") => {
            let (position, direction) = (keys.needed("position", position)?, keys.needed("direction", direction)?);
            (Shape::Rectangle { position, direction, size: keys.needed("size", size)? }, "radiance")
        }
        (None, "disk") => {
            let (position, direction) = (keys.needed("position", position)?, keys.needed("direction", direction)?);
            (Shape::Disk { position, direction, radius: keys.needed("radius", positive)? }, "radiance")
        }
        (None, "portal") => {
            let (position, direction) = (keys.needed("position", position)?, keys.needed("direction", direction)?);
            let shape = Shape::Portal { position, direction, size: keys.needed("size", size)? };
            // it has no strength: what it lets in is the environment's
            return keys.end(LightSpec { text: text.to_owned(), shape, power: Vec3::ZERO });
        }
        (None, other) => return Err(format!("'{other}' is no light: {}", kinds())),
    };

    // the strength and colour
    let strength = keys.needed(unit, positive)?;
    let tint = match (keys.take("color"), keys.take("temperature")) {
        (Some(_), Some(_)) => return Err("color or temperature, not both".into()),
        (Some(c), None) => colour(c).map_err(|e| format!("color={c}: {e}"))?,
        (None, Some(k)) => {
            let kelvin = positive(k).map_err(|e| format!("temperature={k}: {e}"))?;
            if !(1000.0..=40_000.0).contains(&kelvin) {
                return Err(format!("temperature={k}: must be 1000 to 40000 kelvin"));
            }
            blackbody(kelvin)
        }
        (None, None) => Vec3::ONE,
    };
    keys.end(LightSpec { text: text.to_owned(), shape, power: tint * strength as f32 })
}

impl PartialEq for LightSpec {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
}

impl std::fmt::Display for LightSpec {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(&self.text)
    }
}

impl serde::Serialize for LightSpec {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.text)
    }
}

impl<'de> serde::Deserialize<'de> for LightSpec {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        parse(&text).map_err(serde::de::Error::custom)
    }
}

impl LightSpec {
    /// Puts it into a scene, in the file's world coordinates: what has an extent as a surface that
    /// emits from its front, reflects nothing, is seen and casts shadows.
    pub fn add(&self, scene: &mut Scene) {
        let (geometry, position) = match self.shape {
            Shape::Punctual(PlacedLight { kind, position, direction }) => {
                let (name, range) = ("--light".into(), f64::INFINITY);
                return scene.lights.push(Light { name, kind, intensity: self.power, position, direction, range });
            }
            Shape::Sphere { position, radius } => (shapes::sphere(DVec3::ZERO, radius), position),
            Shape::Rectangle { position, direction, size } => {
                let (u, v) = across(direction);
                (shapes::rectangle(DVec3::ZERO, u * size[0], v * size[1]), position)
            }
            Shape::Disk { position, direction, radius } => (disk(direction, radius), position),
            Shape::Portal { position, direction, size } => {
                let (u, v) = across(direction);
                let edges = [u * size[0], v * size[1]];
                return scene.portals.push(Portal { corner: position - 0.5 * (edges[0] + edges[1]), edges });
            }
        };
        let (material, mesh) = (scene.materials.len(), scene.meshes.len());
        scene.materials.push(Material {
            kind: MaterialKind::Matte,
            base_color: Vec3::ZERO.extend(1.0),
            emissive: self.power,
            ..Material::default()
        });
        scene.meshes.push(Mesh { name: "--light".into(), geometry, material, source: None });
        let object_to_world = DAffine3::from_translation(position);
        scene.instances.push(Instance { name: "--light".into(), mesh, object_to_world });
    }
}

/// Two directions in the plane that faces `direction`, of which the first is horizontal where there
/// is such a one; `direction` is their cross product.
fn across(direction: DVec3) -> (DVec3, DVec3) {
    let u = DVec3::Y.cross(direction).try_normalize().unwrap_or(DVec3::X);
    (u, direction.cross(u))
}

fn disk(direction: DVec3, radius: f64) -> Geometry {
    let (u, v) = across(direction);
    let step = std::f64::consts::TAU / f64::from(DISK_CORNERS);
    let out = radius * (step / step.sin()).sqrt();
    let corner = |k: u32| {
        let (s, c) = (step * f64::from(k)).sin_cos();
        (u * c + v * s) * out
    };
    let mut mesh = crate::scene::TriangleMesh::default();
    mesh.positions.push(Vec3::ZERO);
    mesh.positions.extend((0..DISK_CORNERS).map(|k| corner(k).as_vec3()));
    // the centre second: solid angles are sampled from there outwards, so a fan's samples are as
    // even as those of one disk
    mesh.indices.extend((0..DISK_CORNERS).map(|k| [1 + (k + 1) % DISK_CORNERS, 0, 1 + k]));
    Geometry::Triangles(mesh)
}
