//! Debug views: passes that show something about frames in real time, and run only in frames that show it. A view is an entry of this list,
//! `src/realtime/passes/NAME.rs`, which declares what it reads, and `shaders/NAME.glsl`, which gives each pixel a colour: the rest is made of the list.

/// Calls the macro `$callback` with all debug views, an entry each: its help text, its variant of [`DisplayMode`](super::DisplayMode), its name for `--show`,
/// its name in shaders, its module in src/realtime/passes, and the constant of its shader, which is named after the module, too.
macro_rules! debug_views {
    ($callback:ident) => {
        $callback! {
            /// BVH nodes that camera rays visit, as a heat map; needs `--tracer compute`
            Nodes = "nodes", "SHOWN_NODES", mod nodes, shader NODES;
            /// Why pixels have no history: blue was off screen, red another instance, green another depth, yellow another normal; grey has one
            Rejected = "rejected", "SHOWN_REJECTED", mod rejected, shader REJECTED;
        }
    };
}
pub(crate) use debug_views;
