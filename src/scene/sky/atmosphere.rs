//! Sunlight in a spherical atmosphere of air, haze and ozone, at sixteen wavelengths.
//!
//! Light that is scattered once is integrated along rays (Nishita, Sirai, Tadamura, Nakamae,
//! "Display of the Earth Taking into Account Atmospheric Scattering", SIGGRAPH 1993). What is
//! scattered more often comes from a table that takes it for isotropic (Hillaire, "A Scalable and
//! Production Ready Sky and Atmosphere Rendering Technique", EGSR 2020, section 5.5). Lengths are
//! kilometres.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::scene::blackbody::{TO_SRGB, observer, planck};

/// Wavelengths: from 390 nm to 690 nm, every 20 nm.
const LANES: usize = 16;
const FIRST: f64 = 390.0;
const SPACING: f64 = 20.0;
/// Radii of the ground and of what counts as the top of the atmosphere (Bruneton, Neyret,
/// "Precomputed Atmospheric Scattering", EGSR 2008; Hillaire 2020).
const GROUND: f64 = 6360.0;
const TOP: f64 = 6460.0;
/// Heights over which the densities of air and haze fall to 1/e (Bruneton 2008).
const SCALE_HEIGHTS: [f64; 2] = [8.0, 1.2];
/// Height of the densest ozone, and how far above and below it there is none (Hillaire 2020).
const OZONE_HEIGHT: f64 = 25.0;
const OZONE_EXTENT: f64 = 15.0;
/// Ozone in a vertical column: 300 Dobson units, in molecules per square metre.
const OZONE_COLUMN: f64 = 300.0 * 2.6868e20;
/// Share of the light lost in haze that it scatters, and the parameter of its phase function, whose
/// mean cosine is 0.703 then: average continental aerosol at 550 nm (Hess, Koepke, Schult, "Optical
/// Properties of Aerosols and Clouds: The Software Package OPAC", 1998).
const HAZE_ALBEDO: f64 = 0.925;
const HAZE_FORWARD: f64 = 0.641;
/// Reflectance of the ground, which is Lambertian.
const GROUND_ALBEDO: f64 = 0.2;
/// Height of the observer.
const EYE: f64 = 2e-3;

/// Temperature of a black body of the sun's colour, in kelvin (IAU 2015 Resolution B3).
const SUN_KELVIN: f64 = 5772.0;
/// Illuminance by the sun outside of the atmosphere, in lux (Darula, Kittler, Gueymard, "Reference
/// luminous solar constant and solar luminance for illuminance calculations", Solar Energy 2005).
const SUN_ILLUMINANCE: f64 = 133_800.0;

/// Radii and directions of the table of columns.
const COLUMNS: [usize; 2] = [64, 128];
/// Steps along a ray: of a column, of the sky, and of the table of multiple scattering.
const COLUMN_STEPS: usize = 200;
const SKY_STEPS: usize = 32;
const SPHERE_STEPS: usize = 20;
/// Heights and elevations of the sun of the table of multiple scattering.
const SCATTERED: [usize; 2] = [16, 48];
/// Directions over which light is averaged there: rings, and directions of a half ring.
const SPHERE: [usize; 2] = [8, 4];

/// A number for each wavelength.
type Spectrum = [f32; LANES];
/// Amounts of air, haze and ozone, as lengths at the density that coefficients are for.
type Columns = [f64; 3];

/// A clear sky, of a sun that has an irradiance of 1 at all wavelengths outside of it.
pub struct Atmosphere {
    /// Scattered by air and by haze, at the ground, per kilometre.
    scattering: [Spectrum; 2],
    /// Lost in air, in haze and in the densest ozone, per kilometre.
    extinction: [Spectrum; 3],
    /// From a radius and a direction to the top ([`COLUMNS`]).
    columns: Vec<Columns>,
    /// Radiance by light that was scattered more than once ([`SCATTERED`]).
    scattered: Vec<Spectrum>,
}

/// The geometry of a ray: it starts at a radius; cosines of angles between zenith, ray and sun.
#[derive(Clone, Copy)]
struct Ray {
    radius: f64,
    zenith_ray: f64,
    zenith_sun: f64,
    ray_sun: f64,
}

/// A point on a ray.
struct Point {
    radius: f64,
    zenith_sun: f64,
    densities: Columns,
}

