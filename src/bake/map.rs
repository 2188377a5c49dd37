//! Values of the texels of a map.

use std::collections::BTreeSet;

use glam::{DVec3, Vec2, Vec3};

use super::cage::{Detailed, Projector, SimplePoint};
use super::frames::{SurfaceFrames, SurfacePoint};
use super::kept::{KeptParts, Part};
use super::light::LightTracer;
use super::plan::{PlannedTexture, Surface};
use super::seams::{SeamLookups, Seams};
use super::smooth::{FilterTexel, smooth};
use super::texels::{BAND, Layout, POINTS, TexelPoint};
use super::trace::{BakePoint, PointSums, PointTracer, Sampling};
use super::{BakeSettings, Map, SeamTreatment, Space, backfaces, fill};
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::Control;
use crate::ray::Hit;
use crate::scene::Scene;
use crate::tracer::Tracer;

/// Points that are sampled at a time, about.
const BATCH: usize = 1 << 20;
/// Further rounds of samples of texels whose error is larger than wanted, at most.
const MAX_ROUNDS: u32 = 63;

/// A map of a texture's surfaces.
#[derive(Clone, Debug, Default)]
pub struct BakedMap {
    /// Width and height, texels.
    pub size: [u32; 2],
    /// Values by texel, rows from the top: the first alone, or all three of a vector. Directions
    /// have unit length, positions are in scene units.
    pub values: Vec<Vec3>,
    /// Texels that surfaces cover.
    pub covered: Vec<bool>,
    /// Variance of a sample of each texel, as far as samples are independent; of texels that are
    /// filled that of the covered one. Empty unless [`BakeSettings::has_noise`].
    pub variances: Vec<f32>,
    /// Number of samples of each texel, likewise.
    pub samples: Vec<u32>,
    /// Texels that a surface covers, but inside of other geometry: they are filled as those that
    /// none covers.
    pub hidden: usize,
    /// Rays.
    pub rays: u64,
    /// Estimated root mean square error of covered texels; 0 for what is not sampled.
    pub error: f64,
    /// Bounds of positions.
    pub bounds: (Vec3, Vec3),
    /// Differences at seams; `None` where there are none, and for directions in tangent space.
    pub seams: Option<Seams>,
}

/// Sums over a texel's samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TexelSums {
    /// Sum of the values, or of directions.
    pub value: Vec3,
    /// Sum of the values that the variance is of.
    pub scalar: f64,
    /// Sum of their squares.
    pub squares: f64,
    /// Number of samples.
    pub samples: u32,
    /// Position of the first point, where noise is filtered.
    pub position: DVec3,
    /// Normal of the first point, where noise is filtered.
    pub normal: Vec3,
}

impl TexelSums {
    /// Variance of the mean, as independent samples would have it.
    fn variance(&self) -> f64 {
        let n = f64::from(self.samples);
        if self.samples < 2 { 0.0 } else { (self.squares / n - (self.scalar / n).powi(2)).max(0.0) / (n - 1.0) }
    }

    /// That variance with a sample of 0 and one of 1 added, as the rule of succession has it: a
    /// few samples that are all open do not say that the next one is.
    fn cautious_variance(&self) -> f64 {
        let n = f64::from(self.samples) + 2.0;
        ((self.squares + 1.0) / n - ((self.scalar + 1.0) / n).powi(2)).max(0.0) / (n - 1.0)
    }
}

/// The scene that rays are traced against.
#[derive(Clone, Copy)]
pub struct Traced<'a> {
    /// The scene: that of the surfaces, or a detailed model.
    pub scene: &'a Scene,
    /// Tracer of the scene.
    pub tracer: &'a Tracer,
    /// The scene as the tracer has it.
    pub flat: &'a FlatScene<'a>,
    /// How the surfaces of a detailed model are looked for; `None`: surfaces are their own.
    pub detailed: Option<Detailed<'a>>,
}

/// A texture whose texels are being sampled.
pub struct TextureBake<'a> {
    scene: &'a Scene,
    texture: &'a PlannedTexture,
    settings: &'a BakeSettings,
    /// Sums by texel, rows from the top.
    texels: Vec<TexelSums>,
    hidden: usize,
    rays: u64,
}

