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
    for Mesh { name: _, source: _, geometry, material } in &scene.meshes {
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
