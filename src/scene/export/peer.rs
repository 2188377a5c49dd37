//! Scenes for programs that benchmarks run beside ours.

use std::path::Path;

use glam::{Affine2, Vec3};
use serde_json::{Value, json};

use crate::error::{Error, Result};
use crate::scene::{
    AlphaMode, Camera, Environment, Filter, Geometry, Light, LightKind, Material, Projection, Scene, TextureSlot, Wrap,
};

/// Files below a folder: what is large, each in a file of its own.
struct Files<'a> {
    folder: &'a Path,
    count: usize,
}

impl Files<'_> {
    fn add(&mut self, bytes: &[u8]) -> Result<String> {
        let name = format!("{}.bin", self.count);
        let path = self.folder.join(&name);
        std::fs::write(&path, bytes).map_err(|e| Error::write(&path, &e))?;
        self.count += 1;
        Ok(name)
    }
}

/// Writes a scene for programs that benchmarks run beside ours: `scene.json` in a folder, and a
/// file for each of its arrays. docs/reference/benchmarks.md has the format.
///
/// # Errors
/// [`Error::Output`]; [`Error::Scene`] for a light that the format does not have.
pub fn write_peer_scene(scene: &Scene, camera: &Camera, size: [u32; 2], folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|e| Error::write(folder, &e))?;
    let mut files = Files { folder, count: 0 };

    let [meshes, spheres] = geometry(scene, &mut files)?;
    let (fov_y, half_height) = match camera.projection {
        Projection::Perspective { fov_y } => (Some(fov_y), None),
        Projection::Orthographic { half_height } => (None, Some(half_height)),
    };

    // all of it goes into one file, which names the others
    let m = camera.camera_to_world;
    let text = json!({
        "size": size,
        "camera": {"rotation": m.matrix3.transpose().to_cols_array(), "position": m.translation.to_array(),
                   "fov_y": fov_y, "half_height": half_height},
        "meshes": meshes,
        "spheres": spheres,
        "materials": scene.materials.iter().map(material).collect::<Vec<_>>(),
        "textures": textures(scene, &mut files)?,
        "environment": environment(scene, &mut files)?,
        "lights": scene.lights.iter().map(light).collect::<Result<Vec<_>>>()?,
    })
    .to_string();
    let path = folder.join("scene.json");
    std::fs::write(&path, text).map_err(|e| Error::write(&path, &e))
}

/// Meshes and spheres in world space: peers need no instances.
fn geometry(scene: &Scene, files: &mut Files) -> Result<[Vec<Value>; 2]> {
    let (mut meshes, mut spheres) = (Vec::new(), Vec::new());
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh];
        let to_world = instance.object_to_world;
        match &mesh.geometry {
            Geometry::Spheres(s) => {
                let scale = to_world.matrix3.determinant().abs().cbrt();
                for sphere in s {
                    let center = to_world.transform_point3(sphere.center.as_dvec3());
                    let radius = f64::from(sphere.radius) * scale;
                    spheres.push(json!({"center": center.to_array(), "radius": radius, "material": mesh.material}));
                }
            }
            Geometry::Triangles(t) => {
                let positions: Vec<Vec3> =
                    t.positions.iter().map(|p| to_world.transform_point3(p.as_dvec3()).as_vec3()).collect();
                let normals_to_world = to_world.matrix3.inverse().transpose();
                let normals: Vec<Vec3> =
                    t.normals.iter().map(|n| (normals_to_world * n.as_dvec3()).normalize_or_zero().as_vec3()).collect();
                let mirrored = to_world.matrix3.determinant() < 0.0;
                let indices: Vec<[u32; 3]> =
                    t.indices.iter().map(|&[a, b, c]| if mirrored { [a, c, b] } else { [a, b, c] }).collect();
                meshes.push(json!({
                    "material": mesh.material,
                    "positions": files.add(bytemuck::cast_slice(&positions))?,
                    "normals": if normals.is_empty() { Value::Null } else { files.add(bytemuck::cast_slice(&normals))?.into() },
                    "uv": if t.texcoords[0].is_empty() {
                        Value::Null
                    } else {
                        files.add(bytemuck::cast_slice(&t.texcoords[0]))?.into()
                    },
                    "colors": !t.colors.is_empty(),
                    "indices": files.add(bytemuck::cast_slice(&indices))?,
                }));
            }
        }
    }
    Ok([meshes, spheres])
}

