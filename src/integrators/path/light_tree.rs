//! A light tree, which samples a light in proportion to a bound of its contribution at a point:
//! [`LightNode`].
//!
//! Conty Estevez, Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting", HPG
//! 2018, without the splitting; its cost of a split (surface area, orientation, power), with
//! bounding spheres in place of boxes at the nodes.

use std::f64::consts::PI;

use glam::DVec3;

use crate::interface::records::lights::{LIGHT_BOTH_WAYS, LIGHT_LEAF, LightNode};

/// Levels below which lights are split into halves without evaluating costs: with the levels of
/// [`MAX_LIGHTS`] lights, no bit trail is longer than 64.
const MEASURED_LEVELS: u32 = 32;
/// Maximum number of lights in a tree: an index of a node has 30 bits.
const MAX_LIGHTS: usize = 1 << 29;
/// Bins per axis for split candidates.
const BINS: usize = 12;

/// Emission bounds of one or several lights.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// Lower corner of the bounding box.
    pub lo: DVec3,
    /// Upper corner of the bounding box.
    pub hi: DVec3,
    /// Axis of the cone of normals.
    pub axis: DVec3,
    /// Half angle of the cone of normals (theta_o in the paper), radians.
    pub spread: f64,
    /// Maximum angle between a normal and emitted light (theta_e in the paper), radians.
    pub falloff: f64,
    /// Light is emitted along the axis and against it.
    pub two_sided: bool,
    /// Maximum intensity over all directions: luminance per solid angle.
    pub intensity: f64,
}

impl Bounds {
    fn union(&self, o: &Self) -> Self {
        let two_sided = self.two_sided || o.two_sided;
        // if one of them is two-sided, the other's axis may be reversed
        let other = if two_sided && self.axis.dot(o.axis) < 0.0 { -o.axis } else { o.axis };
        let (axis, spread) = cone_union((self.axis, self.spread), (other, o.spread));
        Self {
            lo: self.lo.min(o.lo),
            hi: self.hi.max(o.hi),
            axis,
            spread,
            falloff: self.falloff.max(o.falloff),
            two_sided,
            intensity: self.intensity + o.intensity,
        }
    }

    fn centroid(&self) -> DVec3 {
        0.5 * (self.lo + self.hi)
    }

    /// Split cost of Conty Estevez and Kulla: area, orientation and power.
    fn cost(&self) -> f64 {
        let (o, w) = (self.spread, (self.spread + self.falloff).min(PI));
        let solid = 2.0 * PI * (1.0 - o.cos())
            + 0.5 * PI * (2.0 * w * o.sin() - (o - 2.0 * w).cos() - 2.0 * o * o.sin() + o.cos());
        let d = self.hi - self.lo;
        self.intensity * solid.max(1e-9) * (d.x * d.y + d.y * d.z + d.z * d.x).max(1e-30)
    }

    fn node(&self, link: u32) -> LightNode {
        let centroid = self.centroid().as_vec3();
        // conservative: rounding of centre and radius must not leave a light outside
        let radius =
            (self.hi - centroid.as_dvec3()).length().max((self.lo - centroid.as_dvec3()).length()) * (1.0 + 1e-6);
        // a little wider than the cone is: single precision
        let spread = (self.spread + 1e-4).min(PI);
        LightNode {
            center: centroid.to_array(),
            radius: radius as f32,
            axis: self.axis.as_vec3().to_array(),
            intensity: self.intensity as f32,
            cos_o: spread.cos() as f32,
            sin_o: spread.sin() as f32,
            cos_e: (self.falloff + 1e-4).min(PI).cos() as f32,
            link: link | if self.two_sided { LIGHT_BOTH_WAYS } else { 0 },
        }
    }
}

/// Smallest cone that contains two cones, each an axis and a half angle.
fn cone_union(a: (DVec3, f64), b: (DVec3, f64)) -> (DVec3, f64) {
    let (a, b) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    let between = a.0.angle_between(b.0);
    if (between + b.1).min(PI) <= a.1 {
        return a;
    }
    let spread = 0.5 * (a.1 + between + b.1);
    let turn = a.0.cross(b.0);
    if spread >= PI || turn.length_squared() < 1e-24 {
        return (a.0, if spread >= PI || between > 1.0 { PI } else { spread });
    }
    let axis = glam::DQuat::from_axis_angle(turn.normalize(), spread - a.1) * a.0;
    (axis.normalize(), spread)
}

