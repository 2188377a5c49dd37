//! The viewer, and images, in a window.

mod cpu;
mod icon;
mod vulkan;

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use egui_winit::winit::application::ApplicationHandler;
use egui_winit::winit::dpi::LogicalSize;
use egui_winit::winit::event::{StartCause, WindowEvent};
use egui_winit::winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use egui_winit::winit::window::{Window, WindowId};

use super::app::App;
use super::layer::Layer;
use super::options::DEFAULT_SIZE;
use super::painter::Painted;
use super::remembered::Remembered;
use super::request::{EventSender, Mailbox};
use super::{Painter, ViewOptions, panels, worker};
use crate::error::{Error, Result};
use crate::gpu::threads::end_process;
use crate::stage;
use crate::terminal::interrupt;

/// Time after which it is noticed at the latest that the user has interrupted the program.
const INTERRUPT_INTERVAL: Duration = Duration::from_millis(300);
/// Time that the thread that renders has to end once the window is closed, if it is in a stage of
/// long work; and the time between two looks at it.
const PATIENCE: Duration = Duration::from_millis(300);
const LOOK: Duration = Duration::from_millis(5);
/// Smallest size of the window, points.
const MIN_SIZE: [f64; 2] = [320.0, 240.0];

/// A program in a window: its user interface, and images beneath it.
pub trait WindowApp {
    /// Runs a frame of the user interface.
    fn frame(&mut self, context: &egui::Context);

    /// The images of the last frame.
    fn layers(&self) -> &[Layer];

    /// Title of the window.
    fn title(&self) -> String;

    /// Returns true once the user has closed it.
    fn closes(&self) -> bool;

    /// Opens files that were dropped on the window.
    fn open_dropped(&mut self, files: &[egui::DroppedFile]);

    /// Tells the user of an error.
    fn report(&mut self, message: String);

    /// Notes the size of the window, in points of the display, and whether it fills the screen.
    fn resized(&mut self, _size: [u32; 2], _is_maximized: bool) {}
}

impl WindowApp for App {
    fn frame(&mut self, context: &egui::Context) {
        panels::show_frame(self, context);
    }

    fn layers(&self) -> &[Layer] {
        App::layers(self)
    }

    fn title(&self) -> String {
        self.scene.as_ref().map_or("skylit".to_owned(), |s| format!("{} - skylit", s.source))
    }

    fn closes(&self) -> bool {
        self.closes
    }

    fn open_dropped(&mut self, files: &[egui::DroppedFile]) {
        App::open_dropped(self, files);
    }

    fn report(&mut self, message: String) {
        App::report(self, message, true);
    }

    fn resized(&mut self, size: [u32; 2], is_maximized: bool) {
        let Some(remembered) = &mut self.remembered else { return };
        remembered.is_maximized = is_maximized;
        if !is_maximized {
            remembered.window = Some(size);
        }
    }
}

/// How a window is opened and painted.
#[derive(Clone, Debug)]
struct WindowOptions {
    /// Points.
    size: [u32; 2],
    is_maximized: bool,
    painter: Painter,
    /// Name of the device, and whether it has the validation layer; for [`Painter::Vulkan`].
    device: (Option<String>, bool),
}

/// Brings frames to the screen.
trait Presenter {
    /// Shows a frame: layers, and the user interface over them, in a window of `size` physical
    /// pixels, none of which is 0.
    ///
    /// # Errors
    /// Those of the window system, after which [`Presenter::recover`] is called.
    fn present(
        &mut self,
        size: [u32; 2],
        layers: &[Layer],
        context: &egui::Context,
        painted: &mut Painted,
    ) -> Result<()>;

    /// Creates the window's surface anew, after an error.
    ///
    /// # Errors
    /// Those of the window system.
    fn recover(&mut self, window: Arc<Window>, context: &egui::Context) -> Result<()>;

    /// Takes messages of the validation layer.
    fn check(&self) -> Vec<String> {
        Vec::new()
    }
}

/// Reason to wake the window.
#[derive(Debug)]
enum Wake {
    /// Something is to be shown at this time.
    At(Instant),
    /// An assistive technology asks for something.
    Access(egui_winit::accesskit_winit::Event),
}

impl From<egui_winit::accesskit_winit::Event> for Wake {
    fn from(event: egui_winit::accesskit_winit::Event) -> Self {
        Self::Access(event)
    }
}

fn no_display(error: &dyn std::fmt::Display) -> Error {
    let text = crate::terminal::console::one_line(&error.to_string());
    // winit's errors begin with the line of its source that they come from
    let reason = text.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": ")).map_or(text.as_str(), |r| r.1);
    let reason = reason.trim_end_matches(['.', ')']);
    Error::Device(format!(
        "no window can be opened here ({reason}): set DISPLAY or WAYLAND_DISPLAY, or use `skylit render`"
    ))
}

