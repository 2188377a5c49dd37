//! Sliders whose number can be typed, too.

use std::ops::RangeInclusive;

use egui::{DragValue, Response, Slider, SliderClamping, Ui};

/// How the values of a slider lie on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    Linear,
    Logarithmic,
}

/// Shows a slider and its number, both called as `heading` is. A value beyond the ends stays as it
/// is until it is changed. Returns true if it was.
pub fn show(
    ui: &mut Ui,
    heading: &Response,
    value: &mut f64,
    range: RangeInclusive<f64>,
    scale: Scale,
    suffix: &str,
) -> bool {
    let is_logarithmic = scale == Scale::Logarithmic;
    let slider = Slider::new(value, range.clone()).logarithmic(is_logarithmic).clamping(SliderClamping::Edits);
    // from 0 on a logarithmic one begins somewhere
    let slider = slider.smallest_positive(1e-3 * range.end());
    let has_slid = ui.add(slider.show_value(false)).labelled_by(heading.id).changed();

    // a drag of a hundred points doubles it, or is a fifth of the way
    let span = range.end() - range.start();
    let speed = if is_logarithmic { 0.01 * value.abs().max(1e-3 * span) } else { 0.002 * span };
    let number = DragValue::new(value).range(range).clamp_existing_to_range(false).speed(speed).suffix(suffix);
    ui.add(number.max_decimals(4)).labelled_by(heading.id).changed() || has_slid
}