/// Builds the nodes, root first, and the lights' trails: bit k says second child at level k.
pub(super) fn build(lights: &[Bounds]) -> (Vec<LightNode>, Vec<u64>) {
    assert!(!lights.is_empty() && lights.len() <= MAX_LIGHTS, "{} lights", lights.len());
    let mut tree = Tree { lights, nodes: vec![LightNode::default()], trails: vec![0; lights.len()] };
    let mut all: Vec<u32> = (0..lights.len() as u32).collect();
    tree.fill(0, &mut all, 0, 0);
    (tree.nodes, tree.trails)
}

/// The root of a tree without lights.
pub(super) fn no_lights() -> LightNode {
    LightNode { link: LIGHT_LEAF, ..Default::default() }
}

struct Tree<'a> {
    lights: &'a [Bounds],
    nodes: Vec<LightNode>,
    trails: Vec<u64>,
}

impl Tree<'_> {
    /// Fills node `at` with lights.
    fn fill(&mut self, at: usize, lights: &mut [u32], trail: u64, level: u32) -> Bounds {
        if let [light] = *lights {
            self.trails[light as usize] = trail;
            let bounds = self.lights[light as usize];
            self.nodes[at] = bounds.node(LIGHT_LEAF | light);
            return bounds;
        }
        let middle = self.split(lights, level);
        let child = self.nodes.len();
        self.nodes.extend([LightNode::default(); 2]);
        let (first, second) = lights.split_at_mut(middle);
        let a = self.fill(child, first, trail, level + 1);
        let b = self.fill(child + 1, second, trail | 1 << level, level + 1);
        let bounds = a.union(&b);
        self.nodes[at] = bounds.node(child as u32);
        bounds
    }

    /// Partitions lights into two non-empty sets; returns the size of the first.
    fn split(&self, lights: &mut [u32], level: u32) -> usize {
        let centroid = |k: u32| self.lights[k as usize].centroid();
        let grow = |(lo, hi): (DVec3, DVec3), &k: &u32| (lo.min(centroid(k)), hi.max(centroid(k)));
        let (lo, hi) = lights.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), grow);
        let extent = hi - lo;

        // The cheapest cut between bins along any axis.
        let mut best: Option<(f64, usize, f64)> = None;
        let axes = if level < MEASURED_LEVELS { 0..3 } else { 0..0 };
        for axis in axes.filter(|&a| extent[a] > 0.0) {
            let bin = |k: u32| (((centroid(k)[axis] - lo[axis]) / extent[axis] * BINS as f64) as usize).min(BINS - 1);
            let mut bins: [Option<Bounds>; BINS] = [None; BINS];
            for &k in lights.iter() {
                let b = &self.lights[k as usize];
                let slot = &mut bins[bin(k)];
                *slot = Some(slot.map_or(*b, |s| s.union(b)));
            }
            let join = |a: Option<Bounds>, b: &Option<Bounds>| match (a, b) {
                (Some(a), Some(b)) => Some(a.union(b)),
                (a, b) => a.or(*b),
            };
            for cut in 1..BINS {
                let (left, right) = (bins[..cut].iter().fold(None, join), bins[cut..].iter().fold(None, join));
                let (Some(left), Some(right)) = (left, right) else { continue };
                // prefer splits along the longest axis
                let cost = extent.max_element() / extent[axis] * (left.cost() + right.cost());
                if best.is_none_or(|b| cost < b.0) {
                    best = Some((cost, axis, lo[axis] + extent[axis] * cut as f64 / BINS as f64));
                }
            }
        }
        if let Some((_, axis, cut)) = best {
            let first = partition(lights, |&k| centroid(k)[axis] < cut);
            if first > 0 && first < lights.len() {
                return first;
            }
        }

        // Else halves along the longest axis.
        let axis = if extent.x >= extent.y && extent.x >= extent.z {
            0
        } else if extent.y >= extent.z {
            1
        } else {
            2
        };
        let half = lights.len() / 2;
        lights.select_nth_unstable_by(half, |&a, &b| centroid(a)[axis].total_cmp(&centroid(b)[axis]).then(a.cmp(&b)));
        half
    }
}