impl<'a> TextureBake<'a> {
    /// Begins with no samples.
    pub fn new(scene: &'a Scene, texture: &'a PlannedTexture, settings: &'a BakeSettings) -> Self {
        let count = texture.size[0] as usize * texture.size[1] as usize;
        Self { scene, texture, settings, texels: vec![TexelSums::default(); count], hidden: 0, rays: 0 }
    }

    /// Samples the surfaces of one of the texture's materials, or all; `control` hears how many
    /// bands of rows are done. What `kept` has of them is not sampled again, and it gets the rest.
    ///
    /// # Errors
    /// Those of the device and of `kept`, and [`Error::Interrupted`].
    pub fn sample(
        &mut self,
        traced: Traced,
        material: Option<usize>,
        mut kept: Option<&mut KeptParts>,
        control: &mut dyn Control,
    ) -> Result<()> {
        let Self { texture, settings, .. } = *self;
        let shown = texture.shown_corners();
        let is_sampled = |surface: &Surface| material.is_none_or(|material| surface.material == material);
        let own = |(corners, surface)| if is_sampled(surface) { corners } else { &[][..] };
        let corners: Vec<&[[Vec2; 3]]> = shown.iter().map(|c| &c[..]).zip(&texture.surfaces).map(own).collect();
        let layout = Layout::new(texture.size, &corners);
        let mut baker = Baker::new(self.scene, traced, texture, settings)?;

        // bands of rows, so many that their points are a batch
        let [width, height] = texture.size.map(|n| n as usize);
        let bands_at_a_time = (BATCH / (POINTS * width * BAND as usize)).max(1);
        let bands = layout.band_count();
        let instances = texture.surfaces.iter().map(|s| s.instances.len()).max().unwrap_or_default();
        let points_at_a_time = if settings.averages_instances { BATCH / instances.max(1) } else { BATCH };
        for first in (0..bands).step_by(bands_at_a_time) {
            if control.should_stop()? {
                return Err(Error::Interrupted);
            }
            let last = (first + bands_at_a_time).min(bands);
            let rows = width * (first * BAND as usize)..width * height.min(last * BAND as usize);
            if let Some(part) = kept.as_mut().map(|kept| kept.next(&rows)).transpose()?.flatten() {
                part.texels.into_iter().for_each(|(at, sums)| self.texels[at] = sums);
                self.hidden += part.hidden;
                self.rays += part.rays;
                control.progress(last as u64, bands as u64);
                continue;
            }

            // the samples of their points
            let found = layout.points(first..last);
            let points: Vec<TexelPoint> = found.into_iter().flat_map(|band| band.points).collect();
            let (mut hidden, before) = (0, baker.rays);
            for part in parts_of_texels(&points, points_at_a_time) {
                hidden += baker.add(part, &mut self.texels, control)?;
            }
            let rays = baker.rays - before;
            if let Some(kept) = &mut kept {
                let sums = rows.clone().map(|at| (at, self.texels[at])).filter(|(_, sums)| sums.samples > 0);
                kept.add(&rows, &Part { texels: sums.collect(), hidden, rays })?;
            }
            self.hidden += hidden;
            self.rays += rays;
            control.progress(last as u64, bands as u64);
        }
        Ok(())
    }

    /// Turns the sums into the map.
    pub fn finish(self) -> BakedMap {
        let Self { scene, texture, settings, texels, hidden, rays } = self;
        map_of_sums(
            scene,
            texture,
            settings,
            &texels,
            BakedMap { size: texture.size, hidden, rays, ..BakedMap::default() },
        )
    }
}

