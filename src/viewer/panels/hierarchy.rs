//! The hierarchy: its choices in the panel, wireframes over the image, and the legend of the view
//! of visited nodes.

use std::ops::RangeInclusive;
use std::sync::Arc;

use egui::{Align2, Color32, ComboBox, DragValue, FontId, Pos2, Rect, Response, Sense, Slider, Stroke, Ui, Vec2};
use glam::DVec3;

use crate::output::palette;
use crate::realtime::NodeVisits;
use crate::realtime::display::DisplayMode;
use crate::viewer::app::{App, Arrangement, Second};
use crate::viewer::hierarchy::{MAX_BOXES, SceneHierarchy, ShownBoxes, TreeBox};
use crate::viewer::technique::Technique;
use crate::viewer::wireframe::{EDGES, ImageLine, Projector};

/// Most influence areas that are drawn and named.
const MAX_AREAS: usize = 24;
/// Least distance from a pinhole at which lines are drawn, as a share of the scene's size.
const NEAR: f64 = 1e-5;
/// Opacity of the farthest lines; the nearest are opaque.
const FAINT: f32 = 0.22;
/// Colours of influence areas, one after the other: those of Okabe and Ito, which the colour-blind
/// tell apart, and grey.
const AREA_COLOURS: [Color32; 8] = [
    Color32::from_rgb(230, 159, 0),
    Color32::from_rgb(86, 180, 233),
    Color32::from_rgb(0, 158, 115),
    Color32::from_rgb(240, 228, 66),
    Color32::from_rgb(213, 94, 0),
    Color32::from_rgb(204, 121, 167),
    Color32::from_rgb(0, 114, 178),
    Color32::from_rgb(170, 170, 170),
];
/// Colour of leaves: that of what is selected is another.
const LEAF: Color32 = Color32::from_rgb(250, 120, 210);
/// Colour of the ray.
const RAY: Color32 = Color32::from_rgb(255, 70, 90);
/// Numbers of nodes beside the legend.
const TICKS: [u32; 7] = [0, 4, 8, 16, 32, 64, 128];
/// Width and height of the legend's bar, points.
const BAR: Vec2 = Vec2::new(260.0, 12.0);

/// Shows what can be drawn of the hierarchy, and what it is.
pub fn show(app: &mut App, ui: &mut Ui) {
    // which boxes
    ui.horizontal(|ui| {
        let heading = ui.label("Boxes").on_hover_text(
            "Boxes of the compute tracer's binary trees, as lines over the image. The wide nodes that it visits by default join several levels of them",
        );
        let shown = app.hierarchy.boxes;
        let combo = ComboBox::from_id_salt("boxes").selected_text(shown.label()).show_ui(ui, |ui| {
            for boxes in ShownBoxes::ALL {
                ui.selectable_value(&mut app.hierarchy.boxes, boxes, boxes.label());
            }
        });
        combo.response.labelled_by(heading.id);
    });

    // which level, and how many
    let tree = app.found_hierarchy().and_then(|found| found.tree.clone().ok());
    if app.hierarchy.boxes == ShownBoxes::Level {
        let deepest = tree.as_ref().map_or(32, |tree| tree.levels.len().saturating_sub(1)).max(1);
        let mut level = app.hierarchy.level.min(deepest);
        ui.horizontal(|ui| {
            let heading = ui.label("Level").on_hover_text("Inner nodes above a box: 0 is the root");
            if whole_number(ui, &heading, &mut level, 0..=deepest, false) {
                app.hierarchy.level = level;
            }
        });
    }
    if app.hierarchy.boxes != ShownBoxes::None {
        ui.horizontal(|ui| {
            let heading = ui.label("Most boxes").on_hover_text("More make the window slower");
            whole_number(ui, &heading, &mut app.hierarchy.most, 10..=MAX_BOXES, true);
        });
    }

    // areas, and what is to be said of all of it
    ui.checkbox(&mut app.hierarchy.shows_areas, "Influence areas").on_hover_text(
        "The places from which rays of one light or camera start, as skylit bvh --areas scene derives them",
    );
    if app.hierarchy.is_shown() {
        describe(app, ui, tree);
    }
}

