//! Texture coordinates for meshes without unique ones.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use glam::Vec2;
use uvunwrap::{Atlas, Density, MeshInput, Options, Packing, Progress};

use super::BakeSettings;
use super::plan::{instances_of, triangles_of};
use crate::error::{Error, Result};
use crate::film::Control;
use crate::scene::Scene;
use crate::scene::load::{SourceFile, SourcePrimitive, is_degenerate};

/// Triangles from which on charts are packed by their bounds, which is faster and less dense.
const MANY_TRIANGLES: usize = 100_000;
/// Time between two looks at the thread that unwraps.
const POLL: Duration = Duration::from_millis(20);

/// Texture coordinates of a material's meshes.
pub struct Unwrapped {
    /// Width and height of the texture, texels.
    pub size: [u32; 2],
    /// Number of the set, which no mesh has yet.
    pub texcoord: u32,
    /// Number of charts.
    pub charts: u32,
    /// Share of the texture that charts cover.
    pub utilization: f32,
    /// Each mesh.
    pub meshes: Vec<UnwrappedMesh>,
}

/// New vertices of a primitive.
pub struct UnwrappedMesh {
    /// Index of the mesh in the file, and of the primitive in it.
    pub primitive: [usize; 2],
    /// The vertex of the file that each is a copy of.
    pub sources: Vec<u32>,
    /// Texture coordinates of each.
    pub texcoords: Vec<[f32; 2]>,
    /// Corners of all triangles of the file.
    pub triangles: Vec<[u32; 3]>,
    /// Texture coordinates of the corners of the scene's triangles.
    pub scene_corners: Vec<[Vec2; 3]>,
}

/// Makes texture coordinates for meshes that share a texture, which `label` names in messages;
/// `control` hears of the stage under way.
///
/// # Errors
/// [`Error::Interrupted`], and [`Error::Usage`] if a texture of that size has no room for all
/// charts.
pub fn unwrap(
    scene: &Scene,
    file: &SourceFile,
    meshes: &[usize],
    settings: &BakeSettings,
    label: &str,
    control: &mut dyn Control,
) -> Result<Unwrapped> {
    let failed = |reason: String| Error::Usage(format!("{label} cannot be unwrapped: {reason}"));

    // the primitives as the file has them, at the scale of their largest instance
    let mut sources = Vec::new();
    for &mesh in meshes {
        let source = scene.meshes[mesh].source.as_ref();
        let source = source.ok_or_else(|| failed("a mesh is not of the file".to_owned()))?;
        let primitive = file.primitive(source.mesh, source.primitive)?;
        let scale = instances_of(scene, mesh)
            .into_iter()
            .map(|i| scene.instances[i].object_to_world.matrix3.determinant().abs().cbrt())
            .fold(0.0, f64::max);
        sources.push(([source.mesh, source.primitive], primitive, scale as f32));
    }
    let positions: Vec<Vec<[f32; 3]>> =
        sources.iter().map(|(_, p, _)| p.positions.iter().map(|p| p.to_array()).collect()).collect();
    let inputs: Vec<MeshInput> = sources
        .iter()
        .zip(&positions)
        .map(|((_, primitive, scale), positions)| MeshInput {
            scale: if scale.is_normal() { *scale } else { 1.0 },
            ..MeshInput::new(positions, primitive.triangles.as_flattened())
        })
        .collect();

    // the charts
    let page_size = settings.size[0].max(settings.size[1]);
    let count: usize = sources.iter().map(|(_, p, _)| p.triangles.len()).sum();
    let options = Options {
        density: Density::Auto { page_size },
        // two texels on each side keep bilinear filters apart
        padding: 2.max(page_size / 1024),
        packing: if count > MANY_TRIANGLES { Packing::Fast } else { Packing::Shape },
        ..Options::default()
    };
    let atlas = generate(&inputs, &options, control)?.map_err(|e| failed(e.to_string()))?;
    if atlas.page_count > 1 {
        let charts = atlas.chart_count;
        return Err(failed(format!(
            "{charts} charts do not fit into {page_size}x{page_size} texels: choose a larger --size"
        )));
    }

    // a side that is a few texels short of the size is rounded up, as devices like textures
    let step = 4.max(page_size / 16);
    let size = [atlas.width, atlas.height].map(|side| side.next_multiple_of(step).min(page_size));
    let scale = [0, 1].map(|k| [atlas.width, atlas.height][k] as f32 / size[k] as f32);

    // a number that none of the meshes has
    let numbers = sources.iter().flat_map(|(_, p, _)| &p.attributes);
    let numbers = numbers.filter_map(|a| a.name.strip_prefix("TEXCOORD_")?.parse::<u32>().ok());
    let texcoord = numbers.max().map_or(0, |most| most + 1);

    let mut made = Vec::new();
    for ((out, (primitive, source, _)), &mesh) in atlas.meshes.into_iter().zip(&sources).zip(meshes) {
        let texcoords: Vec<[f32; 2]> = out.vertices.iter().map(|v| [v.uv[0] * scale[0], v.uv[1] * scale[1]]).collect();
        let triangles: Vec<[u32; 3]> = out.indices.as_chunks().0.to_vec();
        let count = triangles_of(&scene.meshes[mesh]).map_or(0, |t| t.indices.len());
        let scene_corners = scene_triangles(source, count)
            .ok_or_else(|| failed("triangles of the file and of the scene differ".to_owned()))?
            .into_iter()
            .map(|t| triangles[t].map(|v| Vec2::from(texcoords[v as usize])))
            .collect();
        made.push(UnwrappedMesh {
            primitive: *primitive,
            sources: out.vertices.iter().map(|v| v.xref).collect(),
            texcoords,
            triangles,
            scene_corners,
        });
    }
    Ok(Unwrapped { size, texcoord, charts: atlas.chart_count, utilization: atlas.utilization, meshes: made })
}

