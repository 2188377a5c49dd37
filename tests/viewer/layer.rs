//! Pictures drawn into a frame buffer.

use std::sync::Arc;

use skylit::renderer::interactive::ViewPicture;
use skylit::viewer::layer::{FrameBuffer, Layer};

fn picture(size: [u32; 2], of: impl Fn(u32, u32) -> u8) -> Arc<ViewPicture> {
    let pixels = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y)));
    Arc::new(ViewPicture { size, rgba: pixels.flat_map(|(x, y)| [of(x, y), 0, 7, 255]).collect() })
}

fn drawn(layer: &Layer, size: [usize; 2]) -> Vec<u32> {
    let mut words = vec![0x0055_0000; size[0] * size[1]];
    layer.draw(&mut FrameBuffer { size, words: &mut words });
    words
}

#[test]
fn equal_sizes_are_copied_within_the_clip() {
    let layer = Layer { picture: picture([4, 3], |x, y| (10 * y + x) as u8), area: [1, 1, 5, 4], clip: [2, 0, 9, 3] };
    let words = drawn(&layer, [6, 5]);
    for y in 0..5 {
        for x in 0..6 {
            let inside = (2..5).contains(&x) && (1..3).contains(&y);
            let expected = if inside { ((10 * (y - 1) + x - 1) as u32) << 16 | 7 } else { 0x0055_0000 };
            assert_eq!(words[y * 6 + x], expected, "{x} {y}");
        }
    }
}

#[test]
fn enlarged_images_are_smooth_and_keep_constants() {
    let flat = Layer { picture: picture([3, 2], |_, _| 200), area: [0, 0, 31, 17], clip: [0, 0, 31, 17] };
    assert!(drawn(&flat, [31, 17]).iter().all(|w| *w == 200 << 16 | 7));
    let ramp = Layer { picture: picture([2, 1], |x, _| 100 * x as u8), area: [0, 0, 8, 1], clip: [0, 0, 8, 1] };
    let reds: Vec<u32> = drawn(&ramp, [8, 1]).iter().map(|w| w >> 16).collect();
    assert_eq!(reds, [0, 0, 13, 38, 63, 88, 100, 100]);
    // beyond the frame buffer, turned over, empty
    for (area, clip) in
        [([-5, -5, 90, 90], [-9, -9, 99, 99]), ([5, 5, 1, 1], [0, 0, 8, 8]), ([0, 0, 8, 8], [7, 7, 2, 2])]
    {
        drawn(&Layer { picture: picture([2, 2], |_, _| 1), area, clip }, [8, 8]);
    }
    drawn(&Layer { picture: Arc::default(), area: [0, 0, 8, 8], clip: [0, 0, 8, 8] }, [8, 8]);
}