/// Shows a slider of a whole number and the number itself, both called as `heading` is. Returns
/// true if it was changed.
fn whole_number(
    ui: &mut Ui,
    heading: &Response,
    value: &mut usize,
    range: RangeInclusive<usize>,
    is_logarithmic: bool,
) -> bool {
    let slider = Slider::new(value, range.clone()).logarithmic(is_logarithmic).show_value(false);
    let has_slid = ui.add(slider).labelled_by(heading.id).changed();
    ui.add(DragValue::new(value).range(range)).labelled_by(heading.id).changed() || has_slid
}

/// Says what is drawn, and why something is not.
fn describe(app: &mut App, ui: &mut Ui, tree: Option<Arc<SceneHierarchy>>) {
    if app.scene.is_none() {
        return;
    }
    let tracer = app.device.tracer.0.clone();
    if !tracer.is_empty() && tracer != "compute" {
        ui.label(format!("The tracer {tracer} has a hierarchy of its own: this is the compute tracer's."));
    }
    let Some(found) = app.found_hierarchy() else {
        ui.label("The hierarchy is being built …");
        return;
    };
    if let Err(why) = &found.tree {
        ui.label(why);
    }

    // boxes
    let most = app.hierarchy.most;
    let of_them = |count: usize| if count > most { format!(" The {most} largest are drawn.") } else { String::new() };
    if let Some(tree) = tree {
        match app.hierarchy.boxes {
            ShownBoxes::None => {}
            ShownBoxes::Level => {
                let (level, row) = shown_level(app, &tree);
                let deepest = tree.levels.len() - 1;
                ui.label(format!(
                    "Level {level} of {deepest}: {} boxes, {} of them leaves.{}",
                    row.0,
                    row.1,
                    of_them(row.0)
                ));
            }
            ShownBoxes::Ray => match app.hierarchy.visits(&tree) {
                None => {
                    ui.label("Click on the image: the boxes are drawn that the ray of that pixel visits.");
                }
                Some(visits) => {
                    let (c, count) = (visits.counts, visits.boxes.len());
                    let end = visits
                        .distance
                        .map_or("It hits nothing.".to_owned(), |d| format!("It ends at a distance of {d:.4}."));
                    let first = if count > most { format!(" The first {most} are drawn.") } else { String::new() };
                    ui.label(format!(
                        "The ray visits {count} boxes, tests {} boxes and {} primitives. {end}{first}",
                        c.boxes, c.primitives
                    ));
                }
            },
        }
    }

    // areas, with their colours
    if !app.hierarchy.shows_areas {
        return;
    }
    let areas = app.found_hierarchy().map(|found| found.areas.clone()).unwrap_or_default();
    if areas.is_empty() {
        ui.label("There is no influence area.");
    }
    for (k, area) in areas.iter().take(MAX_AREAS).enumerate() {
        ui.colored_label(area_colour(k), &area.name);
    }
    if areas.len() > MAX_AREAS {
        ui.label(format!("{} more areas are not drawn.", areas.len() - MAX_AREAS));
    }
}

/// The level that is drawn, its number of boxes, and of leaves among them.
fn shown_level(app: &App, tree: &SceneHierarchy) -> (usize, (usize, usize)) {
    let level = app.hierarchy.level.min(tree.levels.len() - 1);
    (level, (tree.levels[level].count, tree.levels[level].leaves))
}

fn area_colour(k: usize) -> Color32 {
    AREA_COLOURS[k % AREA_COLOURS.len()]
}