/// The scene's textures, their texels in files.
fn textures(scene: &Scene, files: &mut Files) -> Result<Vec<Value>> {
    let textures = scene.textures.iter().map(|t| {
        Ok(json!({
            // the peers' own format of 8 bits
            "texels": files.add(&t.texels.iter().flatten().map(|v| (v.min(1.0) * 255.0).round() as u8).collect::<Vec<_>>())?,
            "width": t.width,
            "height": t.height,
            "wrap": t.wrap.map(|w| match w { Wrap::Repeat => "repeat", Wrap::Mirror => "mirror", Wrap::Clamp => "clamp" }),
            "nearest": t.filter == Filter::Nearest,
        }))
    });
    textures.collect()
}

/// The environment, the texels of a map in a file.
fn environment(scene: &Scene, files: &mut Files) -> Result<Value> {
    Ok(match &scene.environment {
        Environment::Black => Value::Null,
        Environment::Uniform(c) => json!({"radiance": c.to_array()}),
        Environment::Map(map) => json!({
            "texels": files.add(bytemuck::cast_slice(&map.radiance))?,
            "width": map.width,
            "height": map.height,
            "factor": map.factor.to_array(),
            "to_map": map.to_map.transpose().to_cols_array(),
        }),
    })
}

/// A light that glTF has, too.
///
/// # Errors
/// [`Error::Scene`] for others.
fn light(l: &Light) -> Result<Value> {
    let about = l.kind.about();
    let missing = || Error::Scene(format!("light '{}': peers have no {} lights; leave it out", l.name, about.name));
    let kind = about.gltf.ok_or_else(missing)?;
    let (inner, outer) = match l.kind {
        LightKind::Spot { inner_angle, outer_angle } => (inner_angle, outer_angle),
        LightKind::Directional { angle } => (angle, 0.0),
        _ => (0.0, 0.0),
    };
    let range = l.range.is_finite().then_some(l.range);
    Ok(json!({"kind": kind, "intensity": l.intensity.to_array(), "position": l.position.to_array(),
              "direction": l.direction.to_array(), "inner": inner, "outer": outer, "range": range}))
}

fn slot(slot: &Option<TextureSlot>) -> Value {
    let Some(s) = slot else { return Value::Null };
    let Affine2 { matrix2: m, translation: t } = s.transform;
    json!({"texture": s.texture, "texcoord": s.texcoord,
           // rows
           "transform": [m.x_axis.x, m.y_axis.x, t.x, m.x_axis.y, m.y_axis.y, t.y]})
}

fn material(m: &Material) -> Value {
    let (alpha, cutoff) = match m.alpha_mode {
        AlphaMode::Opaque => ("opaque", 0.0),
        AlphaMode::Mask { cutoff } => ("mask", cutoff),
        AlphaMode::Blend => ("blend", 0.0),
    };
    json!({
        "kind": format!("{:?}", m.kind).to_lowercase(),
        "base_color": m.base_color.to_array(),
        "base_color_texture": slot(&m.base_color_texture),
        "metallic": m.metallic,
        "roughness": m.roughness,
        "metallic_roughness_texture": slot(&m.metallic_roughness_texture),
        "normal_texture": slot(&m.normal_texture),
        "normal_scale": m.normal_scale,
        "emissive": m.emissive.to_array(),
        "emissive_texture": slot(&m.emissive_texture),
        "alpha": alpha,
        "cutoff": cutoff,
        "double_sided": m.double_sided,
        "ior": m.ior,
        "specular_color": m.specular_color.to_array(),
        "transmittance": m.transmittance.to_array(),
        "unlit": m.unlit,
        // what a peer that has not heard of it must not pass over
        "layers": m.clearcoat.factor != 0.0 || m.sheen.color != Vec3::ZERO || m.transmission.factor != 0.0 || m.anisotropy.strength != 0.0 || m.iridescence.factor != 0.0 || m.diffuse_transmission.factor != 0.0 || m.retroreflection.factor != 0.0 || m.dispersion != 0.0 || m.volume_scatter != Default::default(),
    })
}