impl Atmosphere {
    /// Makes the tables of an atmosphere. `turbidity` is the optical thickness of air and haze over
    /// that of air, 1 (no haze) to 10.
    pub fn new(turbidity: f64) -> Self {
        // Angstrom's law, with the coefficient of Preetham, Shirley, Smits, "A Practical Analytic
        // Model for Daylight", SIGGRAPH 1999, appendix 1
        let haze = (0.04608 * turbidity - 0.04586).max(0.0);
        let air = spectrum(|nm| air_thickness(nm) / SCALE_HEIGHTS[0]);
        let lost = spectrum(|nm| haze * (1e-3 * nm).powf(-1.3) / SCALE_HEIGHTS[1]);
        let mut out = Self {
            scattering: [air, lost.map(|v| HAZE_ALBEDO as f32 * v)],
            extinction: [air, lost, spectrum(|nm| OZONE_COLUMN * ozone_section(nm) / OZONE_EXTENT)],
            columns: Vec::new(),
            scattered: Vec::new(),
        };

        // light from the sun, which light that is scattered twice needs
        let [radii, directions] = COLUMNS;
        let column = |k: usize| columns_of(column_parameters(k / directions, k % directions));
        out.columns = (0..radii * directions).into_par_iter().map(column).collect();
        let [heights, suns] = SCATTERED;
        out.scattered = (0..heights * suns).into_par_iter().map(|k| out.scattered_at(k / suns, k % suns)).collect();
        out
    }

    /// Illuminance by the sun on a plane that faces it, in lux in linear sRGB, at an elevation in
    /// degrees; zero below the horizon.
    pub fn sun(&self, elevation: f64) -> DVec3 {
        let transmitted = if elevation < 0.0 { [0.0; LANES] } else { self.transmittance(elevation) };
        lux(&transmitted).max(DVec3::ZERO)
    }

    /// Share of sunlight of each wavelength that reaches the ground, of a sun at an elevation in
    /// degrees.
    fn transmittance(&self, elevation: f64) -> Spectrum {
        self.transmitted(&columns_of((GROUND + EYE, elevation.to_radians().sin())))
    }

    /// Luminance of sky and ground in linear sRGB, in candela per square metre: rows of an
    /// equirectangular map from the zenith down, with the sun over its middle. Width and height are
    /// even.
    pub fn map(&self, elevation: f64, width: usize, height: usize) -> Vec<Vec3> {
        let (zenith_sun, sun_height) = elevation.to_radians().sin_cos();
        // one side, which the other mirrors
        let half = width / 2;
        let rows: Vec<Vec<Vec3>> = (0..height / 2)
            .into_par_iter()
            .map(|y| {
                let (sin, cos) = (PI * (y as f64 + 0.5) / height as f64).sin_cos();
                let texel = |x: usize| {
                    let azimuth = TAU * (x as f64 + 0.5) / width as f64;
                    let ray_sun = sin * sun_height * azimuth.cos() + cos * zenith_sun;
                    let ray = Ray { radius: GROUND + EYE, zenith_ray: cos, zenith_sun, ray_sun };
                    lux(&self.sky(&ray)).max(DVec3::ZERO).as_vec3()
                };
                let right: Vec<Vec3> = (0..half).map(texel).collect();
                right.iter().rev().chain(&right).copied().collect()
            })
            .collect();

        // what lights the ground
        let direct = self.sun(elevation) * zenith_sun.max(0.0);
        let ground = (GROUND_ALBEDO / PI * (direct + horizontal(&rows, height))).as_vec3();
        let mut map = rows.concat();
        map.resize(width * height, ground);
        map
    }

    /// Radiance of the sky along a ray from the ground upwards.
    fn sky(&self, ray: &Ray) -> Spectrum {
        let (air_phase, haze_phase) = (air_phase(ray.ray_sun) as f32, haze_phase(ray.ray_sun) as f32);
        let ([radiance], _) = march(self, ray, SKY_STEPS, |point| {
            let [air, haze, _] = point.densities.map(|d| d as f32);
            let (sun, scattered) = (self.sunlight(point), self.scattered_to(point));
            let [by_air, by_haze] = &self.scattering;
            [std::array::from_fn(|k| {
                let (by_air, by_haze) = (by_air[k] * air, by_haze[k] * haze);
                sun[k] * (by_air * air_phase + by_haze * haze_phase) + scattered[k] * (by_air + by_haze)
            })]
        });
        radiance
    }

