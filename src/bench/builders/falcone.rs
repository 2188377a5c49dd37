//! The placements of Falcone (2024) again: local trees by his four variants, in his measure, beside
//! what he measured.

use std::path::Path;
use std::time::Instant;

use glam::{DAffine3, DVec3, Vec3};
use serde::Deserialize;

use super::BuilderSession;
use crate::accel::flatten::FlatScene;
use crate::accel::lab::builder::MAX_LEAF;
use crate::accel::lab::influence::{Placement, PlacementKind};
use crate::accel::lab::local::{FallbackStart, LocalTrees, TopLevelKind};
use crate::accel::lab::streams::random;
use crate::accel::lab::{Body, Builder, HeuristicChoice, LabRay, Query, RayDistribution, Shape, Visits, traverse};
use crate::accel::{Aabb, BuildPreset};
use crate::bench::chart::distinct;
use crate::bench::record::{plain, quantity};
use crate::bench::scenes::shared_folder;
use crate::error::{Error, Result};
use crate::files;
use crate::scene::load;
use crate::terminal::interrupt;

/// His variants with their names in his tables.
const VARIANTS: [(HeuristicChoice, &str); 4] = [
    (HeuristicChoice::SahLongest, "SAH+LSPH"),
    (HeuristicChoice::PahSpfh, "PAH+SPFH"),
    (HeuristicChoice::SahSpfh, "SAH+SPFH"),
    (HeuristicChoice::PahLongest, "PAH+LSPH"),
];
/// Rays of a placement that names no number.
const RAYS: usize = 1000;
/// Side of the cube from which corners of random triangles are drawn: with it as large a share of
/// rays hits them as in his runs.
const RANDOM_SIZE: f64 = 1.5;

/// A row of his results.
#[derive(Clone, Debug, Deserialize)]
pub struct Run {
    scene: String,
    area: String,
    orient: String,
    variant: String,
    real_cost_with_fallback: f64,
    real_cost_without_fallback: f64,
    fallback_bvh_cost: f64,
    hit_percentage: f64,
}

/// Reads his results.
///
/// # Errors
/// [`Error::Input`] for a file that is missing or lacks a column.
pub fn read_runs(path: &Path) -> Result<Vec<Run>> {
    let wrong = |e: csv::Error| {
        Error::input(path, format!("is no table of Falcone's runs ({e}): leave --runs out, or give falcone_runs.csv"))
    };
    csv::Reader::from_reader(files::read(path)?.as_slice()).deserialize().collect::<Result<_, _>>().map_err(wrong)
}

/// A placement and a variant: our costs, and his where they are known.
pub struct Pair {
    part: String,
    variant: HeuristicChoice,
    /// Whether the geometry is that of his files.
    is_his_geometry: bool,
    /// Costs of the local tree, with his fallback, and of the whole tree alone; then with a
    /// fallback from the exit, and of whole trees by all axes and by default.
    ours: [f64; 6],
    his: Option<[f64; 3]>,
}

/// The name of a scene in the record.
pub fn title(name: &str) -> String {
    format!("Falcone: {name}")
}

