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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::Channel;

    fn image(channels: Vec<(&str, Samples)>) -> Image {
        let channels = channels.into_iter().map(|(name, samples)| Channel { name: name.into(), samples }).collect();
        Image { width: 3, height: 2, channels, metadata: Vec::new() }
    }

    #[test]
    fn every_condition_holds() {
        let a = image(vec![("A", Samples::F32(vec![0.0, 0.5, 1.0, 1.0, 0.0, 0.0]))]);
        let b = image(vec![
            ("A", Samples::F32(vec![0.0, 0.0, 1.0, 1.0, 1.0, 0.0])),
            ("id.instance", Samples::U32(vec![9, 7, 7, 8, 7, 9])),
        ]);
        let selected = |covered, rectangle, instance| {
            let mask = MaskOptions { covered, rectangle, instance };
            mask.select(&a, &b, &[]).unwrap().counted.iter().map(|c| *c as u8).collect::<Vec<_>>()
        };
        assert_eq!(selected(false, None, None), [1; 6]);
        assert_eq!(selected(true, None, None), [0, 1, 1, 1, 1, 0]);
        assert_eq!(selected(false, Some([1, 0, 2, 2]), None), [0, 1, 1, 0, 1, 1]);
        assert_eq!(selected(false, None, Some(7)), [0, 1, 1, 0, 1, 0]);
        assert_eq!(selected(true, Some([0, 1, 3, 1]), Some(7)), [0, 0, 0, 0, 1, 0]);
        for rectangle in [[0, 0, 0, 1], [2, 0, 2, 1], [0, 1, 1, 2], [u32::MAX, 0, u32::MAX, 1]] {
            assert!(MaskOptions { rectangle: Some(rectangle), ..Default::default() }.select(&a, &b, &[]).is_err());
        }
        assert!(MaskOptions { instance: Some(7), ..Default::default() }.select(&a, &a, &[]).is_err());
        let all = MaskOptions { covered: true, rectangle: Some([0, 1, 3, 1]), instance: Some(7) };
        let name = |mask: MaskOptions, colours: &[&[f32]]| mask.select(&a, &b, colours).unwrap().name;
        assert_eq!(name(all, &[]), "covered pixels and the 3x1 pixels at 0,1 and pixels of instance 7");
        assert_eq!(name(MaskOptions { covered: false, ..Default::default() }, &[]), "all pixels");
        assert_eq!(name(MaskOptions::default(), &[&[0.0; 6]]), "covered pixels");
    }

    /// An environment is no surface, but it is seen.
    #[test]
    fn a_background_that_is_not_black_counts() {
        let coverage = Samples::F32(vec![0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
        let a = image(vec![("A", coverage.clone())]);
        let sky = [0.0, 0.5, 0.0, f32::NAN, -5e-6, f32::INFINITY];
        let mask = MaskOptions::default().select(&a, &a, &[&[0.0; 6], &sky]).unwrap();
        assert_eq!(mask.counted, [0.0, 1.0, 1.0, 1.0, 0.0, 1.0]);
        assert_eq!(mask.name, "covered pixels and background that is not black");
        // an image without alpha covers everything
        let opaque = image(vec![("Y", coverage)]);
        let mask = MaskOptions::default().select(&a, &opaque, &[]).unwrap();
        assert_eq!((mask.counted, mask.name.as_str()), (vec![1.0; 6], "all pixels"));
    }
}
