//! Non-local means (shaders/common/nlmeans.glsl): the mean over pixels around that look alike, as
//! far as noise explains how they differ. It needs no plane, so it also averages detail and pixels
//! with several surfaces; and it needs samples enough to tell likeness from noise.

use std::sync::Arc;

use crate::error::Result;
use crate::film::pace::Pace;
use crate::film::{Control, Film};
use crate::gpu::{Buffer, Commands, Device, Memory};
use crate::realtime::nlmeans::{EVENNESS, blocks, params, shader};
use crate::shaders::LANES;
use crate::tracer::Push;

/// Samples of a pixel from which non-local means count at least as much as the guided filter.
const EVEN_SAMPLES: f32 = 16.0;

/// Mixes the film's means, filtered by non-local means, into those that surfaces guided: the more
/// the more samples a pixel has. `depths` says which pixels are averaged (`NlMeansParams`).
///
/// # Errors
/// Those of the device, and [`crate::Error::Interrupted`] when `control` says so.
pub fn refine(
    device: &Arc<Device>,
    film: &Film,
    depths: &[f32],
    filtered: &mut [f32],
    control: &mut dyn Control,
) -> Result<()> {
    let channels = film.channels;
    let denoised = run(device, film, depths, control)?;
    for (k, &samples) in film.samples.iter().enumerate().filter(|(k, _)| depths[*k] != 0.0) {
        let share = samples as f32 / (samples as f32 + EVEN_SAMPLES);
        for c in 0..channels {
            let value = &mut filtered[channels * k + c];
            *value += share * (denoised[channels * k + c] - *value);
        }
    }
    Ok(())
}

/// Each pixel's value and its variance, averaged over 3x3 pixels: few samples know it badly.
fn estimates(film: &Film) -> Vec<f32> {
    let [width, height] = [film.width as usize, film.height as usize];
    let errors: Vec<f32> = (film.samples.iter().zip(film.variance.chunks_exact(film.channels)))
        .map(|(&n, variance)| variance.iter().sum::<f32>() * (n.max(1) as f32).powf(-1.0 - EVENNESS))
        .collect();
    let neighbours = |k: usize, n: usize| k.saturating_sub(1)..(k + 2).min(n);
    let mut out = Vec::with_capacity((film.channels + 1) * errors.len());
    for (k, mean) in film.mean.chunks_exact(film.channels).enumerate() {
        let row = |y: usize| neighbours(k % width, width).map(move |x| y * width + x);
        let taps = || neighbours(k / width, height).flat_map(row);
        out.extend(mean);
        out.push(taps().map(|tap| errors[tap]).sum::<f32>() / taps().count() as f32);
    }
    out
}

/// Filters on the device, in several short launches. Returns as many channels as the film has.
fn run(device: &Arc<Device>, film: &Film, depths: &[f32], control: &mut dyn Control) -> Result<Vec<f32>> {
    let (size, channels) = ([film.width, film.height], film.channels as u32);
    let from = Buffer::from_slice(device, "estimates", &estimates(film))?;
    let depths = Buffer::from_slice(device, "depths", depths)?;
    let stride = if channels == 1 { 1 } else { 4 };
    let bytes = 4 * stride as u64 * film.samples.len() as u64;
    let to = Buffer::new(device, "denoised image", bytes, Memory::Device)?;
    let params = params(size, channels, [&from, &to, &depths].map(Buffer::address));
    let params = Buffer::from_slice(device, "parameters of non-local means", &[params])?;
    let pipeline = shader(channels).pipeline(device)?;
    let (mut commands, mut pace) = (Commands::new(device)?, Pace::default());
    pace.run_launches(blocks(size, channels), control, |first, count| {
        let push = Push { pass: params.address(), first, count, ..Default::default() };
        commands.run(|r| r.timed("nlmeans", |r| r.dispatch(&pipeline, &push, count.div_ceil(LANES))))
    })?;
    let values: Vec<f32> = bytemuck::pod_collect_to_vec(&to.read(0, to.size())?);
    Ok(values.chunks_exact(stride).flat_map(|v| &v[..film.channels]).copied().collect())
}