fn event_loop() -> Result<EventLoop<Wake>> {
    EventLoop::<Wake>::with_user_event().build().map_err(|e| no_display(&e))
}

/// Opens a window on a scene and returns when it is closed.
///
/// # Errors
/// [`Error::Device`] without a display; those of starting the thread that renders.
pub fn run(options: &ViewOptions) -> Result<()> {
    let event_loop = event_loop()?;
    let proxy = event_loop.create_proxy();
    let mailbox = Arc::new(Mailbox::default());
    let (sender, events) = std::sync::mpsc::channel();
    let wake = {
        let proxy = proxy.clone();
        // a window that is closed needs no waking
        Arc::new(move || drop(proxy.send_event(Wake::At(Instant::now()))))
    };
    let thread = worker::spawn(mailbox.clone(), EventSender::new(sender, wake), options.load())?;
    let device = (options.device_name.clone(), options.device.validation);
    let mut app = App::new(options, mailbox, events);
    let remembered = app.remembered.insert(Remembered::load());
    let (size, is_maximized) = match options.size {
        Some(size) => (size, false),
        None => (remembered.window.unwrap_or(DEFAULT_SIZE), remembered.is_maximized),
    };
    let window_options = WindowOptions { size, is_maximized, painter: options.painter, device };
    let outcome = show(event_loop, &mut app, window_options);
    app.quit();
    app.remembered.iter().for_each(Remembered::save);
    wait_for(thread, &outcome);
    outcome
}

/// Waits for the thread that renders. Where it is in a stage of long work, such as building a BVH,
/// which writes nothing and asks nobody, the process ends without it.
fn wait_for(thread: JoinHandle<()>, outcome: &Result<()>) {
    let start = Instant::now();
    while !thread.is_finished() {
        if start.elapsed() > PATIENCE && stage::current().is_some() {
            match outcome {
                Ok(()) => end_process(0),
                Err(Error::Interrupted) => interrupt::end_interrupted(false),
                Err(_) => {}
            }
        }
        std::thread::sleep(LOOK);
    }
    // a panic of it was an event, which the window has shown
    let _ = thread.join();
}

/// Opens a window on images and returns when it is closed. `size`: in points.
///
/// # Errors
/// [`Error::Device`] without a display.
pub fn run_images(images: &mut impl WindowApp, size: [u32; 2]) -> Result<()> {
    let options = WindowOptions { size, is_maximized: false, painter: Painter::Cpu, device: (None, false) };
    show(event_loop()?, images, options)
}

/// Opens a window and returns when it is closed.
fn show<A: WindowApp>(event_loop: EventLoop<Wake>, app: &mut A, options: WindowOptions) -> Result<()> {
    let proxy = event_loop.create_proxy();
    let context = egui::Context::default();
    {
        let proxy = proxy.clone();
        context.set_request_repaint_callback(move |info| {
            if let Some(at) = Instant::now().checked_add(info.delay) {
                let _ = proxy.send_event(Wake::At(at));
            }
        });
    }
    let mut viewer =
        Viewer { app, context, proxy, options, open: None, redraw: None, failed: None, presenter_failures: 0 };
    let outcome = event_loop.run_app(&mut viewer).map_err(|e| no_display(&e));
    viewer.failed.map_or(outcome, Err)
}

struct Viewer<'a, A> {
    app: &'a mut A,
    context: egui::Context,
    proxy: EventLoopProxy<Wake>,
    options: WindowOptions,
    open: Option<OpenWindow>,
    /// When the window is to be drawn next.
    redraw: Option<Instant>,
    failed: Option<Error>,
    presenter_failures: u32,
}

struct OpenWindow {
    presenter: Box<dyn Presenter>,
    input: egui_winit::State,
    painted: Painted,
    title: String,
    window: Arc<Window>,
}

