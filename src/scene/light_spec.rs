//! Lights that are not in a scene's file, described in a line of text: `point position=0,2,0 intensity=100`.

use glam::{DAffine3, DVec3, Vec3};

use crate::scene::blackbody::blackbody;
use crate::scene::builtin::shapes;
use crate::scene::material::MaterialKind;
use crate::scene::{Geometry, Instance, Light, LightKind, Material, Mesh, Portal, Scene};
use crate::settings::parse::{parse_number, parse_vector};

/// A light as it is asked for: `KIND key=value ...`. Files hold the text.
#[derive(Clone, Debug)]
pub struct LightSpec {
    text: String,
    shape: Shape,
    /// Colour times intensity, irradiance or radiance.
    power: Vec3,
}

#[derive(Clone, Debug)]
enum Shape {
    Point { position: DVec3 },
    Spot { position: DVec3, direction: DVec3, inner: f32, outer: f32 },
    Sun { direction: DVec3, angle: f32 },
    Sphere { position: DVec3, radius: f64 },
    Rectangle { position: DVec3, direction: DVec3, size: [f64; 2] },
    Disk { position: DVec3, direction: DVec3, radius: f64 },
    Portal { position: DVec3, direction: DVec3, size: [f64; 2] },
}

/// Triangles of a disk. Its corners are where its area is the disk's, so its power is exact.
const DISK_CORNERS: u32 = 128;

/// Values by key, each asked for once.
struct Keys<'a> {
    kind: &'a str,
    given: Vec<(&'a str, &'a str)>,
}

impl<'a> Keys<'a> {
    fn take(&mut self, key: &str) -> Option<&'a str> {
        let at = self.given.iter().position(|(k, _)| *k == key)?;
        Some(self.given.remove(at).1)
    }

    fn needed<T>(&mut self, key: &str, parse: impl Fn(&str) -> Result<T, String>) -> Result<T, String> {
        let text = self.take(key).ok_or_else(|| format!("{} needs {key}=...", self.kind))?;
        parse(text).map_err(|e| format!("{key}={text}: {e}"))
    }

    /// `spec`, if nothing is left that it does not know.
    fn end(&self, spec: LightSpec) -> Result<LightSpec, String> {
        match self.given.first() {
            Some((key, _)) => Err(format!("{} has no {key}", self.kind)),
            None => Ok(spec),
        }
    }

    fn or<T>(&mut self, key: &str, default: T, parse: impl Fn(&str) -> Result<T, String>) -> Result<T, String> {
        match self.take(key) {
            Some(text) => parse(text).map_err(|e| format!("{key}={text}: {e}")),
            None => Ok(default),
        }
    }
}

fn positive(text: &str) -> Result<f64, String> {
    parse_number(text).and_then(|v| if v > 0.0 && v.is_finite() { Ok(v) } else { Err("must be above 0".into()) })
}

fn direction(text: &str) -> Result<DVec3, String> {
    parse_vector(text)?.try_normalize().ok_or_else(|| "has no direction".into())
}

fn degrees(most: f64) -> impl Fn(&str) -> Result<f64, String> {
    move |text| {
        let v = parse_number(text)?;
        if (0.0..=most).contains(&v) { Ok(v.to_radians()) } else { Err(format!("must be 0 to {most} degrees")) }
    }
}

fn size(text: &str) -> Result<[f64; 2], String> {
    let (w, h) = text.split_once(',').ok_or("expected WIDTH,HEIGHT")?;
    Ok([positive(w)?, positive(h)?])
}

fn colour(text: &str) -> Result<Vec3, String> {
    let c = parse_vector(text)?;
    if c.min_element() < 0.0 { Err("light is not negative".into()) } else { Ok(c.as_vec3()) }
}

