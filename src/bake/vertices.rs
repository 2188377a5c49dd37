//! Values of vertices: the mean over points of the triangles around each.

use glam::Vec2;

use super::BakeSettings;
use super::cage::{Projector, SimplePoint};
use super::frames::SurfaceFrames;
use super::plan::{instances_of, triangles_of};
use super::trace::{BakePoint, PointTracer, Sampling};
use super::unwrap::scene_triangles;
use crate::error::{Error, Result};
use crate::film::Control;
use crate::ray::Hit;
use crate::scene::Scene;
use crate::scene::load::SourceFile;
use crate::tracer::Tracer;

/// Barycentric weight of a corner's point in its triangle: near the vertex, and far enough from it
/// to be on one surface alone.
const AT_CORNER: f32 = 0.8;
/// Triangles whose corners are sampled at a time.
const BATCH: usize = 1 << 18;

/// Ambient visibility of the vertices of a primitive.
pub struct BakedVertices {
    /// Index of the mesh in the file, and of the primitive in it.
    pub primitive: [usize; 2],
    /// A value for each vertex of the file; 1 for those that no triangle with an area has.
    pub values: Vec<f32>,
}

/// Bakes vertices of a scene.
pub struct VertexBaker<'a> {
    /// The scene that has them.
    pub scene: &'a Scene,
    /// Tracer of what occludes.
    pub tracer: &'a Tracer,
    /// The file that has their primitives.
    pub file: &'a SourceFile,
    /// The settings.
    pub settings: &'a BakeSettings,
    /// Where the tracer's scene is a detailed model, what finds points of it.
    pub projector: Option<Projector<'a>>,
}

impl VertexBaker<'_> {
    /// Bakes the vertices of a mesh of the scene, whose primitive the file has; also the number of
    /// rays.
    ///
    /// # Errors
    /// Those of the device, [`Error::Input`] of the file, and [`Error::Interrupted`].
    pub fn bake(&self, mesh: usize, control: &mut dyn Control) -> Result<Option<(BakedVertices, u64)>> {
        let Self { scene, tracer, file, settings, .. } = *self;
        let (Some(source), Some(triangles)) = (&scene.meshes[mesh].source, triangles_of(&scene.meshes[mesh])) else {
            return Ok(None);
        };
        let primitive = file.primitive(source.mesh, source.primitive)?;
        let numbers = scene_triangles(&primitive, triangles.indices.len()).ok_or_else(|| {
            Error::Usage(format!("mesh `{}`: triangles of the file and of the scene differ", scene.meshes[mesh].name))
        })?;
        let instances = instances_of(scene, mesh);
        let most = if settings.averages_instances { instances.len() } else { 1 };
        let bits = settings.sample_bits(1);
        let mut points = PointTracer::new(
            tracer,
            Sampling {
                occlusion: settings.occlusion,
                is_inward: false,
                has_lengths: false,
                has_directions: false,
                seed: settings.seed,
                sample_bits: bits,
            },
        )?;

        // each corner's point, weighted by the area of its triangle
        let mut sums = vec![[0.0f64; 2]; primitive.positions.len()];
        let (mut rays, all) = (0, triangles.indices.len());
        for first in (0..all).step_by(BATCH) {
            let batch: Vec<usize> = (first..(first + BATCH).min(all)).collect();
            for &instance in &instances[..most] {
                if control.should_stop()? {
                    return Err(Error::Interrupted);
                }
                let rest = 0.5 * (1.0 - AT_CORNER);
                let weights = [Vec2::new(rest, rest), Vec2::new(AT_CORNER, rest), Vec2::new(rest, AT_CORNER)];
                let records: Vec<BakePoint> = batch
                    .iter()
                    .flat_map(|&t| weights.iter().enumerate().map(move |(corner, w)| (3 * t + corner, t, *w)))
                    .map(|(number, t, w)| BakePoint {
                        instance: instance as u32,
                        primitive: t as u32,
                        u: w.x,
                        v: w.y,
                        texel: number as u32,
                        first_sample: 0,
                    })
                    .collect();
                let records = self.project(records, mesh, control)?;
                let values = points.trace(&records, control)?;
                rays += (records.len() as u64) << bits;
                for (record, sum) in records.iter().zip(values) {
                    let [t, corner] = [record.texel / 3, record.texel % 3].map(|n| n as usize);
                    let corners = primitive.triangles[numbers[t]];
                    let [a, b, c] = corners.map(|v| primitive.positions[v as usize].as_dvec3());
                    let area = (b - a).cross(c - a).length();
                    let value = f64::from(sum.value) / f64::from(1u32 << bits);
                    let sums = &mut sums[corners[corner] as usize];
                    sums[0] += area * value;
                    sums[1] += area;
                }
            }
            control.progress((first + batch.len()) as u64, all as u64);
        }
        share_at_positions(&primitive.positions, &primitive.attributes, &mut sums);
        if self.projector.is_some() {
            fill(&primitive.triangles, &mut sums);
        }
        let values = sums.iter().map(|[sum, weight]| if *weight > 0.0 { (sum / weight) as f32 } else { 1.0 });
        Ok(Some((BakedVertices { primitive: [source.mesh, source.primitive], values: values.collect() }, rays)))
    }

    /// Moves points of a mesh onto the detailed model, where there is one. Those that meet nothing
    /// are left out.
    fn project(&self, records: Vec<BakePoint>, mesh: usize, control: &mut dyn Control) -> Result<Vec<BakePoint>> {
        let Some(projector) = &self.projector else { return Ok(records) };
        let Some(frames) = SurfaceFrames::of_mesh(self.scene, mesh) else { return Ok(Vec::new()) };
        let point = |record: &BakePoint| {
            let (triangle, barycentrics) = (record.primitive as usize, Vec2::new(record.u, record.v));
            let instance = record.instance as usize;
            let surface = frames.at(triangle, barycentrics, instance);
            // a map has texture coordinates, which vertices need not have
            SimplePoint { surface, triangle, barycentrics, instance, skew: projector.uniform_skew() }
        };
        let hits = projector.project(&records.iter().map(point).collect::<Vec<_>>(), control)?;
        let moved = records.into_iter().zip(hits).filter(|(_, hit)| hit.is_hit()).map(|(record, hit)| {
            let Hit { instance, primitive, u, v, .. } = hit;
            BakePoint { instance, primitive, u, v, ..record }
        });
        Ok(moved.collect())
    }
}

