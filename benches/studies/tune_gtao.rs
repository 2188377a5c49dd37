//! Fits the constants of the screen-space technique `gtao` to ray-traced ambient occlusion, over several scenes, views and occlusion settings, as XeGTAO's were
//! fitted. Prints the error before and after, of the views that the constants are fitted to and of others that they have not seen.
//!
//!     cargo run --release --example tune_gtao -- [--size WxH] [--rays N] [--views N] [--check SCENE]... [SCENE]...
//!
//! Views are those of each scene's camera, turned about the middle of the scene. The error of a view is the RMSE of frame 16 of the preset `balanced` with `--technique gtao`; the mean
//! over all views of its square, relative to that of the formula itself, is minimized by coordinate descent.

use skylit::accel::flatten::FlatScene;
use skylit::film::camera::CameraRecord;
use skylit::gpu::{Device, Options};
use skylit::integrators::ao::Occlusion;
use skylit::measure::metrics::ImagePair;
use skylit::output::parse_size;
use skylit::raster::Primary;
use skylit::realtime::{GtaoConstants, Preset, Realtime, Settings, Technique};
use skylit::renderer::settings::CameraSettings;
use skylit::renderer::survey::Survey;
use skylit::scene::{Orbit, Scene, load};
use skylit::tracer::{Needs, Tracer, TracerKind};
use skylit::{Error, Result};

/// Scenes that constants are fitted to, and scenes for the check, unless others are given.
const FITTED: [&str; 4] = ["builtin:cornell-box", "builtin:stairs", "builtin:grid:4", "builtin:terrain:20000"];
const CHECKED: [&str; 2] = ["builtin:cornell-spheres", "builtin:leaf-cards"];
/// Frames of a view, of which the last is measured.
const FRAMES: u32 = 16;
/// Radii relative to the scene's diagonal, each with binary occlusion and with a falloff to a thousandth there.
const RADII: [f64; 2] = [0.05, 0.2];
/// Rounds of coordinate descent; each halves the steps.
const ROUNDS: u32 = 4;

/// A view with its ground truth.
struct TuningView {
    scene: usize,
    camera: CameraRecord,
    settings: Settings,
    reference: Vec<f32>,
    coverage: Vec<f32>,
    /// RMSE of the formula itself.
    before: f64,
}

struct Tuner {
    tracers: Vec<(String, Tracer)>,
    views: Vec<TuningView>,
    size: [u32; 2],
}

struct Arguments {
    size: [u32; 2],
    rays: u32,
    views: u32,
    scenes: Vec<String>,
    checks: Vec<String>,
}

fn main() -> Result<()> {
    let arguments = arguments()?;
    let device = Device::open(&Options::default())?;
    let tuner = |scenes: &[String]| Tuner::new(&device, scenes, &arguments);
    println!(
        "{} ({}), {}x{}, frame {FRAMES}",
        device.info.name, device.info.driver, arguments.size[0], arguments.size[1]
    );
    let fitted = tuner(&arguments.scenes)?;
    let checked = tuner(&arguments.checks)?;
    let constants = fitted.fit()?;
    println!("{constants:?}");
    for (what, tuner) in [("fitted to", &fitted), ("not seen", &checked)] {
        tuner.print(what, constants)?;
    }
    Ok(())
}

fn arguments() -> Result<Arguments> {
    let words = |list: &[&str]| list.iter().map(|s| (*s).to_owned()).collect::<Vec<_>>();
    let mut out = Arguments { size: [240, 136], rays: 256, views: 2, scenes: Vec::new(), checks: Vec::new() };
    let wrong = |text: &str| Error::Usage(format!("{text}: see the head of benches/studies/tune_gtao.rs"));
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        let mut value = || args.next().ok_or_else(|| wrong(&arg));
        match arg.as_str() {
            "--size" => out.size = parse_size(&value()?).map_err(|e| wrong(&e))?,
            "--rays" => out.rays = value()?.parse().map_err(|_| wrong("--rays"))?,
            "--views" => out.views = value()?.parse().map_err(|_| wrong("--views"))?,
            "--check" => out.checks.push(value()?),
            _ => out.scenes.push(arg),
        }
    }
    if out.scenes.is_empty() {
        out.scenes = words(&FITTED);
    }
    if out.checks.is_empty() {
        out.checks = words(&CHECKED);
    }
    Ok(out)
}

impl Tuner {
    fn new(device: &std::sync::Arc<Device>, names: &[String], arguments: &Arguments) -> Result<Self> {
        let mut tuner = Self { tracers: Vec::new(), views: Vec::new(), size: arguments.size };
        for name in names {
            let scene = load::load(name)?;
            let tracer = Tracer::new(device, TracerKind::Compute, &FlatScene::new(&scene), Needs::default())?;
            tuner.tracers.push((name.clone(), tracer));
            tuner.add_views(&scene, arguments)?;
        }
        Ok(tuner)
    }