/// Fills a map with the values of sums.
fn map_of_sums(
    scene: &Scene,
    texture: &PlannedTexture,
    settings: &BakeSettings,
    texels: &[TexelSums],
    mut map: BakedMap,
) -> BakedMap {
    // means, and the error that their samples' spread leaves
    let (mut error, mut covered) = (0.0, 0u64);
    for texel in texels {
        map.covered.push(texel.samples > 0);
        map.values.push(mean_of(settings.map, texel));
        error += texel.variance();
        covered += u64::from(texel.samples > 0);
    }
    if settings.is_smoothed && settings.map.is_sampled() {
        smooth_values(&mut map, settings.map, texels);
    }
    map.error = (error / covered.max(1) as f64).sqrt();
    let shown = map.values.iter().zip(&map.covered).filter(|(_, covered)| **covered).map(|(v, _)| *v);
    map.bounds = shown.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));

    // beyond the borders of charts
    let nearest = fill::nearest_covered(&map.covered, map.size, settings.padding);
    let filled = nearest.iter().enumerate().map(|(at, from)| match from {
        Some(from) => map.values[*from as usize],
        None => background(settings.map, map.values[at]),
    });
    map.values = filled.collect();
    if settings.has_noise {
        let shown = nearest.iter().enumerate().map(|(at, from)| &texels[from.map_or(at, |from| from as usize)]);
        let noise = |texel: &TexelSums| ((texel.variance() * f64::from(texel.samples)) as f32, texel.samples);
        (map.variances, map.samples) = shown.map(noise).unzip();
    }

    // edges whose sides lie apart
    if let Some(lookups) = SeamLookups::find(scene, texture, settings, &map.covered) {
        if settings.seams == SeamTreatment::Match {
            lookups.equalize(&mut map.values, settings.map);
        }
        map.seams = lookups.measure(&map.values);
    }
    map
}

/// The value of a texel: a mean, or a direction of unit length.
fn mean_of(map: Map, texel: &TexelSums) -> Vec3 {
    match map {
        _ if texel.samples == 0 => Vec3::ZERO,
        Map::BentNormal | Map::Normal => texel.value.normalize_or(Vec3::Z),
        _ => texel.value / texel.samples as f32,
    }
}

/// Points in parts of about so many, each of which has all points of its texels.
fn parts_of_texels(points: &[TexelPoint], most: usize) -> Vec<&[TexelPoint]> {
    let (mut parts, mut rest) = (Vec::new(), points);
    while !rest.is_empty() {
        let mut end = most.clamp(1, rest.len());
        while end < rest.len() && rest[end].texel == rest[end - 1].texel {
            end += 1;
        }
        let (part, after) = rest.split_at(end);
        parts.push(part);
        rest = after;
    }
    parts
}

/// Filters noise in the texture.
fn smooth_values(map: &mut BakedMap, property: Map, texels: &[TexelSums]) {
    let read = |(texel, value): (&TexelSums, &Vec3)| FilterTexel {
        value: *value,
        variance: texel.variance() as f32,
        position: texel.position,
        normal: texel.normal,
        is_covered: texel.samples > 0,
    };
    let mut filtered: Vec<FilterTexel> = texels.iter().zip(&map.values).map(read).collect();
    smooth(&mut filtered, map.size);
    let is_direction = property == Map::BentNormal;
    for (value, texel) in map.values.iter_mut().zip(filtered) {
        *value = if is_direction { texel.value.normalize_or(Vec3::Z) } else { texel.value };
    }
}

/// The value of texels that no surface is near.
fn background(map: Map, value: Vec3) -> Vec3 {
    match map {
        Map::Ao | Map::Thickness => Vec3::ONE,
        Map::Curvature => Vec3::splat(0.5),
        Map::BentNormal | Map::Normal => Vec3::Z,
        Map::Light => Vec3::ZERO,
        Map::Position => value,
    }
}

/// A point that is sampled.
#[derive(Clone, Copy)]
struct Sampled {
    /// The point of the texel.
    point: TexelPoint,
    /// The instance of its surface.
    instance: usize,
    /// The record that rays leave from.
    record: BakePoint,
}

/// Bakes points of a texture.
struct Baker<'a> {
    scene: &'a Scene,
    traced: Traced<'a>,
    texture: &'a PlannedTexture,
    settings: &'a BakeSettings,
    /// The surfaces.
    frames: Vec<Option<SurfaceFrames<'a>>>,
    /// The meshes of a detailed model.
    detailed: Vec<Option<SurfaceFrames<'a>>>,
    /// The rays that find points of it.
    projector: Option<Projector<'a>>,
    /// Rays out of the surface, and into it.
    outward: Option<PointTracer<'a>>,
    inward: Option<PointTracer<'a>>,
    light: Option<LightTracer<'a>>,
    sample_bits: u32,
    rays: u64,
}

