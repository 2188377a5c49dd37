//! Images in the window, in place of a scene: their colours and layers, values under the pointer,
//! and how far two of them are apart.

mod panel;
mod pixels;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use egui::{Context, Pos2, Rect, Vec2};

use super::layer::Layer;
use super::theme;
use super::window::WindowApp;
use crate::error::Result;
use crate::interface::ToneMap;
use crate::measure::comparison::{self, CompareOptions, Comparison};
use crate::memory::Budget;
use crate::output::{self, Channel, Image, Samples};
use crate::renderer::interactive::ViewPicture;

/// Pixels from which images are compared on a thread.
const LARGE: u64 = 1 << 18;

/// Content of the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// One of them.
    Image,
    /// The difference of the image from the reference, the largest over its channels.
    Difference,
    /// FLIP of the image against the reference: how far apart they look.
    Flip,
}

/// How values become colours.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// Stops.
    pub exposure: f32,
    pub tone_map: ToneMap,
    /// A layer or channel in place of the colours; empty: the colours.
    pub layer: String,
}

/// An image and its name.
pub struct Loaded {
    pub path: PathBuf,
    pub image: Arc<Image>,
}

/// The source of a picture: as long as it is the same, the picture is.
#[derive(Clone, Debug, PartialEq)]
struct Made {
    shown: usize,
    reference: usize,
    content: Content,
    look: Look,
}

/// How far two images are apart, or why they cannot be compared.
type Compared = std::result::Result<Arc<Comparison>, String>;

/// The images that are looked at.
pub struct Images {
    pub images: Vec<Loaded>,
    /// Index of the image that is shown, and of the one that it is compared with.
    pub shown: usize,
    pub reference: usize,
    pub content: Content,
    pub look: Look,
    /// Physical pixels of the screen per pixel of the image; 0: as large as the window allows.
    pub zoom: f32,
    /// Pixel of the image in the middle of the window; used where [`Images::zoom`] is not 0.
    pub middle: Vec2,
    /// Pixel under the pointer.
    pub pixel: Option<[u32; 2]>,
    /// The last error.
    pub message: Option<String>,
    pub closes: bool,
    display: Option<(Made, Arc<pixels::Display>)>,
    compared: Option<([usize; 2], Compared)>,
    /// A comparison that is under way.
    comparing: Option<([usize; 2], Receiver<Compared>)>,
    /// The interface, to be woken when a comparison is there.
    context: Option<Context>,
    view: Option<(pixels::Place, Arc<ViewPicture>)>,
    layers: Vec<Layer>,
}

impl Images {
    /// Reads images, of which the first is shown and the second is the reference.
    ///
    /// # Errors
    /// Those of [`output::load_within`].
    pub fn load(paths: &[PathBuf]) -> Result<Self> {
        let budget = Budget::default();
        let read =
            |path: &PathBuf| Ok(Loaded { path: path.clone(), image: Arc::new(output::load_within(path, &budget)?) });
        Ok(Self::new(paths.iter().map(read).collect::<Result<_>>()?))
    }

    /// Looks at these images, one at least.
    pub fn new(images: Vec<Loaded>) -> Self {
        let mut all = Self {
            reference: usize::from(images.len() > 1),
            images,
            shown: 0,
            content: Content::Image,
            look: Look { exposure: 0.0, tone_map: ToneMap::Linear, layer: String::new() },
            zoom: 0.0,
            middle: Vec2::ZERO,
            pixel: None,
            message: None,
            closes: false,
            display: None,
            compared: None,
            comparing: None,
            context: None,
            view: None,
            layers: Vec::new(),
        };
        all.choose_layer();
        all
    }

    /// The image that is shown.
    pub fn image(&self) -> &Image {
        &self.images[self.shown].image
    }

    /// Shows another image; a layer that it lacks gives way to its colours.
    pub fn show(&mut self, index: usize) {
        self.shown = index.min(self.images.len() - 1);
        self.choose_layer();
    }

