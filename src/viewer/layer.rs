//! Images beneath the user interface: where they are on the screen, and how a CPU puts them there.

use std::sync::Arc;

use crate::renderer::interactive::ViewPicture;

/// Background where there is no image, `0x00RRGGBB`.
pub const BACKGROUND: u32 = 0x0010_1010;

/// An image on the screen, beneath the user interface.
#[derive(Clone, Debug)]
pub struct Layer {
    /// The image.
    pub picture: Arc<ViewPicture>,
    /// Left, top, right and bottom of where all of it would be, in physical pixels.
    pub area: [i32; 4],
    /// Visible part of the area.
    pub clip: [i32; 4],
}

/// A frame buffer: `0x00RRGGBB` words, rows from the top.
pub struct FrameBuffer<'a> {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Pixels of the frame.
    pub words: &'a mut [u32],
}

impl Layer {
    /// Copies the image into a frame buffer, scaled: bilinear where it is enlarged, exact where
    /// sizes are equal.
    pub fn draw(&self, to: &mut FrameBuffer) {
        let [width, height] = self.picture.size.map(|n| n as usize);
        let [left, top, right, bottom] = self.area;
        if width == 0 || height == 0 || right <= left || bottom <= top || self.picture.rgba.len() < 4 * width * height {
            return;
        }

        // the part of the frame that shows the image
        let clip = |at: i32, k: usize, most: usize| {
            (at.max(self.area[k % 2]).min(self.area[k % 2 + 2]).max(0) as usize).min(most)
        };
        let [x0, x1] = [self.clip[0], self.clip[2]].map(|x| clip(x, 0, to.size[0]));
        let [y0, y1] = [self.clip[1], self.clip[3]].map(|y| clip(y, 1, to.size[1]));
        let source: &[u8] = &self.picture.rgba;
        let is_same = [right - left, bottom - top] == self.picture.size.map(|n| n as i32);

        // positions of pixel centres in the image, in 1/256 pixel from the centre of its first
        let along = |at: usize, start: i32, end: i32, n: usize| -> (usize, usize, u32) {
            let position = ((at as i64 - i64::from(start)) * 2 + 1) * 128 * n as i64 / i64::from(end - start) - 128;
            let position = position.clamp(0, (n as i64 - 1) * 256);
            let k = (position / 256) as usize;
            (k, (k + 1).min(n - 1), (position % 256) as u32)
        };
        let columns: Vec<_> = (x0..x1).map(|x| along(x, left, right, width)).collect();

        // rows: copied at the same size, otherwise interpolated in fixed point
        for y in y0..y1 {
            let row = &mut to.words[y * to.size[0]..][x0..x1];
            if is_same {
                let first = 4 * ((y as i32 - top) as usize * width + (x0 as i32 - left) as usize);
                for (word, p) in row.iter_mut().zip(source[first..].chunks_exact(4)) {
                    *word = u32::from(p[0]) << 16 | u32::from(p[1]) << 8 | u32::from(p[2]);
                }
                continue;
            }
            let (above, below, v) = along(y, top, bottom, height);
            let [above, below] = [above, below].map(|k| &source[4 * k * width..][..4 * width]);
            for (word, &(a, b, u)) in row.iter_mut().zip(&columns) {
                // two channels at a time
                let pair = |row: &[u8], k: usize, c: usize| u32::from(row[4 * k + c]);
                let mix = |c: usize| {
                    let mix_row = |row: &[u8]| pair(row, a, c) * (256 - u) + pair(row, b, c) * u;
                    (mix_row(above) * (256 - v) + mix_row(below) * v + (1 << 15)) >> 16
                };
                *word = mix(0) << 16 | mix(1) << 8 | mix(2);
            }
        }
    }
}
