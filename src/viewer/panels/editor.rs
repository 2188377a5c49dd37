//! Editors of settings, made from the settings themselves: names, help and values are those of the
//! command line.

use egui::{ComboBox, DragValue, Response, Ui};

use clap::Args;
use clap::error::ErrorKind;

use crate::renderer::RenderSettings;
use crate::settings::{Setting, Value};

/// Name of a setting for people: `Max depth`.
pub fn title(name: &str) -> String {
    let mut words = name.replace('_', " ");
    if let Some(first) = words.get_mut(0..1) {
        first.make_ascii_uppercase();
    }
    if let Some(rest) = words.strip_prefix("Ao ") {
        return format!("AO {rest}");
    }
    words
}

/// Help of a setting, and how it is called on the command line.
fn help(setting: &Setting) -> String {
    format!("{}\n--{}", setting.help, setting.name.replace('_', "-"))
}

/// Shows settings, a line each. `effective`: the values that hold where none is given, by name.
/// Settings without an editor are left out. Returns true if one was changed.
pub fn edit(ui: &mut Ui, settings: Vec<Setting>, effective: &serde_json::Value) -> bool {
    let mut changed = false;
    for mut setting in settings {
        if matches!(setting.value, Value::Other) {
            continue;
        }

        // a flag is a tick alone
        let default = effective.get(setting.name);
        let (is_given, help) = (setting.is_given(), help(&setting));
        ui.horizontal(|ui| {
            if let Value::Flag(flag) = &mut setting.value {
                changed |= ui.checkbox(flag, title(setting.name)).on_hover_text(&help).changed();
                return;
            }

            // the others are a label, a value, and a way back to the default
            let label = ui.label(title(setting.name)).on_hover_text(&help);
            let name = setting.name;
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let reset = egui::Button::new("↺").small();
                let reset = ui.add_enabled(is_given, reset).on_hover_text("Back to the default");
                reset.widget_info(|| {
                    egui::WidgetInfo::labeled(egui::WidgetType::Button, is_given, format!("Reset {}", title(name)))
                });
                if reset.clicked() {
                    setting.clear();
                    changed = true;
                    return;
                }

                // the value's control
                let response = match &mut setting.value {
                    Value::Count(count) => number(ui, name, count, default, 0.2, 0..=u32::MAX),
                    Value::Number(value) => number(ui, name, value, default, 0.01, f64::NEG_INFINITY..=f64::INFINITY),
                    Value::Choice(choice) => {
                        let all = choice.alternatives();
                        let selected = choice.selected();
                        let shown = selected.and_then(|k| all.get(k)).map(|a| a.0);
                        let shown = shown.or_else(|| default.and_then(|d| d.as_str())).unwrap_or("default").to_owned();
                        let combo = ComboBox::from_id_salt(("setting", name)).selected_text(shown);
                        let response = combo.show_ui(ui, |ui| {
                            for (k, (name, help)) in all.iter().enumerate() {
                                if ui.selectable_label(selected == Some(k), *name).on_hover_text(*help).clicked() {
                                    choice.select(Some(k));
                                    changed = true;
                                }
                            }
                        });
                        response.response
                    }
                    // it has a control of its own
                    Value::Length(_) | Value::Flag(_) | Value::Other => return,
                };
                changed |= response.labelled_by(label.id).on_hover_text(&help).changed();
            });
        });
    }
    changed
}

/// Returns true if the command line takes a value of a setting, by its own range.
fn is_accepted(name: &str, value: f64) -> bool {
    let command = RenderSettings::augment_args(clap::Command::new("settings").no_binary_name(true));
    let outcome = command.try_get_matches_from([format!("--{}={value}", name.replace('_', "-"))]);
    // what it lacks besides is no matter of the value
    !outcome.is_err_and(|e| matches!(e.kind(), ErrorKind::ValueValidation | ErrorKind::InvalidValue))
}

/// A number that is dragged or typed; changing it gives it, from the default on, unless the command
/// line would refuse it.
fn number<T: egui::emath::Numeric>(
    ui: &mut Ui,
    name: &str,
    given: &mut Option<T>,
    default: Option<&serde_json::Value>,
    speed: f64,
    range: std::ops::RangeInclusive<T>,
) -> Response {
    let default = default.and_then(serde_json::Value::as_f64);
    let mut value = given.unwrap_or_else(|| T::from_f64(default.unwrap_or(0.0)));
    let mut drag = DragValue::new(&mut value).speed(speed).range(range);
    if given.is_none() && default.is_none() {
        drag = drag.custom_formatter(|_, _| "default".into());
    }
    let response = ui.add(drag);
    if response.changed() && is_accepted(name, value.to_f64()) {
        *given = Some(value);
    }
    response
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_ranges_of_the_command_line() {
        for (name, good, bad) in [
            ("rays_per_pixel", 2.0, 0.0),
            ("history", 8.0, 0.0),
            ("filter_radius", 16.0, 17.0),
            ("environment_scale", 0.5, -1.0),
            ("sky_albedo", 0.5, 1.5),
        ] {
            assert!(is_accepted(name, good) && !is_accepted(name, bad), "{name}");
        }
    }
}