/// Measures the placements of a scene.
pub fn scene(
    session: &mut BuilderSession,
    name: &str,
    placements: &[&Placement],
    runs: &[Run],
    pairs: &mut Vec<Pair>,
) -> Result<()> {
    session.phase(format!("{name}: loading"));
    let (body, about) = body(name)?;
    let is_his_geometry = ["Wood", "Suzanne", "Cottage", "CottageWalls"].contains(&name);
    let title = title(name);
    session.record.scene(&title).about = format!("{} primitives; {about}", body.shapes.len());
    let whole = Builder::Heuristic(HeuristicChoice::SahLongest.heuristic(RayDistribution::Uniform));
    let boxes = body.boxes();
    let whole = whole.tree(&boxes, 2);
    // stronger baselines than his: all axes, and what tracers build
    let all_axes = Builder::Heuristic(HeuristicChoice::Sah.heuristic(RayDistribution::Uniform)).tree(&boxes, 2);
    let default = Builder::Preset(BuildPreset::Default).tree(&boxes, MAX_LEAF);
    for (k, placement) in placements.iter().enumerate() {
        // a placement: its rays, and their cost in the whole tree
        let kind = match placement.kind {
            PlacementKind::Plane => "plane",
            PlacementKind::Point => "point",
        };
        let part = format!("{kind}, {}", placement.orientation);
        session.phase(format!("{name}: {part}"));
        let count = if placement.rays == 0 { RAYS } else { placement.rays };
        let at = (0..count).map(|i| [0, 1].map(|a| random(i + 100_003 * k, 20 + a)));
        let rays = placement.rays_through(DVec3::ZERO, at);
        let mean = |visits: Visits| visits.cost() / rays.len() as f64;
        let sum = |all: &[Visits]| all.iter().map(Visits::cost).sum::<f64>() / rays.len() as f64;
        let (whole_cost, hits) = costs(&whole, &body, &rays);
        let whole_cost = sum(&whole_cost);
        let [all_axes_cost, default_cost] = [&all_axes, &default].map(|tree| sum(&costs(tree, &body, &rays).0));

        // each variant: a local tree, alone, with his fallback, and with ours from the exit on
        for (variant, his_name) in VARIANTS {
            let heuristic = variant.heuristic(RayDistribution::Uniform);
            let area = placement.area(DVec3::ZERO);
            let start = Instant::now();
            let top = (TopLevelKind::List, FallbackStart::Exit);
            let local = LocalTrees::build(&body, &whole, vec![area], heuristic, top);
            let seconds = start.elapsed().as_secs_f64();
            let tree = &local.locals()[0].tree;
            let (alone, local_hits) = costs(tree, &body, &rays);
            let missed: Vec<LabRay> = rays.iter().zip(&local_hits).filter(|(_, hit)| !**hit).map(|(r, _)| *r).collect();
            let alone = sum(&alone);
            let with_fallback = alone + sum(&costs(&whole, &body, &missed).0);
            let from_exit = local.visits(&rays, Query::Exhaustive);
            let is_run = |r: &&Run| {
                r.scene == name
                    && r.area.eq_ignore_ascii_case(kind)
                    && r.orient.eq_ignore_ascii_case(&placement.orientation)
                    && r.variant == his_name
            };
            let run = runs.iter().find(is_run);
            let his = run.map(|r| [r.real_cost_without_fallback, r.real_cost_with_fallback, r.fallback_bvh_cost]);
            let mut row = session.record.row(&title, &part, variant.name());
            row.exact(quantity::RAY_COST, alone).exact(plain("his", ""), his.map(|h| h[0]));
            row.exact(plain("with fallback", ""), with_fallback)
                .exact(plain("his with fallback", ""), his.map(|h| h[1]));
            let from_exit = mean(from_exit.local.plus(from_exit.whole));
            row.exact(plain("from the exit", ""), from_exit);
            row.exact(plain("whole tree", ""), whole_cost).exact(plain("his whole tree", ""), his.map(|h| h[2]));
            row.exact(plain("all axes", ""), all_axes_cost).exact(plain("default", ""), default_cost);
            let share = hits.iter().filter(|h| **h).count() as f64 / rays.len() as f64;
            row.exact(plain("hits", ""), share).exact(plain("his hits", ""), run.map(|r| r.hit_percentage));
            row.exact(plain("build", "ms"), 1e3 * seconds);
            row.exact(plain("primitives", ""), tree.primitive_indices.len() as f64);
            let ours = [alone, with_fallback, whole_cost, from_exit, all_axes_cost, default_cost];
            pairs.push(Pair { part: part.clone(), variant, is_his_geometry, ours, his });
        }
        interrupt::check()?;
        session.advance((k + 1) as f64 / placements.len() as f64);
    }
    Ok(())
}

/// Visits of each ray without an early out, and whether it hits.
fn costs(tree: &obvhs::bvh2::Bvh2, body: &Body, rays: &[LabRay]) -> (Vec<Visits>, Vec<bool>) {
    let each = |ray: &LabRay| {
        let mut visits = Visits::default();
        let hit = traverse::trace(tree, body, ray, Query::Exhaustive, &mut visits);
        (visits, hit.is_some())
    };
    rays.iter().map(each).unzip()
}

