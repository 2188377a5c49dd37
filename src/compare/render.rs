//! Images that are rendered on the spot: settings from a line of words, and settings that all renders share.

use crate::error::{Error, Result};
use crate::integrators;
use crate::integrators::aov::Aov;
use crate::renderer::RenderSettings;
use crate::settings::GivenSetting;

/// The settings of renders: each line of words, like `ao --ao-radius 2 --spp 64`, over the settings that are shared. Of those each render has the ones that have an effect on it.
///
/// # Errors
/// [`Error::Usage`] for words that are no settings, settings that do not go together, and a shared setting that has no effect on any render.
pub fn settings(words: &[&str], shared: &RenderSettings) -> Result<Vec<RenderSettings>> {
    let own = words.iter().map(|w| RenderSettings::from_words(w)).collect::<Result<Vec<_>>>()?;
    let given = shared.given();
    let mut is_used = vec![own.is_empty(); given.len()];
    let mut all = Vec::new();
    for (settings, words) in own.iter().zip(words) {
        let unused: Vec<&'static str> = given
            .iter()
            .enumerate()
            .filter_map(|(k, setting)| {
                let applies = applies(setting, settings);
                is_used[k] |= applies;
                (!applies).then_some(setting.name)
            })
            .collect();
        let merged = without(shared, &unused)?.overridden_by(settings);
        merged.check().map_err(|e| Error::Usage(format!("\"{words}\": {e}")))?;
        all.push(merged);
    }
    match given.iter().zip(&is_used).find(|(_, used)| !**used) {
        Some((setting, _)) => {
            Err(Error::Usage(format!("{} has no effect on any of the renders: leave it out", setting.option())))
        }
        None => Ok(all),
    }
}

/// Does a setting have an effect on what these settings render?
fn applies(setting: &GivenSetting, settings: &RenderSettings) -> bool {
    let frames = settings.realtime_setting();
    integrators::check(std::slice::from_ref(setting), settings.integrator(), frames.as_ref()).is_ok()
}

/// Settings without those of these names.
fn without(settings: &RenderSettings, names: &[&str]) -> Result<RenderSettings> {
    let wrong = |e: serde_json::Error| Error::Usage(format!("settings cannot be put together: {e}"));
    let mut groups = serde_json::to_value(settings).map_err(wrong)?;
    for group in groups.as_object_mut().into_iter().flat_map(|g| g.values_mut()).filter_map(|g| g.as_object_mut()) {
        names.iter().for_each(|name| {
            group.remove(*name);
        });
    }
    serde_json::from_value(groups).map_err(wrong)
}

/// Adds the ids of pixels to what is rendered, for masks by instance.
pub fn add_ids(settings: &mut RenderSettings) {
    if !Aov::Ids.is_in(&settings.image.aov) {
        settings.image.aov.push(Aov::Ids);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_settings_go_where_they_have_an_effect() {
        let shared = RenderSettings::from_words("--size 20x10 --spp 3 --environment 1,1,1 --fov-y 30").unwrap();
        let [ao, path, frames] = &settings(&["ao --ao-radius 2", "path --spp 9", "balanced"], &shared).unwrap()[..] else {
            panic!()
        };
        assert_eq!((ao.image.size, ao.image.spp, ao.lighting.environment.as_deref()), (Some([20, 10]), Some(3), None));
        assert_eq!((path.image.spp, path.lighting.environment.as_deref()), (Some(9), Some("1,1,1")));
        assert_eq!((frames.image.spp, frames.camera.fov_y, frames.image.size), (None, Some(30.0), Some([20, 10])));
    }

    #[test]
    fn what_has_no_effect_is_an_error() {
        let shared = RenderSettings::from_words("--environment 1,1,1").unwrap();
        let error = |words: &[&str], shared: &RenderSettings| settings(words, shared).unwrap_err().to_string();
        assert!(error(&["ao", "ao-sky"], &shared).contains("--environment has no effect on any of the renders"));
        assert!(
            error(&["ao --max-depth 3"], &RenderSettings::default())
                .contains("\"ao --max-depth 3\": --max-depth has no effect")
        );
        assert!(error(&["oa"], &RenderSettings::default()).contains("oa"));
    }

    #[test]
    fn ids_are_added_once() {
        let mut settings = RenderSettings::from_words("ao --aov depth").unwrap();
        add_ids(&mut settings);
        add_ids(&mut settings);
        assert_eq!(settings.image.aov.len(), 2);
    }
}