    /// Share of light that is left behind these columns.
    fn transmitted(&self, columns: &Columns) -> Spectrum {
        let [air, haze, ozone] = columns.map(|c| c as f32);
        let [by_air, by_haze, by_ozone] = &self.extinction;
        std::array::from_fn(|k| (-(by_air[k] * air + by_haze[k] * haze + by_ozone[k] * ozone)).exp())
    }

    /// Irradiance by the sun at a point, which is zero in the shadow of the ground.
    fn sunlight(&self, point: &Point) -> Spectrum {
        if hits_ground(point.radius, point.zenith_sun) {
            return [0.0; LANES];
        }
        let (x, y) = column_position(point.radius, point.zenith_sun);
        let columns =
            bilinear(&self.columns, COLUMNS, [x, y], |a, b, t| std::array::from_fn(|k| a[k] + (b[k] - a[k]) * t));
        self.transmitted(&columns)
    }

    /// Radiance at a point by light that was scattered more than once.
    fn scattered_to(&self, point: &Point) -> Spectrum {
        let [heights, suns] = SCATTERED;
        let height = ((point.radius - GROUND) / (TOP - GROUND)).clamp(0.0, 1.0).sqrt();
        let sun = 0.5 + 0.5 * point.zenith_sun.signum() * point.zenith_sun.abs().min(1.0).sqrt();
        let at = [height * (heights - 1) as f64, sun * (suns - 1) as f64];
        bilinear(&self.scattered, SCATTERED, at, |a, b, t| std::array::from_fn(|k| a[k] + (b[k] - a[k]) * t as f32))
    }

    /// An entry of the table of multiple scattering: light that is scattered twice, times the sum
    /// of the series of what follows (Hillaire 2020, equations 5 to 10).
    fn scattered_at(&self, height: usize, sun: usize) -> Spectrum {
        let share = |k: usize, of: usize| k as f64 / (of - 1) as f64;
        let radius = GROUND + ((TOP - GROUND) * share(height, SCATTERED[0]).powi(2)).max(EYE);
        let root = 2.0 * share(sun, SCATTERED[1]) - 1.0;
        let zenith_sun = root.signum() * root * root;
        let sun_sin = (1.0 - zenith_sun * zenith_sun).max(0.0).sqrt();
        let [rings, directions] = SPHERE;
        let (mut twice, mut again) = ([0.0f32; LANES], [0.0f32; LANES]);
        for k in 0..rings * directions {
            let zenith_ray = 1.0 - 2.0 * ((k / directions) as f64 + 0.5) / rings as f64;
            let azimuth = PI * ((k % directions) as f64 + 0.5) / directions as f64;
            let ray_sin = (1.0 - zenith_ray * zenith_ray).sqrt();
            let ray_sun = ray_sin * sun_sin * azimuth.cos() + zenith_ray * zenith_sun;
            let ray = Ray { radius, zenith_ray, zenith_sun, ray_sun };
            let ([light, share], left) = march(self, &ray, SPHERE_STEPS, |point| {
                let [air, haze, _] = point.densities.map(|d| d as f32);
                let [by_air, by_haze] = &self.scattering;
                let scattering: Spectrum = std::array::from_fn(|k| by_air[k] * air + by_haze[k] * haze);
                let sun = self.sunlight(point);
                [std::array::from_fn(|k| scattering[k] * sun[k] / (4.0 * PI) as f32), scattering]
            });

            // the ground reflects light of the sun, and of what is scattered
            let at_ground = ray.ground().map(|distance| ray.at(distance));
            let lit = at_ground.map_or([0.0; LANES], |point| {
                let cosine = (point.zenith_sun.max(0.0) * GROUND_ALBEDO / PI) as f32;
                self.sunlight(&point).map(|v| v * cosine)
            });
            let reflected = if ray.ground().is_some() { GROUND_ALBEDO as f32 } else { 0.0 };
            for k in 0..LANES {
                twice[k] += light[k] + left[k] * lit[k];
                again[k] += share[k] + left[k] * reflected;
            }
        }
        let count = (rings * directions) as f32;
        std::array::from_fn(|k| twice[k] / count / (1.0 - again[k] / count))
    }
}