/// Makes the charts on a thread of its own, which `control` may end.
fn generate(
    inputs: &[MeshInput],
    options: &Options,
    control: &mut dyn Control,
) -> Result<std::result::Result<Atlas, uvunwrap::Error>> {
    let (done, total) = (AtomicU64::new(0), AtomicU64::new(1));
    let is_cancelled = AtomicBool::new(false);
    let hears = |progress: Progress| {
        // the packing does not know how many trials it takes
        let all = progress.total.unwrap_or(2 * progress.done + 1);
        done.store(progress.done as u64, Ordering::Relaxed);
        total.store(all as u64, Ordering::Relaxed);
        !is_cancelled.load(Ordering::Relaxed)
    };
    std::thread::scope(|scope| {
        let work = || uvunwrap::generate_with_progress(inputs, options, hears);
        let Ok(thread) = std::thread::Builder::new().spawn_scoped(scope, work) else {
            return Ok(uvunwrap::generate(inputs, options));
        };
        let mut stopped = Ok(());
        while !thread.is_finished() {
            std::thread::sleep(POLL);
            control.progress(done.load(Ordering::Relaxed), total.load(Ordering::Relaxed));
            if stopped.is_ok() {
                stopped = control.should_stop().and_then(|stop| if stop { Err(Error::Interrupted) } else { Ok(()) });
                is_cancelled.store(stopped.is_err(), Ordering::Relaxed);
            }
        }
        let outcome = thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        stopped.map(|()| outcome)
    })
}

/// For each triangle of the scene's mesh its index in the file: loading drops those without an
/// area, but not where they gain one by an animation.
pub fn scene_triangles(source: &SourcePrimitive, count: usize) -> Option<Vec<usize>> {
    let all = 0..source.triangles.len();
    let has_area = |&t: &usize| !is_degenerate(source.triangles[t], &source.positions);
    let kept: Vec<usize> = all.clone().filter(has_area).collect();
    if kept.len() == count {
        return Some(kept);
    }
    (all.len() == count).then(|| all.collect())
}