/// Draws what is chosen over the image.
pub fn overlay(app: &mut App, ui: &Ui, rect: Rect) {
    if !app.hierarchy.is_shown() {
        return;
    }
    // as the image on the screen was rendered
    let Some(camera) = app.panes[0].progress.as_ref().and_then(|p| p.camera.clone()) else { return };
    let Some(found) = app.found_hierarchy() else { return };
    let (tree, areas) = (found.tree.clone().ok(), found.areas.clone());
    let size = app.control.as_ref().map_or(1.0, |control| control.scene_size());
    let aspect = f64::from(rect.width().max(1.0)) / f64::from(rect.height().max(1.0));
    let projector = Projector::new(&camera, aspect, NEAR * size);

    // boxes, and the ray that visits them
    let mut lines: Vec<(ImageLine, Color32)> = Vec::new();
    let mut marked: Vec<(ImageLine, Color32)> = Vec::new();
    if let Some(tree) = &tree {
        let (boxes, ray) = shown_boxes(app, tree);
        for b in &boxes {
            let corners = tree.corners(b);
            let colour = if b.is_leaf { LEAF } else { level_colour(b.level, tree.levels.len()) };
            lines.extend(frame(&projector, &corners).map(|line| (line, colour)));
        }
        marked.extend(ray.and_then(|[a, b]| projector.line(a, b)).map(|line| (line, RAY)));
    }
    if app.hierarchy.shows_areas {
        for (k, area) in areas.iter().take(MAX_AREAS).enumerate() {
            marked.extend(frame(&projector, &area.corners).map(|line| (line, area_colour(k))));
        }
    }

    // the nearest last, and the farther the fainter
    lines.sort_by(|a, b| b.0.depth.total_cmp(&a.0.depth));
    let range = lines.last().map_or(1.0, |l| l.0.depth)..=lines.first().map_or(1.0, |l| l.0.depth);
    let painter = ui.painter().with_clip_rect(rect);
    let at = |[x, y]: [f32; 2]| rect.min + rect.size() * Vec2::new(x, y);
    for (line, colour) in lines {
        // seen on white and on black
        let opacity = opacity(line.depth, range.clone());
        let shadow = Color32::from_black_alpha(130).gamma_multiply(opacity);
        for (width, colour) in [(2.6, shadow), (1.2, colour.gamma_multiply(opacity))] {
            painter.line_segment(line.ends.map(at), Stroke::new(width, colour));
        }
    }
    for (width, shadow) in [(4.0, true), (2.0, false)] {
        for (line, colour) in &marked {
            let colour = if shadow { Color32::from_black_alpha(120) } else { *colour };
            painter.line_segment(line.ends.map(at), Stroke::new(width, colour));
        }
    }
}

/// The boxes that are drawn, and the ends of the ray that visits them.
fn shown_boxes(app: &mut App, tree: &Arc<SceneHierarchy>) -> (Vec<TreeBox>, Option<[DVec3; 2]>) {
    let most = app.hierarchy.most;
    match app.hierarchy.boxes {
        ShownBoxes::None => (Vec::new(), None),
        ShownBoxes::Level => {
            let (level, _) = shown_level(app, tree);
            (tree.levels[level].largest.iter().take(most).copied().collect(), None)
        }
        ShownBoxes::Ray => {
            let size = app.control.as_ref().map_or(1.0, |control| control.scene_size());
            let Some(visits) = app.hierarchy.visits(tree) else { return (Vec::new(), None) };
            let (from, direction) = visits.ray;
            let end = from + direction * visits.distance.unwrap_or(2.0 * size);
            (visits.boxes.iter().take(most).copied().collect(), Some([from, end]))
        }
    }
}

/// The edges of a box or frustum that are in view.
fn frame<'a>(projector: &'a Projector, corners: &'a [DVec3; 8]) -> impl Iterator<Item = ImageLine> + 'a {
    EDGES.iter().filter_map(|[a, b]| projector.line(corners[*a], corners[*b]))
}

/// Colours from the root (dark) to the deepest level (bright), of which the darkest are left out:
/// lines lie on dark images, too.
fn level_colour(level: usize, levels: usize) -> Color32 {
    let share = level as f32 / levels.max(2) as f32;
    let [r, g, b] = palette::viridis(0.35 + 0.65 * share);
    Color32::from_rgb(r, g, b)
}

/// Opacity by distance, on a logarithmic scale.
fn opacity(depth: f64, range: RangeInclusive<f64>) -> f32 {
    let [near, far] = [*range.start(), *range.end()].map(|d| d.max(1e-12).ln());
    let share = ((depth.max(1e-12).ln() - near) / (far - near).max(1e-9)).clamp(0.0, 1.0);
    1.0 - (1.0 - FAINT) * share as f32
}

