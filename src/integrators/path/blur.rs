//! Environment maps blurred, for what camera rays show behind a scene.

use std::f32::consts::PI;

use glam::Vec3;
use rayon::prelude::*;

use crate::interface::records::path::{BLURRED_HEIGHT, BLURRED_WIDTH};
use crate::scene::EnvironmentMap;

/// Standard deviation of the blur, radians: a window's edges vanish, and where the light is does
/// not.
const DEVIATION: f32 = 8.0 * PI / 180.0;
/// Angle beyond which nothing counts, radians.
const REACH: f32 = 3.5 * DEVIATION;
/// Width and height of what is averaged, in cells; a cell is a third of the deviation.
const CELLS: [usize; 2] = [128, 64];

/// A part of a map: its direction in the map's space, its solid angle but for a factor of all, and
/// radiance times that.
struct Cell {
    direction: Vec3,
    solid_angle: f32,
    power: Vec3,
}

/// Radiance of the map, without its factor, convolved over the sphere with a density that falls
/// with the angle as a normal distribution does (von Mises and Fisher); rows from the top. The
/// fourth number of a texel is 0.
pub(super) fn blurred(map: &EnvironmentMap) -> Vec<[f32; 4]> {
    let rows = cells(map);
    let [width, height] = [BLURRED_WIDTH as usize, BLURRED_HEIGHT as usize];
    let (concentration, least) = (1.0 / (DEVIATION * DEVIATION), REACH.cos());
    let texel = |k: usize| {
        let at = direction([k % width, k / width], [width, height]);
        let polar = at.y.acos();
        let near = rows.iter().filter(|row| row.first().is_some_and(|c| (c.direction.y.acos() - polar).abs() < REACH));
        let (mut sum, mut total) = (Vec3::ZERO, 0.0);
        for cell in near.flatten() {
            let cosine = cell.direction.dot(at);
            if cosine > least {
                let weight = (concentration * (cosine - 1.0)).exp();
                sum += weight * cell.power;
                total += weight * cell.solid_angle;
            }
        }
        (sum / total.max(f32::MIN_POSITIVE)).extend(0.0).to_array()
    };
    (0..width * height).into_par_iter().map(texel).collect()
}

/// The map in rows of [`CELLS`] cells; of a smaller map several have the radiance of one texel.
fn cells(map: &EnvironmentMap) -> Vec<Vec<Cell>> {
    let own = [map.width as usize, map.height as usize];
    let texels = |k: usize, axis: usize| {
        let (first, end) = (own[axis] * k / CELLS[axis], own[axis] * (k + 1) / CELLS[axis]);
        first..end.max(first + 1)
    };
    let sine = |y: usize, height: usize| ((y as f32 + 0.5) / height as f32 * PI).sin();
    let cell = |x: usize, y: usize| {
        let (mut sum, mut total) = (Vec3::ZERO, 0.0);
        for row in texels(y, 1) {
            let texels = &map.radiance[row * own[0]..][texels(x, 0)];
            sum += sine(row, own[1]) * texels.iter().sum::<Vec3>();
            total += sine(row, own[1]) * texels.len() as f32;
        }
        let solid_angle = sine(y, CELLS[1]);
        Cell { direction: direction([x, y], CELLS), solid_angle, power: sum / total * solid_angle }
    };
    (0..CELLS[1]).map(|y| (0..CELLS[0]).map(|x| cell(x, y)).collect()).collect()
}

/// Direction of the middle of a texel: `map_coordinates` of shaders/path/map.glsl takes it back.
fn direction([x, y]: [usize; 2], [width, height]: [usize; 2]) -> Vec3 {
    let (turn, polar) = ((x as f32 + 0.5) / width as f32 * 2.0 * PI, (y as f32 + 0.5) / height as f32 * PI);
    Vec3::new(-polar.sin() * turn.sin(), polar.cos(), polar.sin() * turn.cos())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(width: u32, height: u32, radiance: impl Fn(u32, u32) -> Vec3) -> EnvironmentMap {
        let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        EnvironmentMap::new("", [width, height], texels.map(|(x, y)| radiance(x, y)).collect())
    }

    #[test]
    fn a_constant_map_stays_as_it_is() {
        for (width, height) in [(2, 1), (7, 5), (300, 200)] {
            let c = Vec3::new(0.5, 1.0, 2.0);
            let texels = blurred(&map(width, height, |_, _| c));
            assert_eq!(texels.len(), (BLURRED_WIDTH * BLURRED_HEIGHT) as usize);
            for texel in &texels {
                assert!((Vec3::from_slice(texel) - c).abs().max_element() < 1e-4, "{width}x{height}: {texel:?}");
            }
        }
    }

    /// A small lamp spreads as the density does, about where it is, and keeps its power.
    #[test]
    fn a_lamp_spreads_and_keeps_its_power() {
        let (width, height) = (256, 128);
        let lamp = |x: u32, y: u32| {
            if (64..66).contains(&x) && (48..50).contains(&y) { Vec3::splat(1000.0) } else { Vec3::ZERO }
        };
        let source = map(width, height, lamp);
        let texels = blurred(&source);
        let power = |size: [usize; 2], value: &dyn Fn(usize) -> f32| -> f64 {
            let sine = |k: usize| (((k / size[0]) as f32 + 0.5) * PI / size[1] as f32).sin();
            (0..size[0] * size[1]).map(|k| f64::from(value(k) * sine(k))).sum::<f64>() / (size[0] * size[1]) as f64
        };
        let size = [BLURRED_WIDTH as usize, BLURRED_HEIGHT as usize];
        let (before, after) =
            (power([width as usize, height as usize], &|k| source.radiance[k].x), power(size, &|k| texels[k][0]));
        assert!((after / before - 1.0).abs() < 0.02, "{before} {after}");

        // brightest at the lamp; a deviation away exp(-1/2) of that
        let brightest = (0..texels.len()).max_by(|a, b| texels[*a][0].total_cmp(&texels[*b][0])).unwrap();
        let (at, lamp) = (direction([brightest % size[0], brightest / size[0]], size), direction([64, 48], [256, 128]));
        assert!(at.dot(lamp).acos() < 0.04, "{at} {lamp}");
        let below = brightest + size[0] * (DEVIATION / PI * size[1] as f32).round() as usize;
        let ratio = texels[below][0] / texels[brightest][0];
        assert!((ratio - (-0.5f32).exp()).abs() < 0.1, "{ratio}");
    }
}