    /// An image without colours shows its first layer.
    fn choose_layer(&mut self) {
        let names = output::layers::names(self.image());
        let is_there = names.contains(&self.look.layer.as_str());
        let has_colours = output::layers::colour_planes(self.image()).is_some();
        match is_there {
            true => {}
            false if has_colours => self.look.layer.clear(),
            false => self.look.layer = names.first().map(|n| (*n).to_owned()).unwrap_or_default(),
        }
    }

    /// Adds an image to those that are looked at, and shows it.
    pub fn add(&mut self, path: &Path) {
        match output::load_within(path, &Budget::default()) {
            Ok(image) => {
                self.images.push(Loaded { path: path.to_owned(), image: Arc::new(image) });
                if self.images.len() == 2 {
                    self.reference = 0;
                }
                self.message = None;
                self.show(self.images.len() - 1);
            }
            Err(e) => self.message = Some(e.to_string()),
        }
    }

    /// How far the image is from the reference, in words where they cannot be compared; `None`
    /// where there is no other image, and while large ones are being compared.
    pub fn comparison(&mut self) -> Option<Compared> {
        let pair = [self.shown, self.reference];
        if pair[0] == pair[1] {
            return None;
        }
        if self.compared.as_ref().is_none_or(|(of, _)| *of != pair) {
            self.compared = Some((pair, self.compare(pair)?));
        }
        self.compared.as_ref().map(|(_, compared)| compared.clone())
    }

    /// Compares two images: large ones on a thread, so that the window answers meanwhile. `None`:
    /// it is not there yet.
    fn compare(&mut self, pair: [usize; 2]) -> Option<Compared> {
        let [image, reference] = pair.map(|k| self.images[k].image.clone());
        let run = move || {
            let compared = comparison::compare(&image, &reference, &CompareOptions::default());
            compared.map(Arc::new).map_err(|e| e.to_string())
        };
        let shown = self.image();
        if u64::from(shown.width) * u64::from(shown.height) < LARGE {
            return Some(run());
        }

        // the one that is under way, or one that is started
        if let Some((_, compared)) = self.comparing.as_ref().filter(|(of, _)| *of == pair) {
            return match compared.try_recv() {
                Ok(compared) => Some(compared),
                Err(TryRecvError::Empty) => None,
                Err(TryRecvError::Disconnected) => Some(Err("the images could not be compared".into())),
            };
        }
        let (sender, receiver) = channel();
        let context = self.context.clone();
        let started = std::thread::Builder::new().name("comparison".into()).spawn(move || {
            // it may be that the window is gone
            let _ = sender.send(run());
            context.iter().for_each(Context::request_repaint);
        });
        match started {
            Ok(_) => {
                self.comparing = Some((pair, receiver));
                None
            }
            Err(e) => Some(Err(format!("no thread to compare the images on: {e}"))),
        }
    }

    /// Returns true while images are being compared.
    pub fn is_comparing(&self) -> bool {
        let pair = [self.shown, self.reference];
        let is_there = self.compared.as_ref().is_some_and(|(of, _)| *of == pair);
        !is_there && self.comparing.as_ref().is_some_and(|(of, _)| *of == pair)
    }

    /// Values of the pixel under the pointer: of an image, channel by channel.
    pub fn values(&self, index: usize) -> Option<String> {
        let image = &self.images.get(index)?.image;
        let [x, y] = self.pixel.filter(|p| p[0] < image.width && p[1] < image.height)?;
        let at = y as usize * image.width as usize + x as usize;
        let value = |channel: &Channel| match &channel.samples {
            Samples::F32(values) => format!("{} {:.5}", channel.name, values[at]),
            Samples::U32(numbers) => format!("{} {}", channel.name, numbers[at]),
        };
        let values: Vec<String> = if self.look.layer.is_empty() {
            let names = ["R", "G", "B", "Y", "A"].into_iter().filter(|n| *n != "Y" || image.f32("R").is_none());
            names.filter_map(|name| image.channels.iter().find(|c| c.name == name)).map(value).collect()
        } else {
            output::layers::channels(image, &self.look.layer).into_iter().map(value).collect()
        };
        Some(values.join("  "))
    }

