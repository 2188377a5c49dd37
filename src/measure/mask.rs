//! Which pixels of two images are compared.

use crate::error::{Error, Result};
use crate::output::{Image, Samples};

/// Which pixels are compared: those that meet all conditions.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MaskOptions {
    /// Only pixels that at least one of the images covers, if both have the channel `A`: equal background would flatter every mean.
    pub covered: bool,
    /// Only pixels of this rectangle: left, top, width, height, in pixels from the upper left corner.
    pub rectangle: Option<[u32; 4]>,
    /// Only pixels that show this instance: their `id.instance` (of the reference, or of the image if the reference has none).
    pub instance: Option<u32>,
}

impl Default for MaskOptions {
    fn default() -> Self {
        Self { covered: true, rectangle: None, instance: None }
    }
}

impl MaskOptions {
    /// 1 for each pixel that is compared, 0 for the others, rows from the top. Images have the same size.
    ///
    /// # Errors
    /// [`Error::Usage`] for a rectangle that is not inside the image, and an instance where neither image has `id.instance`.
    pub fn coverage(&self, image: &Image, reference: &Image) -> Result<Vec<f32>> {
        let (width, height) = (image.width, image.height);
        let mut counted = vec![true; image.pixel_count()];
        let mut keep = |is_kept: &dyn Fn(usize) -> bool| counted.iter_mut().enumerate().for_each(|(i, c)| *c &= is_kept(i));
        if let Some((a, b)) = self.covered.then(|| image.f32("A").zip(reference.f32("A"))).flatten() {
            keep(&|i| a[i] > 0.0 || b[i] > 0.0);
        }
        if let Some(rectangle) = self.rectangle {
            let [left, top, w, h] = rectangle.map(u64::from);
            if w == 0 || h == 0 || left + w > u64::from(width) || top + h > u64::from(height) {
                return Err(Error::Usage(format!(
                    "the rectangle of {w}x{h} pixels at {left},{top} is not inside the image of {width}x{height} pixels"
                )));
            }
            let (columns, rows) = (left..left + w, top..top + h);
            keep(&|i| columns.contains(&(i as u64 % u64::from(width))) && rows.contains(&(i as u64 / u64::from(width))));
        }
        if let Some(instance) = self.instance {
            let ids = |image: &'_ Image| image.channels.iter().position(|c| c.name == "id.instance");
            let found = [reference, image].into_iter().find_map(|i| ids(i).map(|k| &i.channels[k].samples));
            let Some(Samples::U32(ids)) = found else {
                return Err(Error::Usage(
                    "neither image says which instance a pixel shows (channel id.instance): render one with --aov ids".into(),
                ));
            };
            keep(&|i| ids[i] == instance);
        }
        Ok(counted.into_iter().map(|c| f32::from(u8::from(c))).collect())
    }

    /// The mask in words; `None` if it leaves nothing out.
    pub fn description(&self, image: &Image, reference: &Image) -> Option<String> {
        let covered = self.covered && image.f32("A").is_some() && reference.f32("A").is_some();
        let parts = [
            covered.then(|| "covered pixels".to_owned()),
            self.rectangle.map(|[left, top, w, h]| format!("the {w}x{h} pixels at {left},{top}")),
            self.instance.map(|i| format!("pixels of instance {i}")),
        ];
        let parts: Vec<_> = parts.into_iter().flatten().collect();
        (!parts.is_empty()).then(|| parts.join(" and "))
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
        let of = |covered, rectangle, instance| {
            let mask = MaskOptions { covered, rectangle, instance };
            mask.coverage(&a, &b).unwrap().iter().map(|c| *c as u8).collect::<Vec<_>>()
        };
        assert_eq!(of(false, None, None), [1; 6]);
        assert_eq!(of(true, None, None), [0, 1, 1, 1, 1, 0]);
        assert_eq!(of(false, Some([1, 0, 2, 2]), None), [0, 1, 1, 0, 1, 1]);
        assert_eq!(of(false, None, Some(7)), [0, 1, 1, 0, 1, 0]);
        assert_eq!(of(true, Some([0, 1, 3, 1]), Some(7)), [0, 0, 0, 0, 1, 0]);
        for rectangle in [[0, 0, 0, 1], [2, 0, 2, 1], [0, 1, 1, 2], [u32::MAX, 0, u32::MAX, 1]] {
            assert!(MaskOptions { rectangle: Some(rectangle), ..Default::default() }.coverage(&a, &b).is_err());
        }
        assert!(MaskOptions { instance: Some(7), ..Default::default() }.coverage(&a, &a).is_err());
        let all = MaskOptions { covered: true, rectangle: Some([0, 1, 3, 1]), instance: Some(7) };
        assert_eq!(all.description(&a, &b).unwrap(), "covered pixels and the 3x1 pixels at 0,1 and pixels of instance 7");
        assert_eq!(MaskOptions { covered: false, ..Default::default() }.description(&a, &b), None);
    }
}