/// Means over scenes beside his, and how ours and his go together.
pub fn summarize(session: &mut BuilderSession, pairs: &[Pair]) -> Result<()> {
    if pairs.is_empty() {
        return Ok(());
    }
    let name = "Falcone: all placements";
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    for part in distinct(pairs.iter().map(|p| p.part.as_str())) {
        for (variant, _) in VARIANTS {
            let own: Vec<&Pair> = pairs.iter().filter(|p| p.part == part && p.variant == variant).collect();
            let mut row = session.record.row(name, part, variant.name());
            let titles = ["cost", "with fallback", "whole tree", "from the exit", "all axes", "default"];
            for (k, quantity) in titles.into_iter().enumerate() {
                let ours: Vec<f64> = own.iter().map(|p| p.ours[k]).collect();
                let his: Vec<f64> = own.iter().filter_map(|p| p.his?.get(k).copied()).collect();
                row.exact(plain(quantity, ""), mean(&ours));
                let title = if k == 0 { "his".to_owned() } else { format!("his {quantity}") };
                row.exact(plain(&title, ""), (his.len() == own.len()).then(|| mean(&his)));
            }
        }
    }

    // over placements: one number a variant, and one for all
    let variants: Vec<Option<HeuristicChoice>> = VARIANTS.iter().map(|v| Some(v.0)).chain([None]).collect();
    for (part, is_wanted) in [("correlation, his files", true), ("correlation, other files and seeds", false)] {
        for &variant in &variants {
            let own = pairs.iter().filter(|p| p.is_his_geometry == is_wanted && variant.is_none_or(|v| v == p.variant));
            let both: Vec<(f64, f64)> = own.filter_map(|p| p.his.map(|h| (p.ours[0], h[0]))).collect();
            if both.len() < 3 {
                continue;
            }
            let mut row = session.record.row(name, part, variant.map_or("all", HeuristicChoice::name));
            let logs: Vec<(f64, f64)> =
                both.iter().filter(|p| p.0 > 0.0 && p.1 > 0.0).map(|p| (p.0.ln(), p.1.ln())).collect();
            row.exact(plain("Pearson", ""), pearson(&both)).exact(plain("Pearson of logarithms", ""), pearson(&logs));
            row.exact(plain("Spearman", ""), pearson(&ranks(&both)));
            let ratios: Vec<f64> = logs.iter().map(|p| p.0 - p.1).collect();
            row.exact(plain("mean ratio to his", ""), mean(&ratios).exp()).exact(plain("runs", ""), both.len() as f64);
        }
    }
    session.show_scene(name)
}

/// Correlation of pairs of numbers; 0 where one of them does not vary.
fn pearson(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len().max(1) as f64;
    let (x, y) = (pairs.iter().map(|p| p.0).sum::<f64>() / n, pairs.iter().map(|p| p.1).sum::<f64>() / n);
    let sum = |f: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|p| f(p.0 - x, p.1 - y)).sum::<f64>();
    let both = sum(&|a, _| a * a) * sum(&|_, b| b * b);
    if both > 0.0 { sum(&|a, b| a * b) / both.sqrt() } else { 0.0 }
}

/// The places of both numbers of each pair among all.
fn ranks(pairs: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let rank = |values: Vec<f64>| -> Vec<f64> {
        // equal values share the mean of their places
        let below = |v: f64| values.iter().filter(|w| **w < v).count() as f64;
        let equal = |v: f64| values.iter().filter(|w| **w == v).count() as f64;
        values.iter().map(|&v| below(v) + (equal(v) - 1.0) * 0.5).collect()
    };
    let (x, y) = (rank(pairs.iter().map(|p| p.0).collect()), rank(pairs.iter().map(|p| p.1).collect()));
    x.into_iter().zip(y).collect()
}

/// The primitives of one of his scenes, and whence they are.
fn body(name: &str) -> Result<(Body, String)> {
    let file = |path: &str, scale: f64| -> Result<(Body, String)> {
        let path = shared_folder().join(path);
        let mut scene = load::load(&path.to_string_lossy())?;
        if scale != 1.0 {
            let by = DAffine3::from_scale(DVec3::splat(scale));
            scene.instances.iter_mut().for_each(|i| i.object_to_world = by * i.object_to_world);
        }
        let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let about = if scale == 1.0 { file } else { format!("{file}, scaled by {scale}") };
        let flat = FlatScene::new(&scene);
        let moved = flat.origin;
        let body = Body::from_scene(&flat)?;
        if moved != DVec3::ZERO {
            return Err(Error::Scene(format!("{name}: lies too far from the origin for its placements")));
        }
        Ok((body, about))
    };
    match name {
        "Wood" => file("falcone/WoodScene.obj", 1.0),
        "Suzanne" => file("falcone/MonkeyModel.obj", 1.0),
        "Cottage" => file("falcone/Cottage.obj", 1.0),
        "CottageWalls" => file("falcone/CottageWalls.obj", 1.0),
        "Sponza" => {
            let (body, about) = file("sponza/sponza.glb", SPONZA_SCALE)?;
            Ok((moved(&body, SPONZA_CORNER), about + ", and moved to where his planes are"))
        }
        "Crowd" => {
            let (monkey, _) = file("falcone/MonkeyModel.obj", 1.0)?;
            Ok((crowd(&monkey), "a crowd of Suzannes placed by seed, as the figures of his are not there".into()))
        }
        "Random100" => Ok((random_triangles(100), "triangles by seed".into())),
        "Random1000" => Ok((random_triangles(1000), "triangles by seed".into())),
        _ => Err(Error::Usage(format!(
            "influence areas name the scene `{name}`, which is none of Falcone's: use `skylit bvh SCENE --areas FILE.json`"
        ))),
    }
}

