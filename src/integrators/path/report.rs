//! The report of a path-traced image.

use serde_json::json;

use super::settings::MAX_DEPTH;
use super::{PathOptions, PathResult, TextureFilter};
use crate::accel::flatten::FlatScene;
use crate::integrators::{IntegratorReport, RenderJob};
use crate::interface::PathFeature;
use crate::scene::{Environment, Scene};
use crate::tracer::{BuildStats, Tracer};

/// Description of the environment, for metadata.
pub(super) fn environment_text(scene: &Scene, options: &PathOptions) -> String {
    match &scene.environment {
        _ if options.view.is_some() => "none".into(),
        _ if options.white_sky.is_some() => "white".into(),
        Environment::Black => "black".into(),
        Environment::Uniform(c) => format!("{}, {}, {}", c.x, c.y, c.z),
        Environment::Map(map) => map.name.clone(),
    }
}

/// Returns true if any surface emits.
fn emits(flat: &FlatScene) -> bool {
    flat.scene.meshes.iter().any(|m| flat.scene.materials[m.material].emissive != glam::Vec3::ZERO)
}

/// Composes the report of a path-traced image.
pub(super) fn report(
    tracer: &Tracer,
    flat: &FlatScene,
    job: &RenderJob,
    o: &PathOptions,
    result: &PathResult,
) -> IntegratorReport {
    // Lines for people.
    let (image, stats) = (&result.image, tracer.stats());
    let paths = image.primary_rays;
    let rays = paths + result.bounce_rays + result.shadow_rays + result.ambient_rays;
    let per_second = |n: u64| {
        let millions = n as f64 / image.trace_seconds.max(1e-9) / 1e6;
        // of small images on a busy machine, too
        if millions < 0.1 {
            format!("{millions:.1e}").parse().unwrap_or(millions).to_string()
        } else {
            format!("{millions:.2}")
        }
    };
    let mut lines = vec![format!(
        "{} Mpaths/s, {} Mrays/s; {:.2} rays per path, {:.2} of them shadow rays; longest path {} bounces ({})",
        per_second(paths),
        per_second(rays),
        rays as f64 / paths.max(1) as f64,
        result.shadow_rays as f64 / paths.max(1) as f64,
        result.longest_path,
        if o.max_depth >= MAX_DEPTH { "no limit".to_owned() } else { format!("limit {}", o.max_depth) },
    )];
    lines.extend(o.remarks());

    // Explanations of what was compiled.
    let shading = tracer.features().shading.unwrap_or_default();
    let mut explanations = vec![
        compiled("materials require", joined(shading.bsdfs.labels(), shading.materials.labels())),
        compiled("textures beside base colours:", shading.textures.labels()),
        compiled("lights and options require", joined(result.light_kinds.labels(), result.features.labels())),
        mip_levels(o, &stats),
        format!("paths by {}", result.schedule),
    ];
    explanations.push(match result.lights {
        0 => "no light sampling: there are no lights, or --sampling does not use it".into(),
        n => format!("{n} lights, sampled by {}", chosen_by(result)),
    });

    // The record for programs.
    let record = json!({
        "environment": environment_text(job.scene, o),
        "mip_levels": stats.mip_levels,
        "mip_bytes": stats.mip_bytes,
        "energy_compensation": job.settings.path.energy_compensation,
        "not_finite": image.film.not_finite,
        "lights": result.lights,
        "light_tree": result.light_tree,
        "rays": {
            "primary": image.primary_rays,
            "skipped_primary": image.skipped_primary_rays,
            "bounce": result.bounce_rays,
            "shadow": result.shadow_rays,
            "ambient": result.ambient_rays,
        },
        "longest_path": result.longest_path,
    });
    let record = o.record().into_iter().chain(record.as_object().cloned().unwrap_or_default()).collect();
    IntegratorReport { lines, explanations, record, warnings: warnings(flat, o, image.film.not_finite, image.spp) }
}

/// How lights are chosen.
fn chosen_by(result: &PathResult) -> String {
    let has = |feature| result.features.contains(feature);
    let ways = [
        (result.light_tree, "a light tree"),
        (has(PathFeature::LightChoice), "the irradiance of distant ones"),
        (
            has(PathFeature::LightGroups) && !has(PathFeature::LightSplit),
            "the irradiance of placed and of distant ones",
        ),
        (has(PathFeature::LightSplit), "one placed and one distant light at first vertices, by irradiance at others"),
    ];
    let ways: Vec<_> = ways.into_iter().filter_map(|(is_used, way)| is_used.then_some(way)).collect();
    if ways.is_empty() { "no choice".into() } else { ways.join("; ") }
}

fn warnings(flat: &FlatScene, o: &PathOptions, not_finite: u64, spp: u32) -> Vec<String> {
    let mut warnings = Vec::new();
    if not_finite > 0 {
        warnings.push(format!(
            "{not_finite} of {} samples were not finite and were ignored: please report this scene",
            u64::from(spp) * u64::from(o.samples.size[0]) * u64::from(o.samples.size[1])
        ));
    }
    let scene = flat.scene;
    let dark = scene.environment == Environment::Black && scene.lights.is_empty() && !emits(flat);
    let ambient = o.ambient.is_some_and(|a| a.color != glam::Vec3::ZERO);
    if o.view.is_none() && o.white_sky.is_none() && !ambient && dark {
        warnings.push("the scene has no light, and the image is black: give --environment FILE or R,G,B".into());
    }
    warnings
}

fn mip_levels(o: &PathOptions, stats: &BuildStats) -> String {
    match o.texture_filter {
        TextureFilter::Bilinear => "mip levels: unused (--texture-filter ray-cone uses them)".into(),
        TextureFilter::RayCone if stats.mip_levels == 0 => "mip levels: none, no surface has a texture".into(),
        TextureFilter::RayCone => {
            format!("mip levels: up to {}, {} bytes beside the first", stats.mip_levels, stats.mip_bytes)
        }
    }
}

/// Joins the labels of two sets.
fn joined(a: [Vec<&'static str>; 2], b: [Vec<&'static str>; 2]) -> [Vec<&'static str>; 2] {
    let ([required, other], [more_required, more_other]) = (a, b);
    [[required, more_required].concat(), [other, more_other].concat()]
}

/// Lists the features that are compiled in, and those that are specialized out.
fn compiled(what: &str, labels: [Vec<&'static str>; 2]) -> String {
    let [required, other] = labels.map(|labels| if labels.is_empty() { "nothing".into() } else { labels.join(", ") });
    format!("{what} {required}; specialized out: {other}")
}
