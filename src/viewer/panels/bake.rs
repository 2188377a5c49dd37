//! The dialog *Bake*: where the values go, of which map, and how well they are sampled.

use egui::{DragValue, Ui, WidgetInfo, WidgetType};

use super::menu;
use crate::viewer::app::App;
use crate::viewer::bake_preview::{BakePreview, Shown};
use crate::viewer::baking::{BakePlace, BakeWanted, BakedMap};
use crate::viewer::dialog::Dialog;
use crate::viewer::rounding::round_length;

/// Sizes that are offered, texels.
const SIZES: [u32; 6] = [256, 512, 1024, 2048, 4096, 8192];
/// Greatest side of a texture, texels.
const MAX_SIDE: u32 = 16_384;
/// Height of the dialog's title, of its buttons and of margins, points.
const BESIDES: f32 = 120.0;
/// Least height of the preview's picture, points.
const LEAST_HEIGHT: f32 = 60.0;

/// The dialog as it opens.
pub fn dialog(app: &App) -> Dialog {
    let wanted = app.default_bake();
    Dialog::Bake(file_name(app, &wanted), wanted)
}

/// The output unless another is typed.
fn file_name(app: &App, wanted: &BakeWanted) -> String {
    let source = app.scene.as_ref().map_or("", |s| s.source.as_str());
    wanted.file_name(&menu::stem(app), source)
}

/// Shows the controls. The name of the output follows until another is typed.
pub fn numbers(app: &App, ui: &mut Ui, text: &mut String, wanted: &mut BakeWanted) {
    let has_own_name = *text != file_name(app, wanted);

    // where it goes, and the map
    ui.horizontal(|ui| {
        ui.label("Into");
        for place in BakePlace::ALL {
            ui.radio_value(&mut wanted.place, place, place.label()).on_hover_text(place.help());
        }
    });
    ui.horizontal(|ui| {
        let heading = ui.label("Map");
        let is_image = wanted.place == BakePlace::Image;
        ui.add_enabled_ui(is_image, |ui| {
            let list = egui::ComboBox::from_id_salt("map").selected_text(wanted.map().label()).show_ui(ui, |ui| {
                for map in BakedMap::ALL {
                    let item = ui.selectable_label(map == wanted.image_map, map.label()).on_hover_text(map.help());
                    if item.clicked() && map != wanted.image_map {
                        (wanted.image_map, wanted.share) = (map, None);
                    }
                }
            });
            list.response.labelled_by(heading.id).on_disabled_hover_text("Models hold ambient occlusion alone");
        });
    });

    // texels and samples
    if wanted.place != BakePlace::Vertices {
        ui.horizontal(|ui| {
            let heading = ui.label("Texture size");
            let name = |side: u32| format!("{side} x {side}");
            let list = egui::ComboBox::from_id_salt("texels").selected_text(name(wanted.size)).show_ui(ui, |ui| {
                for side in SIZES {
                    ui.selectable_value(&mut wanted.size, side, name(side));
                }
            });
            list.response.labelled_by(heading.id);
            let side = ui.add(DragValue::new(&mut wanted.size).range(1..=MAX_SIDE).suffix(" texels"));
            side.widget_info(|| WidgetInfo::labeled(WidgetType::DragValue, true, "Texels"));
        });
    }
    let map = wanted.map();
    if map.has_samples() {
        ui.horizontal(|ui| {
            let is_of_corners = wanted.place == BakePlace::Vertices;
            let heading = ui.label(if is_of_corners { "Samples per corner" } else { "Samples per texel" });
            let most = wanted.most_samples();
            ui.add(DragValue::new(&mut wanted.spp).range(1..=most)).labelled_by(heading.id);
        });
        reach(app, ui, wanted);
    }

    // the rest
    ui.horizontal(|ui| {
        if wanted.place == BakePlace::Texture {
            ui.checkbox(&mut wanted.is_atlas, "Atlas").on_hover_text("One texture for all materials\n--atlas");
        }
        if wanted.can_denoise() {
            ui.checkbox(&mut wanted.is_denoised, "Denoise")
                .on_hover_text("Filter noise in the texture, not across edges or charts (biased)\n--denoise");
        }
        if map.has_samples() {
            ui.checkbox(&mut wanted.has_ground, "Ground")
                .on_hover_text("A plane under the scene occludes, too; traced images do not have it\n--ground");
        }
    });
    if wanted.place != BakePlace::Image {
        ui.checkbox(&mut wanted.is_shown, "Show the model when it is baked").on_hover_text(
            "Opens it with what was baked on the left and traced ambient occlusion on the right, unless another scene was opened meanwhile",
        );
    }

    if !has_own_name {
        *text = file_name(app, wanted);
    }
}

/// Shows the button of the preview, and the preview; returns true if one is asked for.
pub fn preview(app: &App, ui: &mut Ui, wanted: &BakeWanted) -> bool {
    if wanted.place == BakePlace::Image {
        return false;
    }
    let mut is_asked = false;
    ui.horizontal(|ui| {
        let hint = "Bakes few texels and samples, and shows the model from here: neither changes the scene";
        is_asked = ui.button("Preview").on_hover_text(hint).clicked();
        let shown = app.bake_preview.as_ref().map(BakePreview::shown);
        match &shown {
            Some(Shown::Progress(what)) => ui.label(what),
            Some(Shown::Failure(why)) => ui.label(*why),
            Some(Shown::Picture(_)) if app.bake_preview.as_ref().is_some_and(|p| p.wanted != *wanted) => {
                ui.label("of other numbers")
            }
            _ => ui.label("few texels and samples"),
        };
    });
    if let Some(Shown::Picture(picture)) = app.bake_preview.as_ref().map(BakePreview::shown) {
        // the buttons below stay within the window, and so does the title
        let room = ui.ctx().content_rect().height() - ui.min_rect().height() - BESIDES;
        let image = egui::Image::new(picture).max_height(room.max(LEAST_HEIGHT)).shrink_to_fit();
        ui.add(image.alt_text("Preview of the baked model"));
    }
    is_asked
}

/// How far rays go: a radius as the view has it, or a share of the scene.
fn reach(app: &App, ui: &mut Ui, wanted: &mut BakeWanted) {
    let (map, size) = (wanted.map(), app.control.as_ref().map_or(1.0, |c| c.scene_size()));
    if let Some(own) = map.default_share() {
        ui.horizontal(|ui| {
            let heading = ui.label("Length of rays");
            let mut percent = 100.0 * wanted.share.unwrap_or(own);
            let number = DragValue::new(&mut percent).range(0.01..=100.0).speed(0.1).suffix(" % of the diagonal");
            if ui.add(number).labelled_by(heading.id).changed() {
                wanted.share = Some(percent / 100.0);
            }
        });
    } else if map.has_radius() {
        ui.horizontal(|ui| {
            let mut is_limited = wanted.radius.is_finite();
            let check = ui.checkbox(&mut is_limited, "Radius").on_hover_text(
                "AO radius in scene units, at first that of the view: hits beyond do not occlude\n--ao-radius",
            );
            if check.changed() {
                wanted.radius = if is_limited { round_length(0.1 * size) } else { f64::INFINITY };
            }
            if is_limited {
                let range = round_length(1e-3 * size)..=round_length(2.0 * size);
                let number = DragValue::new(&mut wanted.radius).range(range).speed(2e-3 * size).suffix(" units");
                // as the view has it, until it is changed here
                let number = number.clamp_existing_to_range(false);
                ui.add(number).labelled_by(check.id);
            }
        });
    }
}
