//! Hashes of everything in a scene on which an image can depend, to check that a resumed render has
//! the same scene. File names, cameras and render settings are not included.

use std::fmt::{Debug, Write};

use xxhash_rust::xxh3::Xxh3;

use super::{Environment, EnvironmentMap, Geometry, Instance, Mesh, Scene, TexelData, Texture, TriangleMesh};

/// The hash of geometry, materials, textures and lights, without the environment: 32 hexadecimal
/// digits.
pub fn of_scene(scene: &Scene) -> String {
    let mut hash = Fingerprint(Xxh3::new());

    // patterns without `..`: a new field must be considered here
    for Mesh { name: _, geometry, material } in &scene.meshes {
        hash.count(*material);
        match geometry {
            Geometry::Triangles(TriangleMesh {
                positions,
                indices,
                normals,
                tangents,
                clearcoat_tangents,
                anisotropy_tangents,
                texcoords,
                more_texcoords,
                colors,
            }) => {
                hash.slice(positions);
                hash.slice(indices);
                hash.slice(normals);
                hash.slice(tangents);
                [clearcoat_tangents, anisotropy_tangents].iter().filter(|t| !t.is_empty()).for_each(|t| hash.slice(t));
                texcoords.iter().chain(more_texcoords).for_each(|t| hash.slice(t));
                hash.slice(colors);
            }
            Geometry::Spheres(spheres) => {
                let numbers: Vec<[f32; 4]> = spheres.iter().map(|s| s.center.extend(s.radius).to_array()).collect();
                hash.slice(&numbers);
            }
        }
    }

    for Instance { name: _, mesh, object_to_world } in &scene.instances {
        hash.count(*mesh);
        hash.slice(&object_to_world.to_cols_array());
    }

    for Texture { name: _, width, height, texels, wrap, filter } in &scene.textures {
        hash.text(&(width, height, wrap, filter));
        match texels {
            TexelData::Unorm8(rgba) => hash.slice(rgba),
            TexelData::Unorm16(rgba) => hash.slice(rgba),
            TexelData::Float(rgba) => hash.slice(rgba),
        }
    }

    // the debug text has all fields, and all digits of numbers
    hash.text(&scene.materials);
    hash.text(&scene.lights);
    if !scene.hidden.is_empty() {
        hash.text(&scene.hidden);
    }
    // they decide where light is sampled
    hash.text(&scene.portals);
    hash.finish()
}

/// The hash of an environment: 32 hexadecimal digits.
pub fn of_environment(environment: &Environment) -> String {
    let mut hash = Fingerprint(Xxh3::new());
    match environment {
        Environment::Black => hash.text(&"black"),
        Environment::Uniform(radiance) => hash.text(radiance),
        Environment::Map(EnvironmentMap { name: _, width, height, radiance, factor, to_map }) => {
            hash.text(&(width, height, factor, to_map));
            hash.slice(radiance);
        }
    }
    hash.finish()
}

struct Fingerprint(Xxh3);

impl Fingerprint {
    /// Hashes the length of a slice and its numbers.
    fn slice<T: bytemuck::NoUninit>(&mut self, numbers: &[T]) {
        self.count(numbers.len());
        self.0.update(bytemuck::cast_slice(numbers));
    }

    fn count(&mut self, n: usize) {
        self.0.update(&(n as u64).to_le_bytes());
    }

    fn text(&mut self, value: &dyn Debug) {
        // writing to a hash cannot fail
        let _ = write!(self, "{value:?};");
    }

    fn finish(&self) -> String {
        format!("{:032x}", self.0.digest128())
    }
}

impl Write for Fingerprint {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        self.0.update(text.as_bytes());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::builtin;
    use glam::Vec3;

    /// A change to a scene.
    type Change = dyn Fn(&mut Scene);

    #[test]
    fn whatever_an_image_depends_on_changes_it() {
        let scene = builtin::by_name("cornell-box").unwrap();
        let changed = |change: &Change| {
            let mut scene = scene.clone();
            change(&mut scene);
            of_scene(&scene)
        };
        let same = changed(&|_| ());
        assert_eq!(same.len(), 32);
        assert_eq!(changed(&|s| s.name = "other".into()), same);
        assert_eq!(changed(&|s| s.cameras.clear()), same);
        assert_eq!(changed(&|s| s.hints.spp = Some(7)), same);
        assert_eq!(changed(&|s| s.environment = Environment::Uniform(Vec3::ONE)), same);
        let changes: [&Change; 7] = [
            &|s| s.materials[0].roughness += f32::EPSILON,
            &|s| s.instances[0].object_to_world.translation.x += 1e-12,
            &|s| s.instances.swap(0, 1),
            &|s| s.meshes.iter_mut().for_each(|m| m.material = 0),
            &|s| {
                s.lights.push(crate::scene::Light {
                    name: String::new(),
                    kind: crate::scene::LightKind::Point,
                    intensity: Vec3::ONE,
                    position: glam::DVec3::ZERO,
                    direction: glam::DVec3::Y,
                    range: f64::INFINITY,
                })
            },
            &|s| {
                let edges = [glam::DVec3::X, glam::DVec3::Z];
                s.portals.push(crate::scene::Portal { corner: glam::DVec3::ZERO, edges });
            },
            &|s| {
                let mesh = s.meshes.iter_mut().find_map(|m| match &mut m.geometry {
                    Geometry::Triangles(mesh) => Some(mesh),
                    Geometry::Spheres(_) => None,
                });
                mesh.unwrap().positions[0].z += 1e-3;
            },
        ];
        for (k, change) in changes.iter().enumerate() {
            assert_ne!(changed(change), same, "{k}");
        }
    }

    #[test]
    fn environments_differ_by_their_radiance() {
        let map = |factor: f32| {
            Environment::Map(EnvironmentMap {
                name: "map".into(),
                width: 2,
                height: 1,
                radiance: [Vec3::ONE, Vec3::X].into(),
                factor: Vec3::splat(factor),
                to_map: glam::DMat3::IDENTITY,
            })
        };
        let all =
            [Environment::Black, Environment::Uniform(Vec3::ONE), Environment::Uniform(Vec3::X), map(1.0), map(2.0)];
        let prints: Vec<_> = all.iter().map(of_environment).collect();
        for (k, print) in prints.iter().enumerate() {
            assert_eq!(prints.iter().position(|p| p == print), Some(k));
        }
        assert_eq!(of_environment(&map(1.0)), prints[3]);
    }
}
