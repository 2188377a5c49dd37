//! The icon of the window: a sphere on a ground, with the occlusion between them.

use egui_winit::winit::window::Icon;

/// Width and height, pixels.
const SIDE: u32 = 64;
/// Corners of the square, of its width.
const CORNER: f32 = 0.2;
const GROUND: [f32; 3] = [36.0, 39.0, 45.0];
const SPHERE: [f32; 3] = [247.0, 162.0, 68.0];

/// The icon; `None` where the window system takes none.
pub fn icon() -> Option<Icon> {
    Icon::from_rgba(pixels(), SIDE, SIDE).ok()
}

/// Red, green, blue and alpha of each pixel, rows from the top.
fn pixels() -> Vec<u8> {
    let mut rgba = Vec::with_capacity(4 * (SIDE * SIDE) as usize);
    for k in 0..SIDE * SIDE {
        let at = |k: u32| (k as f32 + 0.5) / SIDE as f32;
        let (x, y) = (at(k % SIDE), at(k / SIDE));
        let (colour, alpha) = pixel(x, y);
        rgba.extend(colour.map(|c| c.clamp(0.0, 255.0) as u8));
        rgba.push((255.0 * alpha) as u8);
    }
    rgba
}

/// The colour at a point of the unit square, and how much of the pixel it covers.
fn pixel(x: f32, y: f32) -> ([f32; 3], f32) {
    let smooth = |distance: f32| (0.5 - distance * SIDE as f32).clamp(0.0, 1.0);

    // a square with round corners
    let outside = [x, y].map(|v| ((v - 0.5).abs() - (0.5 - CORNER)).max(0.0));
    let alpha = smooth(outside[0].hypot(outside[1]) - CORNER);

    // the ground is dark where the sphere touches it
    let occlusion = (1.0 - ((x - 0.5) / 0.42).hypot((y - 0.8) / 0.13)).clamp(0.0, 1.0);
    let ground = GROUND.map(|c| (c + 50.0 * y) * (1.0 - 0.85 * occlusion));

    // light from the upper left
    let (dx, dy) = ((x - 0.5) / 0.31, (y - 0.47) / 0.31);
    let depth = (1.0 - dx * dx - dy * dy).max(0.0).sqrt();
    let light = 0.35 + 0.75 * (-0.4 * dx - 0.6 * dy + 0.7 * depth).max(0.0);
    let cover = smooth((dx.hypot(dy) - 1.0) * 0.31);
    (std::array::from_fn(|c| ground[c] * (1.0 - cover) + SPHERE[c] * light * cover), alpha)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_icon_is_a_sphere_in_a_square() {
        let rgba = pixels();
        let at = |x: u32, y: u32| &rgba[4 * (y * SIDE + x) as usize..][..4];
        assert_eq!(at(0, 0)[3], 0, "round corners");
        assert!(at(SIDE / 2, 0)[3] > 200 && at(30, 28)[0] > 150 && at(30, 28)[3] == 255);
        assert!(at(32, 51)[0] < at(4, 51)[0], "occluded below the sphere");
    }
}