/// Whether an image on the screen is that of visited nodes; its index among the panes.
fn pane_of_nodes(app: &App) -> Option<usize> {
    let nodes = Technique::Buffer(DisplayMode::Nodes);
    let shows_both = app.arrangement != Arrangement::Single;
    if app.first == nodes && (shows_both || !app.shows_second) {
        return Some(0);
    }
    (app.second == Second::Technique(nodes) && (shows_both || app.shows_second)).then_some(1)
}

/// The colours of the view of visited nodes with their numbers, in the corner of the image.
pub fn legend(app: &App, ui: &Ui, rect: Rect) {
    let Some(pane) = pane_of_nodes(app) else { return };
    let counts = app.panes[pane].progress.as_ref().and_then(|p| p.step.nodes);
    let at = rect.right_bottom() - Vec2::new(10.0, 10.0);
    egui::Area::new("legend of nodes".into()).pivot(Align2::RIGHT_BOTTOM).fixed_pos(at).show(ui.ctx(), |ui| {
        egui::Frame::popup(ui.style()).show(ui, |ui| {
            ui.set_max_width(BAR.x);
            ui.label("Nodes that the camera ray visits");
            let (response, painter) = ui.allocate_painter(BAR + Vec2::new(0.0, 16.0), Sense::hover());
            response
                .widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Other, true, "Colours of 0 to 128 nodes"));
            bar(&painter, response.rect, ui.visuals().text_color());
            if let Some((mean, most)) = counts {
                ui.label(format!("Mean {mean:.1}, most {most}"));
            }
        });
    });
}

/// The bar, from no node to the last tick, with ticks beneath it.
fn bar(painter: &egui::Painter, rect: Rect, text: Color32) {
    // room for the numbers at both ends
    let margin = 10.0;
    let (left, width) = (rect.left() + margin, rect.width() - 2.0 * margin);
    let last = node_share(f64::from(TICKS[TICKS.len() - 1]));
    let steps = 130;
    for k in 0..steps {
        // up to the end, for the next one to cover: no seam is left between two
        let from = left + width * k as f32 / steps as f32;
        let [r, g, b] = palette::viridis(last as f32 * (k as f32 + 0.5) / steps as f32);
        let strip = Rect::from_min_max(Pos2::new(from, rect.top()), Pos2::new(left + width, rect.top() + BAR.y));
        painter.rect_filled(strip, 0.0, Color32::from_rgb(r, g, b));
    }
    for tick in TICKS {
        let x = left + width * (node_share(f64::from(tick)) / last) as f32;
        let ends = [Pos2::new(x, rect.top() + BAR.y), Pos2::new(x, rect.top() + BAR.y + 3.0)];
        painter.line_segment(ends, Stroke::new(1.0, text));
        let below = Pos2::new(x, rect.top() + BAR.y + 3.0);
        painter.text(below, Align2::CENTER_TOP, tick.to_string(), FontId::proportional(10.0), text);
    }
}

/// Place of a number of nodes among the colours, as shaders/nodes.glsl has it.
fn node_share(nodes: f64) -> f64 {
    nodes / (nodes + f64::from(NodeVisits::MIDDLE))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_fainter_the_farther_they_are() {
        let range = 1.0..=100.0;
        let values = [1.0, 3.0, 10.0, 50.0, 100.0].map(|d| opacity(d, range.clone()));
        assert!((values[0] - 1.0).abs() < 1e-6 && (values[4] - FAINT).abs() < 1e-6, "{values:?}");
        assert!(values.is_sorted_by(|a, b| a > b), "{values:?}");
        // all at one distance
        assert!((opacity(2.0, 2.0..=2.0) - 1.0).abs() < 1e-6);
    }

    /// The legend is about the colours that the shader writes.
    #[test]
    fn the_legend_has_the_numbers_of_the_shader() {
        let shader = include_str!("../../../shaders/nodes.glsl");
        assert!(
            shader.contains("viridis(n / (n + p.middle))"),
            "the scale of the view has changed: so must the legend"
        );
        assert!((node_share(f64::from(NodeVisits::MIDDLE)) - 0.5).abs() < 1e-9 && node_share(0.0) == 0.0);
    }
}