impl<A: WindowApp> Viewer<'_, A> {
    fn open(&self, event_loop: &ActiveEventLoop) -> Result<OpenWindow> {
        let attributes = Window::default_attributes()
            .with_title("skylit")
            .with_inner_size(LogicalSize::new(self.options.size[0], self.options.size[1]))
            .with_maximized(self.options.is_maximized)
            .with_window_icon(icon::icon())
            .with_min_inner_size(LogicalSize::new(MIN_SIZE[0], MIN_SIZE[1]))
            // AccessKit wants to be there before it is seen
            .with_visible(false);
        let window = event_loop
            .create_window(attributes)
            .map_err(|e| Error::Device(format!("the window cannot be opened: {e}")))?;
        let window = Arc::new(window);
        let scale = window.scale_factor() as f32;
        let mut input = egui_winit::State::new(
            self.context.clone(),
            egui::ViewportId::ROOT,
            &window,
            Some(scale),
            window.theme(),
            None,
        );
        input.init_accesskit(event_loop, &window, self.proxy.clone());
        let presenter: Box<dyn Presenter> = match self.options.painter {
            Painter::Cpu => Box::new(cpu::CpuPresenter::new(window.clone())?),
            Painter::Vulkan => {
                let (device, validation) = self.options.device.clone();
                Box::new(vulkan::VulkanPresenter::new(window.clone(), device, validation)?)
            }
        };
        window.set_visible(true);
        Ok(OpenWindow { presenter, input, painted: Painted::default(), title: String::new(), window })
    }

    fn fail(&mut self, event_loop: &ActiveEventLoop, error: Error) {
        self.failed = Some(error);
        event_loop.exit();
    }

    /// Draws a frame.
    fn draw(&mut self, event_loop: &ActiveEventLoop) {
        let Some(open) = &mut self.open else { return };
        self.redraw = None;

        // the interface runs first: it decides what is shown
        let input = open.input.take_egui_input(&open.window);
        self.app.open_dropped(&input.dropped_files);
        let app = &mut *self.app;
        let mut output = self.context.run(input, |context| app.frame(context));
        open.input.handle_platform_output(&open.window, std::mem::take(&mut output.platform_output));
        open.painted.take(&mut output);
        if let Some(viewport) = output.viewport_output.get(&egui::ViewportId::ROOT) {
            self.redraw = Instant::now().checked_add(viewport.repaint_delay);
        }

        let title = self.app.title();
        if title != open.title {
            open.window.set_title(&title);
            open.title = title;
        }
        if self.app.closes() {
            event_loop.exit();
            return;
        }

        let size: [u32; 2] = open.window.inner_size().into();
        // a window that is minimised has no pixels
        if size[0] == 0 || size[1] == 0 {
            return;
        }
        let points = open.window.inner_size().to_logical::<u32>(open.window.scale_factor());
        self.app.resized(points.into(), open.window.is_maximized());

        match open.presenter.present(size, self.app.layers(), &self.context, &mut open.painted) {
            Ok(()) => {
                self.presenter_failures = 0;
                let messages = open.presenter.check();
                messages.into_iter().for_each(|m| self.app.report(format!("validation: {m}")));
            }
            Err(e) if self.presenter_failures > 10 => self.fail(event_loop, e),
            Err(_) => {
                // monitors come and go: the window gets another surface
                self.presenter_failures += 1;
                match open.presenter.recover(open.window.clone(), &self.context) {
                    Ok(()) => self.redraw = Some(Instant::now()),
                    Err(e) => self.fail(event_loop, e),
                }
            }
        }
    }
}

impl<A: WindowApp> ApplicationHandler<Wake> for Viewer<'_, A> {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.open.is_none() {
            match self.open(event_loop) {
                Ok(open) => {
                    open.window.request_redraw();
                    self.open = Some(open);
                }
                Err(e) => self.fail(event_loop, e),
            }
        }
    }

    fn suspended(&mut self, _: &ActiveEventLoop) {
        self.open = None;
    }

    fn new_events(&mut self, event_loop: &ActiveEventLoop, cause: StartCause) {
        if interrupt::requested() {
            self.fail(event_loop, Error::Interrupted);
        } else if matches!(cause, StartCause::ResumeTimeReached { .. })
            && self.redraw.is_some_and(|at| at <= Instant::now())
            && let Some(open) = &self.open
        {
            open.window.request_redraw();
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, wake: Wake) {
        let at = match wake {
            Wake::At(at) => at,
            Wake::Access(event) => {
                use egui_winit::accesskit_winit::WindowEvent as Access;
                match (event.window_event, &mut self.open) {
                    (Access::InitialTreeRequested, _) => self.context.enable_accesskit(),
                    (Access::ActionRequested(request), Some(open)) => open.input.on_accesskit_action_request(request),
                    (Access::AccessibilityDeactivated, _) => self.context.disable_accesskit(),
                    (Access::ActionRequested(_), None) => {}
                }
                Instant::now()
            }
        };
        self.redraw = Some(self.redraw.map_or(at, |r| r.min(at)));
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else { return };
        let response = open.input.on_window_event(&open.window, &event);
        match event {
            WindowEvent::CloseRequested | WindowEvent::Destroyed => event_loop.exit(),
            WindowEvent::RedrawRequested => self.draw(event_loop),
            WindowEvent::Resized(_) | WindowEvent::ScaleFactorChanged { .. } => open.window.request_redraw(),
            _ if response.repaint => open.window.request_redraw(),
            _ => {}
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        match self.redraw {
            Some(at) if at <= Instant::now() => {
                if let Some(open) = &self.open {
                    open.window.request_redraw();
                }
                event_loop.set_control_flow(ControlFlow::Wait);
            }
            // Ctrl-C in the terminal is no event of the window
            at => {
                let next = Instant::now() + INTERRUPT_INTERVAL;
                event_loop.set_control_flow(ControlFlow::WaitUntil(at.map_or(next, |at| at.min(next))));
            }
        }
    }
}
