//! Renders the ambient visibility of a scene: `cargo run --release --example hello_ao -- [SCENE] [IMAGE]`

use std::path::Path;

use skylit::film::NoControl;
use skylit::renderer::{RenderSettings, Renderer};
use skylit::tracer::DeviceSettings;

/// Renders a scene file or built-in scene, and returns the mean ambient visibility of its surfaces,
/// from 0 to 1.
pub fn render(scene: &str, image: &Path) -> skylit::Result<f64> {
    let mut renderer = Renderer::open(scene, &DeviceSettings::default())?;
    let mut settings = RenderSettings::default();
    settings.image.size = Some([320, 180]);
    settings.image.spp = Some(16);
    let still = renderer.still(&settings, &mut NoControl)?;
    still.save(image)?;
    Ok(still.report.surface_mean.unwrap_or(0.0))
}

fn main() -> skylit::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let scene = arguments.next().unwrap_or_else(|| "builtin:stairs".to_owned());
    let image = arguments.next().unwrap_or_else(|| "hello_ao.png".to_owned());
    let mean = render(&scene, Path::new(&image))?;
    println!("{image}: on average {:.0} % of the hemisphere is open", 100.0 * mean);
    Ok(())
}