/// Moves the items for which `holds` is true to the front; returns their number.
fn partition<T: Copy>(items: &mut [T], holds: impl Fn(&T) -> bool) -> usize {
    let mut first = 0;
    for k in 0..items.len() {
        if holds(&items[k]) {
            items.swap(first, k);
            first += 1;
        }
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interface::records::lights::LIGHT_LINK;
    use crate::sampling::sobol::{hash_combine, to_unit};

    fn random(seed: u32, k: u32) -> f64 {
        f64::from(to_unit(hash_combine(seed, k)))
    }

    fn lights(n: u32) -> Vec<Bounds> {
        (0..n)
            .map(|i| {
                let at = DVec3::new(random(i, 0), 0.2 * random(i, 1), random(i, 2).powi(3)) * 10.0;
                let axis = (DVec3::new(random(i, 3), random(i, 4), random(i, 5)) - 0.5).normalize();
                let size = DVec3::splat(0.05 * random(i, 6));
                let (spread, falloff) = if i % 5 == 0 { (PI, 0.5 * PI) } else { (0.0, 0.5 * PI) };
                Bounds {
                    lo: at - size,
                    hi: at + size,
                    axis,
                    spread,
                    falloff,
                    two_sided: i % 3 == 0,
                    intensity: random(i, 7),
                }
            })
            .collect()
    }

    /// shaders/path/light_tree.glsl, in double precision.
    fn importance(n: &LightNode, from: DVec3) -> f64 {
        let less = |a: (f64, f64), b: (f64, f64)| {
            if a.0 > b.0 { (1.0, 0.0) } else { (a.0 * b.0 + a.1 * b.1, a.1 * b.0 - a.0 * b.1) }
        };
        let d = from - glam::Vec3::from_array(n.center).as_dvec3();
        let (d2, r2) = (d.length_squared(), f64::from(n.radius).powi(2));
        if d2 <= r2 {
            return f64::from(n.intensity) / r2.max(1e-30);
        }
        let mut c = glam::Vec3::from_array(n.axis).as_dvec3().dot(d) / d2.sqrt();
        if n.link & LIGHT_BOTH_WAYS != 0 {
            c = c.abs();
        }
        let w = (c, (1.0 - c * c).max(0.0).sqrt());
        let b = ((1.0 - r2 / d2).sqrt(), (r2 / d2).sqrt());
        let left = less(less(w, (n.cos_o.into(), n.sin_o.into())), b);
        if left.0 > f64::from(n.cos_e) { f64::from(n.intensity) * left.0.max(1e-4) / d2 } else { 0.0 }
    }

    /// Every trail leads to its light, and a parent's bounds contain its children's: if a light
    /// contributes at a point, all its ancestors have an importance above 0 there.
    #[test]
    fn bounds_hold_what_is_below() {
        for n in [1, 2, 3, 100, 3000] {
            let all = lights(n);
            let (nodes, trails) = build(&all);
            assert_eq!(nodes.len(), 2 * n as usize - 1);
            for (light, trail) in trails.iter().enumerate() {
                for sample in 0..20 {
                    let k = light as u32 * 20 + sample;
                    let from = DVec3::new(random(k, 20), random(k, 21), random(k, 22)) * 14.0 - 2.0;
                    let (mut node, mut way, mut above) = (&nodes[0], *trail, vec![]);
                    while node.link & LIGHT_LEAF == 0 {
                        above.push(importance(node, from));
                        node = &nodes[(node.link & LIGHT_LINK) as usize + (way & 1) as usize];
                        way >>= 1;
                    }
                    assert_eq!(node.link & LIGHT_LINK, light as u32);
                    if importance(node, from) > 0.0 {
                        assert!(above.iter().all(|&i| i > 0.0), "light {light} of {n} is lost at {from}: {above:?}");
                    }
                }
            }
        }
    }

    /// Lights at one position have no split by cost and are halved.
    #[test]
    fn coincident_lights_end() {
        let one = lights(1)[0];
        let (nodes, trails) = build(&vec![one; 1 << 12]);
        assert_eq!(nodes.len(), (2 << 12) - 1);
        assert!(trails.iter().all(|&t| t < 1 << 12));
    }

    #[test]
    fn cones_hold_both() {
        for k in 0..500 {
            let axis = |s: u32| (DVec3::new(random(k, s), random(k, s + 1), random(k, s + 2)) - 0.5).normalize();
            let (a, b) = ((axis(0), PI * random(k, 9)), (axis(3), PI * random(k, 10)));
            let (axis, spread) = cone_union(a, b);
            for c in [a, b] {
                assert!(
                    spread >= PI - 1e-9 || axis.angle_between(c.0) + c.1 <= spread + 1e-6,
                    "{a:?} {b:?}: {axis} {spread}"
                );
            }
        }
    }
}