/// Reads a light's description.
///
/// # Errors
/// What is wrong with it, in a line.
pub fn parse(text: &str) -> Result<LightSpec, String> {
    let mut words = text.split_whitespace();
    let kind = words.next().ok_or("empty: point, spot, sun, sphere, rectangle, disk or portal, then key=value")?;
    let given = words.map(|w| w.split_once('=').ok_or_else(|| format!("'{w}' is no key=value"))).collect::<Result<_, _>>()?;
    let mut keys = Keys { kind, given };
    let (shape, unit) = match kind {
        "point" => (Shape::Point { position: keys.needed("position", parse_vector)? }, "intensity"),
        "spot" => {
            let outer = keys.or("outer", 45f64.to_radians(), degrees(90.0))?;
            let inner = keys.or("inner", 0.0, degrees(90.0))?.min(outer);
            let (position, direction) = (keys.needed("position", parse_vector)?, keys.needed("direction", direction)?);
            (Shape::Spot { position, direction, inner: inner as f32, outer: outer as f32 }, "intensity")
        }
        "sun" => {
            let angle = keys.or("angle", 0.0, degrees(180.0))? as f32;
            (Shape::Sun { direction: keys.needed("direction", direction)?, angle }, "irradiance")
        }
        "sphere" => {
            let (position, radius) = (keys.needed("position", parse_vector)?, keys.needed("radius", positive)?);
            (Shape::Sphere { position, radius }, "radiance")
        }
        "rectangle" => {
            let (position, direction) = (keys.needed("position", parse_vector)?, keys.needed("direction", direction)?);
            (Shape::Rectangle { position, direction, size: keys.needed("size", size)? }, "radiance")
        }
        "disk" => {
            let (position, direction) = (keys.needed("position", parse_vector)?, keys.needed("direction", direction)?);
            (Shape::Disk { position, direction, radius: keys.needed("radius", positive)? }, "radiance")
        }
        "portal" => {
            let (position, direction) = (keys.needed("position", parse_vector)?, keys.needed("direction", direction)?);
            let shape = Shape::Portal { position, direction, size: keys.needed("size", size)? };
            // it has no strength: what it lets in is the environment's
            return keys.end(LightSpec { text: text.to_owned(), shape, power: Vec3::ZERO });
        }
        other => return Err(format!("'{other}' is no light: point, spot, sun, sphere, rectangle, disk or portal")),
    };
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
    /// Puts it into a scene, in the file's world coordinates: what has an extent as a surface that emits from its front, reflects nothing, is seen and casts shadows.
    pub fn add(&self, scene: &mut Scene) {
        let light = |kind, position, direction| Light {
            name: "--light".into(),
            kind,
            intensity: self.power,
            position,
            direction,
            range: f64::INFINITY,
        };
        let (geometry, position) = match self.shape {
            Shape::Point { position } => return scene.lights.push(light(LightKind::Point, position, DVec3::NEG_Z)),
            Shape::Spot { position, direction, inner, outer } => {
                let kind = LightKind::Spot { inner_angle: inner, outer_angle: outer };
                return scene.lights.push(light(kind, position, direction));
            }
            Shape::Sun { direction, angle } => {
                return scene.lights.push(light(LightKind::Directional { angle }, DVec3::ZERO, direction));
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
        scene.meshes.push(Mesh { name: "--light".into(), geometry, material });
        let object_to_world = DAffine3::from_translation(position);
        scene.instances.push(Instance { name: "--light".into(), mesh, object_to_world });
    }
}

/// Two directions in the plane that faces `direction`, of which the first is horizontal where there is such a one; `direction` is their cross product.
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
    // the centre second: solid angles are sampled from there outwards, so a fan's samples are as even as those of one disk
    mesh.indices.extend((0..DISK_CORNERS).map(|k| [1 + (k + 1) % DISK_CORNERS, 0, 1 + k]));
    Geometry::Triangles(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_said() {
        for (text, says) in [
            ("", "empty"),
            ("lamp position=0,0,0", "no light"),
            ("point intensity=1", "needs position"),
            ("point position=0,0,0", "needs intensity"),
            ("point position=0,0,0 intensity=-1", "above 0"),
            ("point position=0,0,0 intensity=1 radius=2", "has no radius"),
            ("sun direction=0,0,0 irradiance=1", "no direction"),
            ("disk position=0,0,0 direction=0,1,0 radius=1 radiance=1 temperature=20", "1000 to 40000"),
            ("sphere position=0,0,0 radius=1 radiance=1 color=1,1,1 temperature=3000", "not both"),
            ("rectangle position=0,0,0 direction=0,1,0 size=1 radiance=1", "WIDTH,HEIGHT"),
            ("portal position=0,0,0 direction=0,1,0 size=1,1 radiance=1", "portal has no radiance"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(says), "{text}: {error}");
        }
    }

    #[test]
    fn portals_lie_about_their_position() {
        let mut scene = Scene::default();
        parse("portal position=1,2,3 direction=0,-1,0 size=2,3").unwrap().add(&mut scene);
        let portal = &scene.portals[0];
        assert!((portal.corner + 0.5 * (portal.edges[0] + portal.edges[1]) - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-12);
        assert!((portal.area() - 6.0).abs() < 1e-12 && scene.instances.is_empty() && scene.lights.is_empty());
    }

    #[test]
    fn shapes_face_their_direction_with_their_area() {
        let area = |text: &str| {
            let mut scene = Scene::default();
            parse(text).unwrap().add(&mut scene);
            let Geometry::Triangles(t) = &scene.meshes[0].geometry else { panic!("no triangles") };
            let p = |i: u32| t.positions[i as usize].as_dvec3();
            t.indices.iter().map(|c| 0.5 * (p(c[1]) - p(c[0])).cross(p(c[2]) - p(c[0]))).sum::<DVec3>()
        };
        let d = DVec3::new(1.0, -2.0, 0.5).normalize();
        let disk = area("disk position=1,2,3 direction=1,-2,0.5 radius=2 radiance=1");
        assert!((disk - d * std::f64::consts::PI * 4.0).length() < 1e-5, "{disk}");
        let rectangle = area("rectangle position=1,2,3 direction=0,-1,0 size=2,3 radiance=1");
        assert!((rectangle - DVec3::NEG_Y * 6.0).length() < 1e-6, "{rectangle}");
    }
}