    fn add_views(&mut self, scene: &Scene, arguments: &Arguments) -> Result<()> {
        let aspect = f64::from(self.size[0]) / f64::from(self.size[1]);
        let (lo, hi) = scene.bounds().ok_or_else(|| Error::Scene(format!("{}: no geometry", scene.name)))?;
        let diagonal = (hi - lo).length();
        let orbit = Orbit::vertical(0.5 * (lo + hi), 360.0)?;
        let camera = CameraSettings::default().choose(&Survey::new(scene), aspect)?;
        for turn in 0..arguments.views {
            // a few degrees: the camera of a room stays inside
            let camera = CameraRecord::new(&orbit.camera_at(&camera, 15.0 * f64::from(turn)), scene.origin(), aspect);
            for radius in RADII.map(|r| r * diagonal) {
                for (radius, falloff) in [(radius, 1.0), (f64::INFINITY, 1000f64.powf(1.0 / radius))] {
                    let settings = Settings {
                        occlusion: Occlusion::new(radius, falloff),
                        primary: Some(Primary::Traced),
                        ..Preset::Balanced.settings()
                    };
                    self.add_view(camera, settings, arguments.rays)?;
                }
            }
        }
        Ok(())
    }

    fn add_view(&mut self, camera: CameraRecord, settings: Settings, rays: u32) -> Result<()> {
        let scene = self.tracers.len() - 1;
        let tracer = &self.tracers[scene].1;
        let Settings { occlusion, primary, .. } = settings;
        let truth = Settings { occlusion, primary, rays_per_pixel: rays, seed: 77, ..Preset::Reference.settings() };
        let mut realtime = Realtime::new(tracer, self.size, &truth, &[])?;
        realtime.frame(tracer, &camera, &[])?;
        let (reference, coverage) = (realtime.result()?, realtime.coverage()?);
        let settings = Settings { technique: Technique::Gtao, ..settings };
        let mut view = TuningView { scene, camera, settings, reference, coverage, before: 1.0 };
        view.before = self.rmse(&view, GtaoConstants::FORMULA)?;
        self.views.push(view);
        Ok(())
    }

    fn rmse(&self, view: &TuningView, constants: GtaoConstants) -> Result<f64> {
        let tracer = &self.tracers[view.scene].1;
        let settings = Settings { gtao_constants: constants, ..view.settings };
        let mut realtime = Realtime::new(tracer, self.size, &settings, &[])?;
        for _ in 0..FRAMES {
            realtime.frame(tracer, &view.camera, &[])?;
        }
        Ok(ImagePair::new(&realtime.result()?, &view.reference, 1, Some(&view.coverage))?.rmse())
    }

    /// Mean over views of the squared error relative to that of the formula.
    fn cost(&self, constants: GtaoConstants) -> Result<f64> {
        let mut sum = 0.0;
        for view in &self.views {
            sum += (self.rmse(view, constants)? / view.before.max(1e-6)).powi(2);
        }
        Ok(sum / self.views.len().max(1) as f64)
    }

    fn fit(&self) -> Result<GtaoConstants> {
        // first step of each constant, and its range
        type Constant = (fn(&mut GtaoConstants) -> &mut f32, f32, [f32; 2]);
        let all: [Constant; 5] = [
            (|c| &mut c.radius_scale, 0.3, [0.25, 4.0]),
            (|c| &mut c.fade, 0.3, [0.05, 1.0]),
            (|c| &mut c.step_exponent, 0.5, [1.0, 4.0]),
            (|c| &mut c.thinness, 0.4, [0.0, 4.0]),
            (|c| &mut c.visibility_exponent, 0.2, [0.5, 3.0]),
        ];
        let (mut best, mut cost) = (GtaoConstants::FORMULA, 1.0);
        for round in 0..ROUNDS {
            for (of, step, [lo, hi]) in all {
                let step = step * 0.5f32.powi(round as i32);
                for sign in [1.0, -1.0] {
                    // as long as it helps
                    let mut moved = false;
                    loop {
                        let mut next = best;
                        *of(&mut next) = (*of(&mut next) + sign * step).clamp(lo, hi);
                        if next == best {
                            break;
                        }
                        let next_cost = self.cost(next)?;
                        if next_cost >= cost {
                            break;
                        }
                        (best, cost, moved) = (next, next_cost, true);
                    }
                    if moved {
                        break;
                    }
                }
            }
            println!("round {}: relative squared error {cost:.4}, {best:?}", round + 1);
        }
        Ok(best)
    }

    fn print(&self, what: &str, constants: GtaoConstants) -> Result<()> {
        println!("{what}: RMSE of the formula, and with the constants");
        for (k, (name, _)) in self.tracers.iter().enumerate() {
            let (mut before, mut after, mut count) = (0.0, 0.0, 0.0);
            for view in self.views.iter().filter(|v| v.scene == k) {
                before += view.before.powi(2);
                after += self.rmse(view, constants)?.powi(2);
                count += 1.0;
            }
            let root = |sum: f64| (sum / count).sqrt();
            println!("  {name:28} {:.4} {:.4}", root(before), root(after));
        }
        Ok(())
    }
}
