//! Path-traces a scene under a light of one's own, and says how noisy the image is:
//! `cargo run --release --example path_trace -- [SCENE] [IMAGE]`

use std::path::Path;

use skylit::film::NoControl;
use skylit::output::tone_map::ToneMap;
use skylit::renderer::{RenderSettings, Renderer, StillReport};
use skylit::tracer::DeviceSettings;

/// Renders linear radiance to `image`.exr, and what a display shows of it to `image`.png.
pub fn render(scene: &str, image: &Path) -> skylit::Result<StillReport> {
    let mut renderer = Renderer::open(scene, &DeviceSettings::default())?;

    // the same settings as the options of `skylit render`
    let mut settings = RenderSettings { integrator: Some("path".parse()?), ..RenderSettings::default() };
    settings.image.size = Some([320, 180]);
    settings.image.spp = Some(16);
    settings.lighting.environment = Some("0.8,0.9,1.0".to_owned());
    settings.picture.tone_map = Some(ToneMap::Agx);

    // the EXR keeps linear radiance; the PNG has the tone map
    let still = renderer.still(&settings, &mut NoControl)?;
    still.save(&image.with_extension("exr"))?;
    still.save(&image.with_extension("png"))?;
    Ok(still.report)
}

fn main() -> skylit::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let scene = arguments.next().unwrap_or_else(|| "builtin:parade".to_owned());
    let image = arguments.next().unwrap_or_else(|| "path_trace.png".to_owned());
    let report = render(&scene, Path::new(&image))?;
    println!("{image}: mean radiance {:.3}, standard error {:.1e}", report.mean, report.mean_standard_error);
    Ok(())
}
