//! The look of the controls, dark and light: spacing, corners, one accent colour.

use egui::style::{Selection, WidgetVisuals};
use egui::{Color32, Context, CornerRadius, FontFamily, FontId, Id, Margin, Stroke, Style, TextStyle, Theme, Vec2};

/// Corners of controls and windows, points.
const CORNER: u8 = 4;
const WINDOW_CORNER: u8 = 8;

/// Colours of a theme.
struct Palette {
    panel: Color32,
    window: Color32,
    /// Where text is typed, and tracks of sliders.
    sunken: Color32,
    /// Controls: at rest, under the pointer, pressed.
    control: [Color32; 3],
    line: Color32,
    text: Color32,
    strong: Color32,
    accent: Color32,
    /// Behind what is selected, and on it.
    selected: [Color32; 2],
    warning: Color32,
    error: Color32,
}

const DARK: Palette = Palette {
    panel: Color32::from_rgb(32, 34, 38),
    window: Color32::from_rgb(40, 42, 47),
    sunken: Color32::from_rgb(22, 23, 26),
    control: [Color32::from_rgb(54, 57, 64), Color32::from_rgb(68, 72, 81), Color32::from_rgb(82, 87, 98)],
    line: Color32::from_rgb(62, 65, 73),
    text: Color32::from_rgb(205, 208, 214),
    strong: Color32::from_rgb(244, 245, 247),
    accent: Color32::from_rgb(247, 162, 68),
    selected: [Color32::from_rgb(122, 76, 24), Color32::from_rgb(255, 231, 204)],
    warning: Color32::from_rgb(242, 193, 78),
    error: Color32::from_rgb(255, 125, 112),
};

const LIGHT: Palette = Palette {
    panel: Color32::from_rgb(243, 244, 246),
    window: Color32::from_rgb(252, 252, 253),
    sunken: Color32::from_rgb(255, 255, 255),
    control: [Color32::from_rgb(222, 225, 230), Color32::from_rgb(208, 212, 219), Color32::from_rgb(193, 198, 207)],
    line: Color32::from_rgb(205, 209, 216),
    text: Color32::from_rgb(58, 62, 70),
    strong: Color32::from_rgb(20, 22, 26),
    accent: Color32::from_rgb(196, 92, 0),
    selected: [Color32::from_rgb(255, 218, 176), Color32::from_rgb(84, 40, 0)],
    warning: Color32::from_rgb(150, 92, 0),
    error: Color32::from_rgb(190, 32, 24),
};

/// Gives a context this look, once.
pub fn apply(context: &Context) {
    let id = Id::new("skylit theme");
    if context.data_mut(|d| std::mem::replace(d.get_temp_mut_or_default::<bool>(id), true)) {
        return;
    }
    for (theme, palette) in [(Theme::Dark, &DARK), (Theme::Light, &LIGHT)] {
        context.style_mut_of(theme, |style| {
            space(style);
            colour(style, palette);
        });
    }
}

/// Sizes of text, and space between and within controls.
fn space(style: &mut Style) {
    let proportional = |size: f32| FontId::new(size, FontFamily::Proportional);
    for (text, size) in
        [(TextStyle::Body, 13.0), (TextStyle::Button, 13.0), (TextStyle::Heading, 17.0), (TextStyle::Small, 10.5)]
    {
        style.text_styles.insert(text, proportional(size));
    }
    let spacing = &mut style.spacing;
    spacing.item_spacing = Vec2::new(8.0, 5.0);
    spacing.button_padding = Vec2::new(8.0, 3.0);
    spacing.interact_size = Vec2::new(40.0, 22.0);
    spacing.indent = 14.0;
    spacing.slider_width = 110.0;
    spacing.icon_width = 15.0;
    spacing.window_margin = Margin::same(12);
    spacing.menu_margin = Margin::same(6);
    spacing.scroll.floating = true;
}

/// Colours, corners and lines.
fn colour(style: &mut Style, palette: &Palette) {
    let visuals = &mut style.visuals;
    visuals.panel_fill = palette.panel;
    visuals.window_fill = palette.window;
    visuals.window_stroke = Stroke::new(1.0, palette.line);
    visuals.window_corner_radius = CornerRadius::same(WINDOW_CORNER);
    visuals.menu_corner_radius = CornerRadius::same(WINDOW_CORNER);
    visuals.extreme_bg_color = palette.sunken;
    visuals.faint_bg_color = palette.line.gamma_multiply(0.35);
    visuals.hyperlink_color = palette.accent;
    visuals.warn_fg_color = palette.warning;
    visuals.error_fg_color = palette.error;
    visuals.selection = Selection { bg_fill: palette.selected[0], stroke: Stroke::new(1.0, palette.selected[1]) };
    visuals.slider_trailing_fill = true;
    visuals.striped = false;
    visuals.indent_has_left_vline = false;
    visuals.collapsing_header_frame = false;

    // controls, from those that do nothing to those that are pressed
    let [rest, hovered, pressed] = palette.control;
    let control = |fill: Color32, text: Color32, line: Color32| WidgetVisuals {
        bg_fill: fill,
        weak_bg_fill: fill,
        bg_stroke: Stroke::new(1.0, line),
        fg_stroke: Stroke::new(1.2, text),
        corner_radius: CornerRadius::same(CORNER),
        expansion: 0.0,
    };
    let widgets = &mut visuals.widgets;
    widgets.noninteractive = control(palette.panel, palette.text, palette.line);
    widgets.inactive = control(rest, palette.text, Color32::TRANSPARENT);
    widgets.hovered = control(hovered, palette.strong, palette.accent.gamma_multiply(0.6));
    widgets.active = control(pressed, palette.strong, palette.accent);
    widgets.open = control(rest, palette.strong, palette.line);
}

/// The accent colour: for what is selected in the image.
pub fn accent(context: &Context) -> Color32 {
    if context.theme() == Theme::Dark { DARK.accent } else { LIGHT.accent }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Contrast of two colours by WCAG 2: 1 of the same, 21 of black and white.
    fn contrast(a: Color32, b: Color32) -> f32 {
        let luminance = |c: Color32| {
            let [r, g, b] = [c.r(), c.g(), c.b()].map(|v| crate::colour::srgb_decode(f32::from(v) / 255.0));
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn text_can_be_read() {
        for palette in [&DARK, &LIGHT] {
            for ground in [palette.panel, palette.window, palette.sunken] {
                for text in [palette.text, palette.strong, palette.warning, palette.error] {
                    assert!(contrast(text, ground) >= 4.5, "{text:?} on {ground:?}: {}", contrast(text, ground));
                }
            }
            for ground in palette.control {
                assert!(contrast(palette.text, ground) >= 4.5, "{ground:?}: {}", contrast(palette.text, ground));
            }
            assert!(contrast(palette.selected[1], palette.selected[0]) >= 4.5);
            assert!(contrast(palette.accent, palette.panel) >= 3.0);
        }
    }
}
