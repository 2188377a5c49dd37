//! A scene over time: anything that can bring a tracer to a frame.

use crate::error::Result;
use crate::scene::flatten::Motion;
use crate::scene::{Camera, Scene};
use crate::tracer::{Tracer, UpdateStats};

/// Brings the tracer to a frame. Frames need not come in order.
pub type Advance<'a> = Box<dyn FnMut(&mut Tracer, u32) -> Result<UpdateStats> + 'a>;

/// A scene, what may change in it, and what does.
pub struct Script<'a> {
    /// In tables.
    pub name: String,
    /// As it is at the beginning.
    pub scene: &'a Scene,
    /// What may change.
    pub motion: Motion,
    /// World units that occlusion reaches.
    pub reach: f64,
    /// From where it is seen.
    pub camera: Camera,
    /// What changes.
    pub advance: Advance<'a>,
}

impl Script<'_> {
    /// Brings the tracer to a frame.
    pub fn to(&mut self, tracer: &mut Tracer, frame: u32) -> Result<UpdateStats> {
        (self.advance)(tracer, frame)
    }
}
