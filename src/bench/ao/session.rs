//! A run of `skylit bench ao`.

use super::args::BenchAoArgs;
use crate::accel::flatten::FlatScene;
use crate::bench::record::ao::AoBenchmark;
use crate::bench::session::Session;
use crate::error::Result;
use crate::terminal::interrupt;
use crate::tracer::{ComputeOptions, Needs, Tracer};

/// A run of `skylit bench ao`.
pub type AoSession<'a> = Session<'a, BenchAoArgs, AoBenchmark>;

impl AoSession<'_> {
    /// Width of the images over their height.
    pub fn aspect(&self) -> f64 {
        let [width, height] = self.args.size();
        f64::from(width) / f64::from(height)
    }

    /// Builds what traces a scene. `name`: what the progress bar calls it.
    ///
    /// # Errors
    /// Those of [`crate::bench::device::BenchDevice::tracer`]; Ctrl-C.
    pub fn tracer(&mut self, name: &str, flat: &FlatScene) -> Result<Tracer> {
        self.phase(format!("{name}: building"));
        let (kind, _) = self.args.tracer.on(self.device.info());
        let build = self.args.build_options();
        let tracer = self.device.tracer(flat, kind, Needs::default(), ComputeOptions::default(), &build)?;
        interrupt::check()?;
        Ok(tracer)
    }
}