impl Ray {
    /// Distance of the ground, if it hits that.
    fn ground(&self) -> Option<f64> {
        hits_ground(self.radius, self.zenith_ray).then(|| {
            let b = self.radius * self.zenith_ray;
            (-b - (b * b + GROUND * GROUND - self.radius * self.radius).max(0.0).sqrt()).max(0.0)
        })
    }

    /// The point at a distance.
    fn at(&self, distance: f64) -> Point {
        let square = self.radius * self.radius + distance * (distance + 2.0 * self.radius * self.zenith_ray);
        let radius = square.sqrt().max(GROUND);
        let zenith_sun = (self.radius * self.zenith_sun + distance * self.ray_sun) / radius;
        Point { radius, zenith_sun: zenith_sun.clamp(-1.0, 1.0), densities: densities(radius - GROUND) }
    }
}

/// Radiance along a ray by what is scattered into it, per kilometre, and the share of light that
/// passes all of it. Steps are short where it starts; along each, what scatters is constant and is
/// integrated as such (Hillaire 2020, section 5.4).
fn march<const N: usize>(
    atmosphere: &Atmosphere,
    ray: &Ray,
    steps: usize,
    source: impl Fn(&Point) -> [Spectrum; N],
) -> ([Spectrum; N], Spectrum) {
    let length = ray.ground().unwrap_or_else(|| to_top(ray.radius, ray.zenith_ray));
    let (mut sums, mut left) = ([[0.0; LANES]; N], [1.0; LANES]);
    let distance = |step: usize| length * (step as f64 / steps as f64).powi(2);
    for step in 0..steps {
        let (from, to) = (distance(step), distance(step + 1));
        let point = ray.at(0.5 * (from + to));
        let through = atmosphere.transmitted(&point.densities.map(|d| d * (to - from)));
        let sources = source(&point);
        let [air, haze, ozone] = point.densities.map(|d| d as f32);
        let [by_air, by_haze, by_ozone] = &atmosphere.extinction;
        for k in 0..LANES {
            let lost = by_air[k] * air + by_haze[k] * haze + by_ozone[k] * ozone;
            // the difference cancels where next to nothing is lost
            let thickness = lost * (to - from) as f32;
            let effective = if thickness > 1e-3 { (1.0 - through[k]) / lost } else { (to - from) as f32 };
            sums.iter_mut().zip(&sources).for_each(|(sum, s)| sum[k] += left[k] * s[k] * effective);
            left[k] *= through[k];
        }
    }
    (sums, left)
}

/// Densities at a height, as shares of those that coefficients are for.
fn densities(height: f64) -> Columns {
    let [air, haze] = SCALE_HEIGHTS.map(|scale| (-height / scale).exp());
    [air, haze, (1.0 - (height - OZONE_HEIGHT).abs() / OZONE_EXTENT).max(0.0)]
}

/// Distance to the top of the atmosphere.
fn to_top(radius: f64, zenith: f64) -> f64 {
    let b = radius * zenith;
    (-b + (b * b + TOP * TOP - radius * radius).max(0.0).sqrt()).max(0.0)
}

fn hits_ground(radius: f64, zenith: f64) -> bool {
    zenith < 0.0 && radius * radius * (zenith * zenith - 1.0) + GROUND * GROUND >= 0.0
}

/// Columns along a ray from a radius, with this cosine of its angle from the zenith, to the top.
fn columns_of((radius, zenith): (f64, f64)) -> Columns {
    let ray = Ray { radius, zenith_ray: zenith, zenith_sun: 0.0, ray_sun: 0.0 };
    let step = to_top(radius, zenith) / COLUMN_STEPS as f64;
    let mut sums = [0.0; 3];
    for k in 0..COLUMN_STEPS {
        let point = ray.at((k as f64 + 0.5) * step);
        sums.iter_mut().zip(point.densities).for_each(|(sum, d)| *sum += d * step);
    }
    sums
}

/// Half of the chord through the atmosphere that touches the ground.
fn horizon() -> f64 {
    (TOP * TOP - GROUND * GROUND).sqrt()
}

