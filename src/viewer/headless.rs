//! The viewer without a window: a script is its user, and what it shows is painted by the CPU into
//! memory.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use egui::{Pos2, RawInput, Rect, Vec2};

use super::app::App;
use super::layer::{BACKGROUND, FrameBuffer};
use super::options::DEFAULT_SIZE;
use super::painter::{CpuPainter, Painted};
use super::request::{EventSender, Mailbox};
use super::script::{Script, Section};
use super::{ViewOptions, panels, worker};
use crate::error::Result;
use crate::output::png;

/// Least time of a frame of the user interface, as a display of 60 Hz has it.
const FRAME: Duration = Duration::from_micros(16_667);

/// Runs a script to its end and returns the figures of its sections.
///
/// # Errors
/// [`crate::Error::CheckFailed`] for what the script expects and is not so; those of reading it,
/// and of writing screenshots.
pub fn run(options: &ViewOptions, script: &Path) -> Result<Vec<Section>> {
    let mut script = Script::load(script)?;
    let mailbox = Arc::new(Mailbox::default());
    let (sender, events) = std::sync::mpsc::channel();
    let woken = Arc::new(AtomicBool::new(true));
    let wake = {
        let woken = woken.clone();
        Arc::new(move || woken.store(true, Ordering::Relaxed))
    };
    let thread = worker::spawn(mailbox.clone(), EventSender::new(sender, wake), options.load())?;
    let context = egui::Context::default();
    context.enable_accesskit();
    let mut app = App::new(options, mailbox, events);
    let outcome = drive(&context, &mut app, &mut script, options.size.unwrap_or(DEFAULT_SIZE), &woken);
    app.quit();
    // a panic of it was an event, which the script has seen
    let _ = thread.join();
    outcome.map(|()| script.sections().to_vec())
}

/// Frames are made as a window makes them: when there is input, when the renderer has news, and
/// when the user interface asks for one.
fn drive(
    context: &egui::Context,
    app: &mut App,
    script: &mut Script,
    size: [u32; 2],
    woken: &AtomicBool,
) -> Result<()> {
    // in pixels; and the display's scale
    let (mut size, mut scale, start) = (size, 1.0, Instant::now());
    let mut redraw = Some(start);
    let (mut painter, mut painted, mut words) = (CpuPainter::default(), Painted::default(), Vec::new());
    loop {
        let frame_start = Instant::now();

        // the size of the window in points, which are larger when the text is
        let pixels_per_point = scale * context.zoom_factor();
        let screen = Rect::from_min_size(Pos2::ZERO, Vec2::new(size[0] as f32, size[1] as f32) / pixels_per_point);
        let mut input =
            RawInput { screen_rect: Some(screen), time: Some(start.elapsed().as_secs_f64()), ..Default::default() };
        input.viewports.entry(egui::ViewportId::ROOT).or_default().native_pixels_per_point = Some(scale);

        // without anything to do the loop sleeps, as a window does
        let Some(requests) = script.input(&mut input, app)? else { return Ok(()) };
        let has_input = !input.events.is_empty() || !input.dropped_files.is_empty() || requests.screenshot.is_some();
        let is_due = redraw.is_some_and(|at| at <= frame_start);
        let is_woken = woken.swap(false, Ordering::Relaxed);
        if !has_input && !is_due && !is_woken && requests.resize.is_none() && requests.scale.is_none() {
            std::thread::sleep(FRAME);
            continue;
        }

        // one frame, as a window shows it
        app.open_dropped(&input.dropped_files);
        let mut output = context.run(input, |context| panels::show_frame(app, context));
        painted.take(&mut output);
        script.observe(&output, app);
        let pixels = size.map(|n| n as usize);
        words.resize(pixels[0] * pixels[1], 0);
        painter.paint(
            &mut FrameBuffer { size: pixels, words: &mut words },
            BACKGROUND,
            app.layers(),
            context,
            &mut painted,
        );
        script.observe_time(frame_start.elapsed());

        // requests of the script
        if let Some(path) = requests.screenshot {
            let rgb: Vec<u8> = words.iter().flat_map(|w| [(w >> 16) as u8, (w >> 8) as u8, *w as u8]).collect();
            png::write_rgb(&path, &rgb, size[0], size[1])?;
        }
        if let Some(wanted) = requests.resize {
            size = wanted.map(|n| ((n as f32 * scale).round() as u32).clamp(1, 16384));
            woken.store(true, Ordering::Relaxed);
        }
        if let Some(wanted) = requests.scale {
            size = size.map(|n| ((n as f32 * wanted / scale).round() as u32).clamp(1, 16384));
            scale = wanted;
            woken.store(true, Ordering::Relaxed);
        }

        // the interface says when it wants to be shown again
        let delay = output.viewport_output.get(&egui::ViewportId::ROOT).map(|v| v.repaint_delay);
        redraw = delay.and_then(|delay| frame_start.checked_add(delay));
        if app.closes {
            script.end(app);
            return Ok(());
        }
        std::thread::sleep(FRAME.saturating_sub(frame_start.elapsed()));
    }
}