/// Scale from the file's Sponza to his, whose file is not there: his planes are 22 high, 32 wide
/// and reach 50 far, and nearly all of their rays hit something.
const SPONZA_SCALE: f64 = 0.136;
/// The corner of its bounds there, for the same reason.
const SPONZA_CORNER: Vec3 = Vec3::new(-9.0, 0.0, -16.6);

/// A body of triangles whose lower corner is put somewhere else.
fn moved(body: &Body, corner: Vec3) -> Body {
    let bounds = body.boxes().into_iter().fold(Aabb::EMPTY, Aabb::union);
    let by = corner - bounds.min;
    let triangle = |shape: &Shape| match shape {
        Shape::Triangle(corners) => Some(corners.map(|p| p + by)),
        Shape::Sphere(..) => None,
    };
    Body::from_triangles(body.shapes.iter().filter_map(triangle).collect())
}

/// Triangles within a cube of side 10.
fn random_triangles(count: usize) -> Body {
    let triangle = |i: usize| {
        let triple = |k: u32| DVec3::new(random(i, k), random(i, k + 1), random(i, k + 2));
        let at = triple(0) * 10.0;
        [3, 6, 9].map(|k| (at + (triple(k) - 0.5) * RANDOM_SIZE).as_vec3())
    };
    Body::from_triangles((0..count).map(triangle).collect())
}

/// Rows of figures that stand close together, as high as his areas: a body and a head of Suzanne.
fn crowd(monkey: &Body) -> Body {
    let mut triangles = Vec::new();
    for k in 0..16 * 12 {
        let (column, row) = (k % 16, k / 16);
        let at = Vec3::new(
            column as f32 * 1.3 - 8.0 + 0.65 * (row % 2) as f32 + 0.3 * random(k, 30) as f32,
            1.0 + 0.3 * random(k, 31) as f32,
            row as f32 * 1.5 - 5.0 + 0.4 * random(k, 32) as f32,
        );
        let (sin, cos) = ((random(k, 33) * std::f64::consts::TAU) as f32).sin_cos();
        for shape in &monkey.shapes {
            if let Shape::Triangle(corners) = shape {
                let turned = |p: Vec3| Vec3::new(cos * p.x + sin * p.z, p.y, cos * p.z - sin * p.x);
                triangles.push(corners.map(|p| at + turned(p) * Vec3::new(0.6, 1.0, 0.6)));
                triangles.push(corners.map(|p| at + Vec3::Y * 1.6 + turned(p) * 0.6));
            }
        }
    }
    Body::from_triangles(triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlations_of_known_numbers() {
        let line: Vec<(f64, f64)> = (0..10).map(|k| (f64::from(k), 3.0 * f64::from(k) + 1.0)).collect();
        assert!((pearson(&line) - 1.0).abs() < 1e-12);
        let bent: Vec<(f64, f64)> = line.iter().map(|&(x, _)| (x, -x.powi(3))).collect();
        assert!((pearson(&ranks(&bent)) + 1.0).abs() < 1e-12 && pearson(&bent) > -0.95);
        assert_eq!(pearson(&[(1.0, 2.0), (1.0, 3.0)]), 0.0);
        assert_eq!(ranks(&[(5.0, 1.0), (5.0, 2.0), (1.0, 3.0)]), [(1.5, 0.0), (1.5, 1.0), (0.0, 2.0)]);
    }

    #[test]
    fn scenes_by_seed_are_what_they_say() {
        assert_eq!(random_triangles(100).shapes.len(), 100);
        assert_eq!(random_triangles(100).shapes, random_triangles(1000).shapes[..100]);
        assert!(body("Teapot").unwrap_err().to_string().contains("Teapot"));
    }
}
