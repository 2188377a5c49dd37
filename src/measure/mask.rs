//! Which pixels of two images are compared.

use crate::error::{Error, Result};
use crate::output::{Image, Samples};

/// Values up to this are black where no surface is: frames in real time leave a few millionths
/// beside edges, where alpha is 0.
const MAX_BLACK: f32 = 1e-4;

/// Which pixels are compared: those that meet all conditions.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MaskOptions {
    /// Only pixels that at least one of the images covers, or in which one shows a background that
    /// is not black, if both have the channel `A`: equal black would flatter every mean.
    pub covered: bool,
    /// Only pixels of this rectangle: left, top, width, height, in pixels from the upper left
    /// corner.
    pub rectangle: Option<[u32; 4]>,
    /// Only pixels that show this instance: their `id.instance` (of the reference, or of the image
    /// if the reference has none).
    pub instance: Option<u32>,
}

/// The pixels of two images that are compared.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    /// Which these are, in words.
    pub name: String,
    /// 1 for each pixel that is compared, 0 for the others, rows from the top.
    pub counted: Vec<f32>,
}

impl Default for MaskOptions {
    fn default() -> Self {
        Self { covered: true, rectangle: None, instance: None }
    }
}

impl MaskOptions {
    /// The pixels that are compared. Images have the same size. `colours`: the samples that are
    /// compared, where they are colours; an environment shows in them where no surface does.
    ///
    /// # Errors
    /// [`Error::Usage`] for a rectangle that is not inside the image, and an instance where neither
    /// image has `id.instance`.
    pub fn select(&self, image: &Image, reference: &Image, colours: &[&[f32]]) -> Result<Mask> {
        let (width, height) = (image.width, image.height);
        let mut counted = vec![true; image.pixel_count()];
        let mut conditions = Vec::new();

        // what surfaces or a background cover
        let mut keep =
            |is_kept: &dyn Fn(usize) -> bool| counted.iter_mut().enumerate().for_each(|(i, c)| *c &= is_kept(i));
        if let Some((a, b)) = self.covered.then(|| image.f32("A").zip(reference.f32("A"))).flatten() {
            let is_covered = |i: usize| a[i] > 0.0 || b[i] > 0.0;
            // what is not a number is not black
            let is_black = |v: f32| v.abs() <= MAX_BLACK;
            let is_background = |i: usize| !is_covered(i) && !colours.iter().all(|c| is_black(c[i]));
            let has_background = (0..image.pixel_count()).any(is_background);
            keep(&|i| is_covered(i) || is_background(i));
            let background = if has_background { " and background that is not black" } else { "" };
            conditions.push(format!("covered pixels{background}"));
        }

        // parts of the image
        if let Some(rectangle) = self.rectangle {
            let [left, top, w, h] = rectangle.map(u64::from);
            if w == 0 || h == 0 || left + w > u64::from(width) || top + h > u64::from(height) {
                return Err(Error::Usage(format!(
                    "the rectangle of {w}x{h} pixels at {left},{top} is not inside the image of {width}x{height} pixels"
                )));
            }
            let (columns, rows) = (left..left + w, top..top + h);
            conditions.push(format!("the {w}x{h} pixels at {left},{top}"));
            keep(&|i| {
                columns.contains(&(i as u64 % u64::from(width))) && rows.contains(&(i as u64 / u64::from(width)))
            });
        }
        if let Some(instance) = self.instance {
            let ids = |image: &'_ Image| image.channels.iter().position(|c| c.name == "id.instance");
            let found = [reference, image].into_iter().find_map(|i| ids(i).map(|k| &i.channels[k].samples));
            let Some(Samples::U32(ids)) = found else {
                return Err(Error::Usage(
                    "neither image says which instance a pixel shows (channel id.instance): render one with --aov ids"
                        .into(),
                ));
            };
            conditions.push(format!("pixels of instance {instance}"));
            keep(&|i| ids[i] == instance);
        }
        let name = if conditions.is_empty() { "all pixels".to_owned() } else { conditions.join(" and ") };
        Ok(Mask { name, counted: counted.into_iter().map(|c| f32::from(u8::from(c))).collect() })
    }
}
