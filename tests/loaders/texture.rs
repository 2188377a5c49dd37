//! Lookups of textures.

use glam::Vec2;
use skylit::interface::Wrap;
use skylit::scene::texture::{Filter, Texture};

/// Black and white texels, side by side.
fn black_and_white(filter: Filter, wrap: Wrap) -> Texture {
    let texels = vec![0u8, 0, 0, 255, 255, 255, 255, 255].into();
    Texture { name: String::new(), width: 2, height: 1, texels, wrap: [wrap; 2], filter }
}

#[test]
fn textures_are_interpolated_and_wrapped() {
    let red = |filter, wrap, u| black_and_white(filter, wrap).look_up_srgb(Vec2::new(u, 0.3)).x;
    for (u, nearest) in [(0.1, 0.0), (0.6, 1.0), (-0.1, 1.0), (1.2, 0.0)] {
        assert_eq!(red(Filter::Nearest, Wrap::Repeat, u), nearest, "{u}");
    }
    // centres of texels are at a quarter and three quarters
    for (wrap, u, linear) in [
        (Wrap::Repeat, 0.25, 0.0),
        (Wrap::Repeat, 0.5, 0.5),
        (Wrap::Repeat, 0.0, 0.5),
        (Wrap::Clamp, 0.0, 0.0),
        (Wrap::Clamp, 7.0, 1.0),
        (Wrap::Mirror, 1.0, 1.0),
        (Wrap::Mirror, 1.5, 0.5),
        (Wrap::Clamp, f32::NAN, 0.0),
    ] {
        let value = red(Filter::Linear, wrap, u);
        assert!((value - linear).abs() < 1e-6, "{wrap:?} at {u}: {value}");
    }
    assert_eq!(black_and_white(Filter::Linear, Wrap::Clamp).look_up_srgb(Vec2::INFINITY).w, 1.0);
}
