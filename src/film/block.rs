//! Blocks of the image: the pixels of one set of device buffers, which does not grow with the
//! image.

use std::marker::PhantomData;
use std::sync::Arc;

use super::camera::CameraRecord;
use crate::error::Result;
use crate::gpu::{Buffer, Device, Memory};
pub use crate::interface::records::block::{BlockParams, TILE};
use crate::sampling::morton::morton_pixel;

/// Maximum number of pixels of a block (1920x1080 fits).
const MAX_PIXELS: u64 = 1 << 21;
/// Number of pixels of a tile.
pub const TILE_PIXELS: u32 = TILE * TILE;

/// Parameters of a pass over a block in device memory: those of the block, and behind them the
/// pass's own, as shaders expect them (`behind_block` in shaders/common/camera.glsl).
pub struct PassParams<T> {
    buffer: Buffer,
    own: PhantomData<T>,
}

impl<T: bytemuck::NoUninit> PassParams<T> {
    /// Where the pass's own parameters begin, bytes.
    const OWN: u64 = size_of::<BlockParams>() as u64;

    /// Allocates them; both parts are yet to be written.
    ///
    /// # Errors
    /// Those of the device.
    pub fn new(device: &Arc<Device>, name: &str) -> Result<Self> {
        let buffer = Buffer::new(device, name, Self::OWN + size_of::<T>() as u64, Memory::Upload)?;
        Ok(Self { buffer, own: PhantomData })
    }

    /// Device address of the parameters, for [`Push::pass`](crate::tracer::Push).
    pub fn address(&self) -> u64 {
        self.buffer.address()
    }

    /// Device address of the pass's own parameters.
    pub fn own_address(&self) -> u64 {
        self.buffer.address() + Self::OWN
    }

    /// Writes the parameters of the block.
    ///
    /// # Errors
    /// Those of the device.
    pub fn write_block(&mut self, block: &BlockParams) -> Result<()> {
        self.buffer.write(0, bytemuck::bytes_of(block))
    }

    /// Writes the pass's own parameters.
    ///
    /// # Errors
    /// Those of the device.
    pub fn write_own(&mut self, own: &T) -> Result<()> {
        self.buffer.write(Self::OWN, bytemuck::bytes_of(own))
    }

    /// Writes both.
    ///
    /// # Errors
    /// Those of the device.
    pub fn write(&mut self, block: &BlockParams, own: &T) -> Result<()> {
        self.write_block(block)?;
        self.write_own(own)
    }
}

/// A rectangle of the image, stored in tiles of 8x8 pixels, in Morton order within a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// Coordinates of the upper left pixel in the image.
    pub origin: [u32; 2],
    /// Width and height in pixels.
    pub size: [u32; 2],
}

impl Block {
    /// Divides an image into blocks.
    pub fn cut(size: [u32; 2]) -> Vec<Block> {
        let step = |n: u32, most: u64| (n as u64).min(most).max(1) as u32;
        let width = step(size[0], MAX_PIXELS / TILE as u64);
        let rows = MAX_PIXELS / (width.next_multiple_of(TILE) as u64) / TILE as u64 * TILE as u64;
        let height = step(size[1], rows.max(TILE as u64));
        let mut blocks = Vec::new();
        for y in (0..size[1]).step_by(height as usize) {
            for x in (0..size[0]).step_by(width as usize) {
                blocks.push(Block { origin: [x, y], size: [width.min(size[0] - x), height.min(size[1] - y)] });
            }
        }
        blocks
    }

    /// Number of tiles in a row.
    pub fn tiles_x(&self) -> u32 {
        self.size[0].div_ceil(TILE)
    }

    /// Number of tiles.
    pub fn tiles(&self) -> u32 {
        self.tiles_x() * self.size[1].div_ceil(TILE)
    }

    /// Index of a tile in the tile grid of an image of the given width, rows from the top.
    pub fn image_tile(&self, tile: u32, image_width: u32) -> usize {
        let [x, y] = self.origin.map(|o| o / TILE);
        ((y + tile / self.tiles_x()) * image_width.div_ceil(TILE) + x + tile % self.tiles_x()) as usize
    }

    /// Number of ray indices, padding of incomplete tiles included.
    pub fn rays(&self) -> u32 {
        self.tiles() * TILE_PIXELS
    }

    /// Pixel of a ray index within the block, as in shaders; outside `size` for padding.
    pub fn pixel(&self, index: u32) -> [u32; 2] {
        let (tile, k) = (index >> 6, index & 63);
        let [x, y] = morton_pixel(k);
        [tile % self.tiles_x() * TILE + x, tile / self.tiles_x() * TILE + y]
    }

    /// Index in an image of the given width of the pixel of a ray index; `None` for padding.
    pub fn image_index(&self, index: u32, image_width: u32) -> Option<usize> {
        let [x, y] = self.pixel(index);
        (x < self.size[0] && y < self.size[1])
            .then(|| (self.origin[1] + y) as usize * image_width as usize + (self.origin[0] + x) as usize)
    }

    /// Parameters of the block's passes: for all of its tiles, and rays through pixels' centres.
    pub fn params(&self, image_size: [u32; 2], camera: &CameraRecord, seed: u32) -> BlockParams {
        BlockParams {
            camera_to_world: camera.camera_to_world,
            view: camera.view,
            orthographic: camera.orthographic as u32,
            clip_near: camera.clip[0],
            clip_far: if camera.clip[1].is_finite() { camera.clip[1] } else { 0.0 },
            seed,
            image_size,
            block_origin: self.origin,
            block_size: self.size,
            tiles_x: self.tiles_x(),
            ..Default::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_and_their_pixels_cover_the_image_once() {
        for size in [[1, 1], [7, 3], [64, 64], [1280, 720], [3001, 1403], [1, 20000], [20000, 1]] {
            let mut seen = vec![0u8; size[0] as usize * size[1] as usize];
            for b in Block::cut(size) {
                assert!(b.rays() as u64 <= MAX_PIXELS + 8 * 20000 * 8);
                for k in 0..b.rays() {
                    if let Some(i) = b.image_index(k, size[0]) {
                        seen[i] += 1;
                    }
                }
            }
            assert!(seen.iter().all(|&s| s == 1), "{size:?}");
        }
    }
}
