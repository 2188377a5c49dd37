//! MESH.bin: `u32 nv, u32 nt, f32 xyz[nv], u32 abc[nt]`, little-endian. The triangle soup that
//! other tracers read.

use std::path::Path;

use glam::{DAffine3, Vec3};

use super::{ExportStats, icosphere, write_buffered};
use crate::error::{Error, Result};
use crate::files;
use crate::scene::{Geometry, Instance, MAX_COORDINATE, Material, Mesh, Scene, TriangleMesh};

/// All triangles of `scene` in the world space of its file, as single-precision positions and
/// indices.
///
/// Instances are expanded in their order, each with the vertices and the triangle order of its mesh
/// (no corner is moved, also not under mirroring transforms), so that the n-th triangle over all
/// instances is triangle n here. Spheres are tessellated.
///
/// # Errors
/// [`Error::Scene`] when there are more vertices than 32-bit indices reach.
pub fn mesh_bin(scene: &Scene) -> Result<(Vec<Vec3>, Vec<[u32; 3]>)> {
    let spheres = scene.sphere_count();
    let ball = if spheres > 0 { icosphere::icosphere(icosphere::level(spheres)) } else { (Vec::new(), Vec::new()) };
    let geometries = || scene.instances.iter().map(|i| (i, &scene.meshes[i.mesh].geometry));
    let vertices: usize = geometries()
        .map(|(_, g)| match g {
            Geometry::Triangles(t) => t.positions.len(),
            Geometry::Spheres(s) => s.len() * ball.0.len(),
        })
        .sum();
    if u32::try_from(vertices).is_err() {
        return Err(Error::Scene(format!("{}: {vertices} vertices are too many for MESH.bin", scene.name)));
    }
    let mut positions = Vec::with_capacity(vertices);
    let mut indices: Vec<[u32; 3]> =
        Vec::with_capacity((scene.triangle_count() + spheres * ball.1.len() as u64) as usize);
    let mut append = |to_world: &DAffine3, from: &mut dyn Iterator<Item = Vec3>, triangles: &[[u32; 3]]| {
        let first = positions.len() as u32;
        // identity must not round
        let identity = *to_world == DAffine3::IDENTITY;
        positions.extend(from.map(|p| if identity { p } else { to_world.transform_point3(p.as_dvec3()).as_vec3() }));
        indices.extend(triangles.iter().map(|t| t.map(|i| i + first)));
    };
    for (instance, geometry) in geometries() {
        match geometry {
            Geometry::Triangles(t) => append(&instance.object_to_world, &mut t.positions.iter().copied(), &t.indices),
            Geometry::Spheres(spheres) => {
                for s in spheres {
                    let mut points = ball.0.iter().map(|&p| s.center + s.radius * p);
                    append(&instance.object_to_world, &mut points, &ball.1);
                }
            }
        }
    }
    Ok((positions, indices))
}

/// Writes [`mesh_bin`] to a file, which appears only when it is complete.
///
/// # Errors
/// As [`mesh_bin`], and [`Error::Output`].
pub fn write_mesh_bin(scene: &Scene, path: &Path) -> Result<ExportStats> {
    let (positions, indices) = mesh_bin(scene)?;
    write_buffered(path, |out| {
        for n in [positions.len(), indices.len()] {
            out.write_all(&(n as u32).to_le_bytes())?;
        }
        for p in &positions {
            out.write_all(&p.to_array().map(f32::to_bits).map(u32::to_le_bytes).concat())?;
        }
        for t in &indices {
            out.write_all(&t.map(u32::to_le_bytes).concat())?;
        }
        Ok(())
    })?;
    let mut written = ExportStats { triangles: indices.len() as u64, ..ExportStats::default() };
    let spheres = scene.sphere_count();
    if spheres > 0 {
        let each = 20u64 << (2 * icosphere::level(spheres));
        written.warnings.push(format!("{spheres} spheres become {each} triangles each: MESH.bin has no spheres"));
    }
    Ok(written)
}

/// Reads a MESH.bin as a scene of one flat-shaded mesh. Number and order of the triangles are those
/// of the file: degenerate ones stay.
///
/// # Errors
/// [`Error::Input`] for a file that is missing, of the wrong length, or that holds positions which
/// are not finite or indices out of range; [`Error::Scene`] when it has no triangles.
pub fn read_mesh_bin(path: &Path) -> Result<Scene> {
    let bytes = files::read(path)?;

    // a header of two numbers says the size of the file
    let words = bytes.as_chunks::<4>().0;
    let (nv, nt) = match words {
        [nv, nt, ..] => (u32::from_le_bytes(*nv), u32::from_le_bytes(*nt)),
        _ => return Err(Error::input(path, "is not a MESH.bin: it has no header")),
    };
    let expected = 8 + 12 * (u64::from(nv) + u64::from(nt));
    if bytes.len() as u64 != expected {
        let have = bytes.len();
        return Err(Error::input(
            path,
            format!("is not a MESH.bin: {nv} vertices and {nt} triangles take {expected} bytes, but it has {have}"),
        ));
    }
    if nt == 0 {
        return Err(Error::Scene(format!("{}: the mesh has no triangles: nothing to render", path.display())));
    }

    let (positions, indices) = words[2..].as_chunks::<3>().0.split_at(nv as usize);
    let positions: Vec<Vec3> = positions.iter().map(|p| p.map(f32::from_le_bytes).into()).collect();
    let indices: Vec<[u32; 3]> = indices.iter().map(|t| t.map(u32::from_le_bytes)).collect();

    // values that would break what comes after
    if let Some(i) = positions.iter().position(|p| !p.is_finite()) {
        return Err(Error::input(path, format!("the position of vertex {i} is not finite (NaN or infinite)")));
    }
    if let Some(i) = positions.iter().position(|p| f64::from(p.abs().max_element()) > MAX_COORDINATE) {
        return Err(Error::input(
            path,
            format!("the position of vertex {i} is beyond {MAX_COORDINATE:e} units: scale the mesh down"),
        ));
    }
    if let Some(t) = indices.iter().position(|t| t.iter().any(|&i| i >= nv)) {
        return Err(Error::input(
            path,
            format!("triangle {t} refers to a vertex beyond the last, {}", nv.saturating_sub(1)),
        ));
    }

    // a scene of one mesh
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let geometry = Geometry::Triangles(TriangleMesh { positions, indices, ..Default::default() });
    Ok(Scene {
        meshes: vec![Mesh { name: name.clone(), geometry, material: 0, source: None }],
        instances: vec![Instance { name: name.clone(), mesh: 0, object_to_world: DAffine3::IDENTITY }],
        materials: vec![Material::default()],
        name,
        ..Scene::default()
    })
}