/// Radius and cosine of an entry of the table of columns, whose directions end at the horizon
/// (Bruneton, "Precomputed Atmospheric Scattering: a New Implementation", 2017).
fn column_parameters(row: usize, column: usize) -> (f64, f64) {
    let [rows, columns] = COLUMNS;
    let tangent = horizon() * row as f64 / (rows - 1) as f64;
    let radius = (tangent * tangent + GROUND * GROUND).sqrt();
    let (nearest, farthest) = (TOP - radius, tangent + horizon());
    let distance = nearest + (farthest - nearest) * column as f64 / (columns - 1) as f64;
    let cosine = (horizon() * horizon() - tangent * tangent - distance * distance) / (2.0 * radius * distance);
    (radius, if distance > 0.0 { cosine.clamp(-1.0, 1.0) } else { 1.0 })
}

/// Where a radius and cosine lie in the table of columns.
fn column_position(radius: f64, zenith: f64) -> (f64, f64) {
    let tangent = (radius * radius - GROUND * GROUND).max(0.0).sqrt();
    let (nearest, farthest) = (TOP - radius, tangent + horizon());
    let column = (to_top(radius, zenith) - nearest) / (farthest - nearest);
    let [rows, columns] = COLUMNS;
    (tangent / horizon() * (rows - 1) as f64, column * (columns - 1) as f64)
}

/// An entry of a table between those at whole numbers.
fn bilinear<T>(table: &[T], size: [usize; 2], at: [f64; 2], mix: impl Fn(&T, &T, f64) -> T) -> T {
    let [at, share] = {
        let clamped: [f64; 2] = std::array::from_fn(|k| at[k].clamp(0.0, (size[k] - 1) as f64));
        let low = [0, 1].map(|k| clamped[k].floor().min((size[k] - 2) as f64));
        [low, [0, 1].map(|k| clamped[k] - low[k])]
    };
    let first = at[0] as usize * size[1] + at[1] as usize;
    let row = |k: usize| mix(&table[k], &table[k + 1], share[1]);
    mix(&row(first), &row(first + size[1]), share[0])
}

/// Irradiance of a horizontal plane by the upper rows of a map.
fn horizontal(rows: &[Vec<Vec3>], height: usize) -> DVec3 {
    let edge = |y: usize| (PI * y as f64 / height as f64).sin().powi(2);
    let row = |(y, row): (usize, &Vec<Vec3>)| {
        let mean = row.iter().map(|c| c.as_dvec3()).sum::<DVec3>() / row.len() as f64;
        mean * PI * (edge(y + 1) - edge(y))
    };
    rows.iter().enumerate().map(row).sum()
}

fn spectrum(at: impl Fn(f64) -> f64) -> Spectrum {
    std::array::from_fn(|k| at(FIRST + SPACING * k as f64) as f32)
}

/// Linear sRGB in lux, of sunlight of which this share is left, or in candela per square metre of
/// this share per steradian. Colours that sRGB does not have are negative.
fn lux(shares: &Spectrum) -> DVec3 {
    let (mut sum, mut whole) = (DVec3::ZERO, 0.0);
    for (k, share) in shares.iter().enumerate() {
        let nm = FIRST + SPACING * k as f64;
        // the table of the observer starts at 380 nm, and is of every fifth
        let seen = observer(((nm - 380.0) / 5.0) as usize) * planck(nm, SUN_KELVIN);
        sum += seen * f64::from(*share);
        whole += seen.y;
    }
    TO_SRGB * (sum * SUN_ILLUMINANCE / whole)
}

/// Optical thickness of the air above sea level, at 1013 hPa and 360 ppm of carbon dioxide
/// (Bodhaine, Wood, Dutton, Slusser, "On Rayleigh Optical Depth Calculations", 1999, equation 30).
fn air_thickness(nm: f64) -> f64 {
    let square = (1e-3 * nm).powi(2);
    0.0021520 * (1.0455996 - 341.29061 / square - 0.90230850 * square)
        / (1.0 + 0.0027059889 / square - 85.968563 * square)
}

/// Cross-section of ozone, in square metres: a Gaussian that is within a tenth of its peak of the
/// Chappuis band as it is measured (Gorshelev, Serdyuchenko, Weber, Chehade, Burrows 2014).
fn ozone_section(nm: f64) -> f64 {
    4.7e-25 * (-((nm - 586.0) / 77.0).powi(2)).exp()
}

fn air_phase(cosine: f64) -> f64 {
    3.0 / (16.0 * PI) * (1.0 + cosine * cosine)
}

