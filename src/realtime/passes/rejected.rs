//! `rejected`: colours for why pixels have no history, by the tests of temporal accumulation.

use super::debug::DebugView;
use crate::error::Error;
use crate::realtime::resources::Resource;
use crate::realtime::settings::Technique;

/// The view.
pub const VIEW: DebugView = DebugView {
    reads: &[
        Resource::Camera,
        Resource::Scene,
        Resource::Guide,
        Resource::Surface,
        Resource::Normals,
        Resource::PreviousPosition,
    ],
    previous: &[Resource::Guide, Resource::History],
    check: |settings| match settings.technique {
        Technique::Larsen => Err(Error::Usage(
            "--show rejected shows tests of histories that --preset larsen does not make: choose another --show".into(),
        )),
        _ => Ok(()),
    },
    ..DebugView::OF_PIXELS
};