    /// Runs a frame of the user interface.
    pub fn show_frame(&mut self, context: &Context) {
        theme::apply(context);
        self.context.get_or_insert_with(|| context.clone());
        panel::show(self, context);
    }

    /// Puts the picture into the part of the window that is free for it.
    fn place(&mut self, rect: Rect, scale: f32) {
        self.layers.clear();
        let Some(display) = self.displayed() else { return };
        let pixel = |x: f32| (x * scale).round() as i32;
        let area = [pixel(rect.left()), pixel(rect.top()), pixel(rect.right()), pixel(rect.bottom())];
        let size = [area[2] - area[0], area[3] - area[1]].map(|n| n.max(0) as u32);
        let place = pixels::Place { size, zoom: self.scale(rect, scale), middle: self.centre() };
        let is_new = self.view.as_ref().is_none_or(|(of, _)| *of != place);
        if is_new {
            self.view = Some((place, Arc::new(display.view(&place))));
        }
        if let Some((_, picture)) = &self.view {
            self.layers.push(Layer { picture: picture.clone(), area, clip: area });
        }
    }

    /// Physical pixels of the screen per pixel of the image.
    fn scale(&self, rect: Rect, scale: f32) -> f32 {
        let image = self.image();
        if self.zoom > 0.0 {
            return self.zoom;
        }
        let fits = rect.size() * scale / Vec2::new(image.width as f32, image.height as f32);
        fits.min_elem().max(1e-4)
    }

    /// The point of the image in the middle of the window.
    fn centre(&self) -> Vec2 {
        let image = self.image();
        if self.zoom > 0.0 { self.middle } else { Vec2::new(image.width as f32, image.height as f32) * 0.5 }
    }

    /// The point of the image at a place of the window.
    fn point_at(&self, at: Pos2, rect: Rect, scale: f32) -> Vec2 {
        self.centre() + (at - rect.center()) * scale / self.scale(rect, scale)
    }

    /// The colours of all pixels, made anew where something that they depend on has changed.
    fn displayed(&mut self) -> Option<Arc<pixels::Display>> {
        let content = if self.shown == self.reference { Content::Image } else { self.content };
        let made = Made { shown: self.shown, reference: self.reference, content, look: self.look.clone() };
        if self.display.as_ref().is_none_or(|(of, _)| *of != made) {
            let display = match content {
                Content::Image => pixels::Display::from_image(self.image(), &self.look),
                Content::Difference | Content::Flip => match self.comparison() {
                    // what was shown before stays until then
                    None => return self.display.as_ref().map(|(_, display)| display.clone()),
                    Some(Ok(comparison)) => {
                        let size = [self.image().width, self.image().height];
                        Ok(pixels::Display::from_comparison(&comparison, size, content, self.look.exposure))
                    }
                    Some(Err(e)) => Err(e),
                },
            };
            self.view = None;
            match display {
                Ok(display) => self.display = Some((made, Arc::new(display))),
                Err(e) => {
                    self.display = None;
                    self.message = Some(e);
                }
            }
        }
        self.display.as_ref().map(|(_, display)| display.clone())
    }
}

impl WindowApp for Images {
    fn frame(&mut self, context: &Context) {
        self.show_frame(context);
    }

    fn layers(&self) -> &[Layer] {
        &self.layers
    }

    fn title(&self) -> String {
        let name = self.images[self.shown].path.file_name().unwrap_or_default();
        format!("{} - skylit", name.to_string_lossy())
    }

    fn closes(&self) -> bool {
        self.closes
    }

    fn open_dropped(&mut self, files: &[egui::DroppedFile]) {
        files.iter().filter_map(|file| file.path.as_ref()).for_each(|path| self.add(path));
    }

    fn report(&mut self, message: String) {
        self.message = Some(message);
    }
}