impl<'a> Baker<'a> {
    fn new(
        scene: &'a Scene,
        traced: Traced<'a>,
        texture: &'a PlannedTexture,
        settings: &'a BakeSettings,
    ) -> Result<Self> {
        let sample_bits = settings.sample_bits(POINTS);
        let sampling = |is_inward| Sampling {
            occlusion: settings.occlusion,
            is_inward,
            has_lengths: settings.map == Map::Thickness,
            has_directions: settings.map == Map::BentNormal,
            seed: settings.seed,
            sample_bits,
        };
        let is_outward = matches!(settings.map, Map::Ao | Map::BentNormal | Map::Curvature);
        let is_inward = matches!(settings.map, Map::Thickness | Map::Curvature);
        let has_light = settings.map == Map::Light;
        let light = has_light.then(|| LightTracer::new(traced.tracer, traced.flat, settings, sample_bits));
        let needs_tangents = settings.map.is_vector() && settings.space == Space::Tangent;
        let tracer = traced.tracer;
        let meshes = traced.detailed.map_or(0, |_| traced.scene.meshes.len());
        Ok(Self {
            scene,
            traced,
            texture,
            settings,
            frames: texture.surfaces.iter().map(|s| SurfaceFrames::new(scene, s, needs_tangents)).collect(),
            detailed: (0..meshes).map(|mesh| SurfaceFrames::of_mesh(traced.scene, mesh)).collect(),
            projector: traced.detailed.map(|detailed| Projector::new(detailed, tracer, traced.flat.origin)),
            outward: if is_outward { Some(PointTracer::new(tracer, sampling(false))?) } else { None },
            inward: if is_inward { Some(PointTracer::new(tracer, sampling(true))?) } else { None },
            light: light.transpose()?,
            sample_bits,
            rays: 0,
        })
    }

    /// Adds points to their texels; returns how many texels are inside of other geometry.
    fn add(&mut self, points: &[TexelPoint], texels: &mut [TexelSums], control: &mut dyn Control) -> Result<usize> {
        let mut sampled = self.sampled_points(points);
        if self.traced.detailed.is_some() {
            sampled = self.project(sampled, control)?;
        }
        let width = self.texture.size[0];
        let place = move |sample: &Sampled| (sample.point.texel[1] * width + sample.point.texel[0]) as usize;

        // the samples of each, but for those that may be inside of something
        let sums = self.trace(&sampled, control)?;
        let is_hidden = self.are_hidden(&sampled, &sums, control)?;
        let mut hidden = BTreeSet::new();
        for ((sample, sums), is_hidden) in sampled.iter().zip(&sums).zip(&is_hidden) {
            if *is_hidden {
                hidden.insert(place(sample));
            } else {
                self.add_to(&mut texels[place(sample)], sample, sums);
            }
        }

        // more of them, where the error is larger than wanted
        let samples_of_texel = (POINTS as u32) << self.sample_bits;
        let mut left: Vec<Sampled> = sampled.into_iter().zip(is_hidden).filter(|(_, h)| !h).map(|(s, _)| s).collect();
        let rounds = if self.settings.target_error.is_some() { MAX_ROUNDS } else { 0 };
        for _ in 0..rounds {
            let target = self.settings.target_error.unwrap_or_default();
            left.retain(|sample| texels[place(sample)].cautious_variance() > target * target);
            if left.is_empty() {
                break;
            }
            left.iter_mut().for_each(|sample| sample.record.first_sample += samples_of_texel);
            let sums = self.trace(&left, control)?;
            left.iter().zip(&sums).for_each(|(sample, sums)| self.add_to(&mut texels[place(sample)], sample, sums));
        }
        Ok(hidden.into_iter().filter(|&at| texels[at].samples == 0).count())
    }