/// Phase function of haze (Cornette, Shanks 1992).
fn haze_phase(cosine: f64) -> f64 {
    let g = HAZE_FORWARD;
    let forward = (1.0 + g * g - 2.0 * g * cosine).powf(1.5);
    3.0 / (8.0 * PI) * (1.0 - g * g) * (1.0 + cosine * cosine) / ((2.0 + g * g) * forward)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative optical air mass (Kasten, Young, "Revised optical air mass tables and approximation
    /// formula", 1989), which has refraction and air that is warm below.
    #[test]
    fn columns_of_air_are_those_of_kasten_and_young() {
        let air = |elevation: f64| columns_of((GROUND, elevation.to_radians().sin()))[0];
        let zenith = air(90.0);
        assert!((zenith / SCALE_HEIGHTS[0] - 1.0).abs() < 1e-3, "{zenith}");
        for (elevation, tolerance) in [(60.0, 2e-3), (30.0, 2e-3), (10.0, 0.01), (5.0, 0.02), (2.0, 0.04), (0.0, 0.08)]
        {
            let h: f64 = elevation;
            let expected = 1.0 / (h.to_radians().sin() + 0.50572 * (h + 6.07995).powf(-1.6364));
            let found = air(elevation) / zenith;
            println!("{elevation}: {found:.3} ({expected:.3})");
            assert!((found / expected - 1.0).abs() < tolerance, "{elevation}: {found} for {expected}");
        }
    }

    /// Bucholtz, "Rayleigh-scattering calculations for the terrestrial atmosphere", 1995, at
    /// 550 nm; and Beer's law.
    #[test]
    fn air_has_its_optical_thickness() {
        assert!((air_thickness(550.0) / 0.0972 - 1.0).abs() < 0.01);
        let atmosphere = Atmosphere::new(1.0);
        for elevation in [90.0f64, 30.0] {
            let transmitted = atmosphere.transmittance(elevation);
            let ozone = OZONE_COLUMN * ozone_section(FIRST) / elevation.to_radians().sin();
            let expected = (-air_thickness(FIRST) / elevation.to_radians().sin() - ozone).exp();
            assert!((f64::from(transmitted[0]) / expected - 1.0).abs() < 0.01, "{elevation}: {}", transmitted[0]);
        }
    }

    /// Interpolated columns are integrated ones.
    #[test]
    fn the_table_of_columns_is_fine_enough() {
        let atmosphere = Atmosphere::new(3.0);
        for (height, zenith) in [(0.5, 0.9), (0.5, 0.1), (3.0, 0.02), (12.0, -0.03), (40.0, 0.5)] {
            let point = Point { radius: GROUND + height, zenith_sun: zenith, densities: densities(height) };
            let (found, expected) =
                (atmosphere.sunlight(&point), atmosphere.transmitted(&columns_of((point.radius, zenith))));
            for k in 0..LANES {
                let error = (found[k] - expected[k]).abs();
                assert!(error < 0.02, "{height} km, {zenith}: {} for {}", found[k], expected[k]);
            }
        }
    }

    /// Phase functions are densities, and that of haze has the mean cosine that aerosol has.
    #[test]
    fn phase_functions_are_normalized() {
        const STEPS: usize = 20_000;
        let moment = |phase: &dyn Fn(f64) -> f64, power: i32| {
            let at = |k: usize| -1.0 + 2.0 * (k as f64 + 0.5) / STEPS as f64;
            (0..STEPS).map(|k| phase(at(k)) * at(k).powi(power)).sum::<f64>() * 2.0 / STEPS as f64 * TAU
        };
        assert!((moment(&air_phase, 0) - 1.0).abs() < 1e-6 && (moment(&haze_phase, 0) - 1.0).abs() < 1e-6);
        assert!(moment(&air_phase, 1).abs() < 1e-9 && (moment(&haze_phase, 1) - 0.703).abs() < 2e-3);
    }

    /// Sixteen wavelengths see the sun as the observer's eighty do.
    #[test]
    fn sunlight_has_the_colour_of_its_black_body() {
        let sun = lux(&[1.0; LANES]);
        let expected = crate::scene::blackbody::blackbody(SUN_KELVIN).as_dvec3() * SUN_ILLUMINANCE;
        assert!((sun / expected - DVec3::ONE).abs().max_element() < 0.01, "{sun} for {expected}");
    }
}