/// Gives vertices without samples the mean of their neighbours in triangles, and so on to those
/// that lie farther away.
fn fill(triangles: &[[u32; 3]], sums: &mut [[f64; 2]]) {
    loop {
        let mut found = std::collections::BTreeMap::new();
        for triangle in triangles {
            let own = triangle.map(|v| sums[v as usize]);
            let known = || own.iter().filter(|[_, weight]| *weight > 0.0);
            for (v, [_, weight]) in triangle.iter().zip(&own) {
                if *weight == 0.0 && known().count() > 0 {
                    let sum: &mut [f64; 2] = found.entry(*v).or_default();
                    known().for_each(|[value, weight]| *sum = [sum[0] + value / weight, sum[1] + 1.0]);
                }
            }
        }
        if found.is_empty() {
            return;
        }
        found.into_iter().for_each(|(v, sum)| sums[v as usize] = sum);
    }
}

/// Gives vertices that differ in their texture coordinates alone one value: they are one place of
/// one smooth surface, and would show a seam.
fn share_at_positions(
    positions: &[glam::Vec3],
    attributes: &[crate::scene::load::StoredAttribute],
    sums: &mut [[f64; 2]],
) {
    // without normals each triangle is flat, and no two share a place
    let Some(normals) = attributes.iter().find(|a| a.name == "NORMAL") else { return };
    let key = |v: usize| {
        let position = positions[v].to_array().map(f32::to_bits);
        (position, &normals.bytes[v * normals.size..][..normals.size])
    };
    let mut shared = std::collections::HashMap::new();
    for (v, own) in sums.iter().enumerate() {
        let entry: &mut [f64; 2] = shared.entry(key(v)).or_default();
        entry[0] += own[0];
        entry[1] += own[1];
    }
    for (v, own) in sums.iter_mut().enumerate() {
        *own = shared[&key(v)];
    }
}

/// Values as colours: the same in red, green and blue, opaque.
pub fn colors(values: &[f32]) -> Vec<[u16; 4]> {
    let colour = |value: &f32| {
        let grey = (value.clamp(0.0, 1.0) * 65535.0).round() as u16;
        [grey, grey, grey, u16::MAX]
    };
    values.iter().map(colour).collect()
}