    /// Sums of the samples of points: out of the surface, and into it.
    fn trace(&mut self, sampled: &[Sampled], control: &mut dyn Control) -> Result<Vec<[PointSums; 2]>> {
        let records: Vec<BakePoint> = sampled.iter().map(|s| s.record).collect();
        let mut both = vec![[PointSums::default(); 2]; records.len()];
        for (side, tracer) in [&mut self.outward, &mut self.inward].into_iter().enumerate() {
            if let Some(tracer) = tracer {
                let sums = tracer.trace(&records, control)?;
                both.iter_mut().zip(sums).for_each(|(both, sums)| both[side] = sums);
                self.rays += (records.len() as u64) << self.sample_bits;
            }
        }
        if let Some(light) = &mut self.light {
            let before = light.rays;
            let sums = light.trace(&records, control)?;
            both.iter_mut().zip(sums).for_each(|(both, sums)| both[0] = sums);
            self.rays += light.rays - before;
        }
        Ok(both)
    }

    /// For each point whether it is inside of other geometry.
    fn are_hidden(&self, sampled: &[Sampled], sums: &[[PointSums; 2]], control: &mut dyn Control) -> Result<Vec<bool>> {
        let can_tell = self.outward.is_some() || self.light.is_some();
        let is_dark = |k: &usize| can_tell && sums[*k][0].value == 0.0;
        let dark: Vec<(usize, SurfacePoint)> =
            (0..sampled.len()).filter(is_dark).filter_map(|k| Some((k, self.traced_point(&sampled[k])?))).collect();
        let points: Vec<SurfacePoint> = dark.iter().map(|(_, point)| *point).collect();
        let Traced { scene, tracer, flat, .. } = self.traced;
        let inside = backfaces::are_inside(scene, tracer, flat.origin, &points, control)?;
        let mut is_hidden = vec![false; sampled.len()];
        dark.iter().zip(inside).for_each(|((k, _), inside)| is_hidden[*k] = inside);
        Ok(is_hidden)
    }

    /// Adds the samples of a point to its texel.
    fn add_to(&self, texel: &mut TexelSums, sample: &Sampled, [out, inside]: &[PointSums; 2]) {
        let is_first = texel.samples == 0 && self.settings.is_smoothed;
        if let Some(surface) = is_first.then(|| self.surface_point(sample)).flatten() {
            texel.position = surface.world;
            texel.normal = surface.geometric.as_vec3();
        }
        texel.value += self.point_value(sample, *out, *inside);
        texel.scalar += f64::from(out.value + inside.value);
        texel.squares += f64::from(out.squares + inside.squares);
        texel.samples += 1u32 << self.sample_bits;
    }

    /// Each point, on the instances that count. A texel of one or two points, as those along the
    /// borders of charts are, samples them four times or twice, so that it has as many samples as
    /// others.
    fn sampled_points(&self, points: &[TexelPoint]) -> Vec<Sampled> {
        let most = if self.settings.averages_instances { usize::MAX } else { 1 };
        let mut sampled = Vec::with_capacity(points.len());
        for of_texel in points.chunk_by(|a, b| a.texel == b.texel) {
            let times = if self.settings.map.is_sampled() { POINTS / of_texel.len() } else { 1 };
            for (place, point) in of_texel.iter().enumerate() {
                let surface = &self.texture.surfaces[point.surface as usize];
                for (nth, &instance) in surface.instances.iter().take(most).enumerate() {
                    // the points of a texel take parts of one sequence of samples
                    for part in (0..times).map(|time| nth * POINTS + time * of_texel.len() + place) {
                        let record = BakePoint {
                            instance: instance as u32,
                            primitive: point.triangle,
                            u: point.barycentrics.x,
                            v: point.barycentrics.y,
                            texel: point.texel[0] | point.texel[1] << 16,
                            first_sample: (part as u32) << self.sample_bits,
                        };
                        sampled.push(Sampled { point: *point, instance, record });
                    }
                }
            }
        }
        sampled
    }

