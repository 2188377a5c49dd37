//! Renders real-time frames of a camera that moves around a scene, and saves every tenth:
//! `cargo run --release --example frames -- [SCENE] [FOLDER]`

use std::path::Path;

use skylit::film::NoControl;
use skylit::realtime::Preset;
use skylit::realtime::frame_settings::FrameRange;
use skylit::renderer::{FramesReport, RenderSettings, Renderer};
use skylit::tracer::DeviceSettings;

/// Frames of a whole turn of the camera.
const TURN: u32 = 30;
/// One frame of so many is saved.
const SAVED: u32 = 10;

/// Renders a turn of the camera with temporal accumulation, and saves PNG images to `folder`.
pub fn render(scene: &str, folder: &Path) -> skylit::Result<FramesReport> {
    let mut renderer = Renderer::open(scene, &DeviceSettings::default())?;
    let mut settings = RenderSettings::default();
    settings.image.size = Some([320, 180]);
    settings.frames.preset = Some(Preset::Balanced);
    settings.frames.orbit = Some(TURN);
    settings.frames.frames = Some(FrameRange { first: 0, end: TURN });

    let mut frames = renderer.frames(&settings, false, &mut NoControl)?;
    while let Some(frame) = frames.advance()? {
        if frame.number % SAVED == 0 {
            let image = frames.image(&mut NoControl)?;
            let path = folder.join(format!("frame-{:02}.png", frame.number));
            skylit::output::save(&frames.picture(&image), &path)?;
        }
    }
    Ok(frames.report())
}

fn main() -> skylit::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let scene = arguments.next().unwrap_or_else(|| "builtin:cornell-box".to_owned());
    let folder = arguments.next().unwrap_or_else(|| ".".to_owned());
    let report = render(&scene, Path::new(&folder))?;
    println!("{} frames on {}", report.frames.len(), report.setup.device);
    Ok(())
}