    /// Moves points onto the detailed model. Those that meet nothing are left out.
    fn project(&self, sampled: Vec<Sampled>, control: &mut dyn Control) -> Result<Vec<Sampled>> {
        let (Some(projector), Some(detailed)) = (&self.projector, self.traced.detailed) else { return Ok(sampled) };
        let point_of = |sample: &Sampled| {
            let TexelPoint { surface, triangle, barycentrics, .. } = sample.point;
            let uv = || {
                let [a, b, c] = self.texture.surfaces[surface as usize].corners[triangle as usize];
                a + barycentrics.x * (b - a) + barycentrics.y * (c - a)
            };
            Some(SimplePoint {
                surface: self.surface_point(sample)?,
                triangle: triangle as usize,
                barycentrics,
                instance: sample.instance,
                skew: detailed.skew.at(uv),
            })
        };
        let Some(points) = sampled.iter().map(point_of).collect::<Option<Vec<_>>>() else { return Ok(Vec::new()) };
        let moved = sampled.into_iter().zip(projector.project(&points, control)?).filter(|(_, hit)| hit.is_hit()).map(
            |(sample, hit)| {
                let Hit { instance, primitive, u, v, .. } = hit;
                Sampled { record: BakePoint { instance, primitive, u, v, ..sample.record }, ..sample }
            },
        );
        Ok(moved.collect())
    }

    /// The point of the texture's surface.
    fn surface_point(&self, sample: &Sampled) -> Option<SurfacePoint> {
        let frames = self.frames[sample.point.surface as usize].as_ref()?;
        Some(frames.point(&sample.point, sample.instance))
    }

    /// The point that is sampled: of the surface, or of the detailed model.
    fn traced_point(&self, sample: &Sampled) -> Option<SurfacePoint> {
        if self.traced.detailed.is_none() {
            return self.surface_point(sample);
        }
        let BakePoint { instance, primitive, u, v, .. } = sample.record;
        let mesh = self.traced.scene.instances[instance as usize].mesh;
        Some(self.detailed[mesh].as_ref()?.at(primitive as usize, Vec2::new(u, v), instance as usize))
    }

    /// The value that a point adds to its texel, times its samples.
    fn point_value(&self, sample: &Sampled, out: PointSums, inside: PointSums) -> Vec3 {
        let samples = (1u32 << self.sample_bits) as f32;
        let scalar = |value: f32| Vec3::new(value, 0.0, 0.0);
        match self.settings.map {
            Map::Ao => scalar(out.value),
            Map::Thickness => scalar(inside.value),
            Map::Curvature => scalar(0.5 * (samples + out.value - inside.value)),
            Map::BentNormal => self.vector(sample, |_| out.direction.as_dvec3()),
            Map::Light => out.direction,
            Map::Normal => self.vector(sample, |traced| traced.frame.z_axis) * samples,
            Map::Position => self.position(sample) * samples,
        }
    }

    /// A direction in world space that belongs to the sampled point, in the space of the settings.
    fn vector(&self, sample: &Sampled, direction: impl Fn(&SurfacePoint) -> DVec3) -> Vec3 {
        let (Some(surface), Some(traced)) = (self.surface_point(sample), self.traced_point(sample)) else {
            return Vec3::ZERO;
        };
        let world = direction(&traced);
        let to_world = self.scene.instances[sample.instance].object_to_world.matrix3;
        let own = match (self.settings.space, self.settings.map) {
            (Space::World, _) => world,
            (Space::Tangent, _) => surface.frame.transpose() * world,
            // normals are turned by the inverse transpose, others as they are
            (Space::Object, Map::Normal) => (to_world.transpose() * world).normalize_or_zero(),
            (Space::Object, _) => (to_world.inverse() * world).normalize_or_zero() * world.length(),
        };
        own.as_vec3()
    }

    /// Position of the sampled point; in tangent space, which has no origin, as in object space.
    fn position(&self, sample: &Sampled) -> Vec3 {
        let Some(traced) = self.traced_point(sample) else { return Vec3::ZERO };
        match self.settings.space {
            Space::World => traced.world.as_vec3(),
            Space::Object | Space::Tangent => {
                self.scene.instances[sample.instance].object_to_world.inverse().transform_point3(traced.world).as_vec3()
            }
        }
    }
}
