//! Area lights: triangles, rectangles and spheres whose material emits.

use std::f64::consts::PI;

use glam::{DVec3, DVec4, Vec3, Vec4};

use super::super::light_tree::Bounds;
use super::super::params::INVALID;
use super::collect::DARK;
use super::pictures::{Part, Picture};
use super::{LightBuilder, LightCollector, brightness};
use crate::accel::features::AlphaClass;
use crate::interface::LightKind as Kind;
use crate::interface::records::lights::{LIGHT_ALPHA, LIGHT_MIRRORED, LIGHT_TWO_SIDED, LightRecord};
use crate::scene::{AlphaMode, Geometry, Material, Scene, TriangleMesh};

/// Bound of the rounding error of a point on a light, as a fraction of its coordinates.
const ROUNDING_BOUND: f64 = 8.0 / 16_777_216.0;

/// Adds all primitives whose material emits; returns [`super::Lights::light_of`]. A sphere under a
/// non-uniform scale has no closed form: only BSDF sampling finds it.
pub(super) fn add(all: &mut LightCollector, builder: &mut LightBuilder, scene: &Scene) -> Vec<u32> {
    let LightBuilder { origin, alpha, moves, means, side, parts, emitters, .. } = builder;
    let (mut light_of, mut of_primitives) = (vec![INVALID; scene.instances.len()], Vec::new());

    // what emits and is there
    for (i, instance) in scene.instances.iter().enumerate() {
        let mesh = &scene.meshes[instance.mesh];
        let material = &scene.materials[mesh.material];
        // unlit surfaces are visible but illuminate nothing; surfaces that no ray can hit are
        // neither
        let changes = emitters.contains(&mesh.material);
        let is_dark = material.emissive == Vec3::ZERO && !changes;
        if is_dark || material.unlit || alpha[instance.mesh] == AlphaClass::Absent {
            continue;
        }
        // a hidden one stays in the list if it may be shown again, and is dark
        let hidden = scene.hidden.contains(&i);
        if hidden && !moves[i] {
            continue;
        }
        let emissive = if hidden { Vec3::ZERO } else { material.emissive };
        let to_world = instance.object_to_world;
        let base = LightRecord {
            intensity: emissive.to_array(),
            instance: i as u32,
            flags: if material.double_sided { LIGHT_TWO_SIDED } else { 0 },
            ..Default::default()
        };
        let mut mean = |texture: Option<usize>| *means.entry(texture).or_insert_with(|| mean_texture(scene, texture));
        let of_textures = brightness(emissive * mean(material.emissive_texture.map(|slot| slot.texture)).truncate());
        let is_tested = alpha[instance.mesh] == AlphaClass::Tested;
        let alpha_factor = if is_tested {
            mean_alpha(material, &mesh.geometry, mean(material.base_color_texture.map(|slot| slot.texture)).w)
        } else {
            1.0
        };
        let least = if hidden || changes { DARK } else { 0.0 };
        let brightness = (of_textures * alpha_factor).max(least);

        // its lights, one or more a primitive
        let first = of_primitives.len();
        match &mesh.geometry {
            Geometry::Triangles(t) => {
                let flags = base.flags
                    | if to_world.matrix3.determinant() < 0.0 { LIGHT_MIRRORED } else { 0 }
                    | if is_tested { LIGHT_ALPHA } else { 0 };
                // what moves may be a rectangle at times, but its lights are of one kind
                let plain = material.emissive_texture.is_none() && !is_tested && !moves[i];
                let point = |k: u32| to_world.transform_point3(t.positions[k as usize].as_dvec3()) - *origin;
                let slot = material.emissive_texture.filter(|_| !moves[i] && *side > 1);
                let pictured = slot.map(|slot| {
                    let all_parts = || Picture::new(scene, t, slot, material.emissive).all_parts(*side, of_textures);
                    &*parts.entry(instance.mesh).or_insert_with(all_parts)
                });
                // none, one, or many lights of a triangle: in proportion to its own brightness, and
                // alpha for all alike
                let parts = |k: usize| pictured.map_or(&[][..], |parts| &parts[k]);
                let lights = add_triangles(
                    all,
                    t,
                    point,
                    plain,
                    (brightness, alpha_factor),
                    parts,
                    LightRecord { flags, ..base },
                );
                of_primitives.extend(lights);
            }
            Geometry::Spheres(spheres) => {
                let m = to_world.matrix3;
                let scale = [m.x_axis.length(), m.y_axis.length(), m.z_axis.length()];
                if scale.iter().any(|s| (s / scale[0] - 1.0).abs() > 1e-6) {
                    continue;
                }
                for (primitive, s) in (0..).zip(spheres) {
                    let centre = to_world.transform_point3(s.center.as_dvec3()) - *origin;
                    let radius = f64::from(s.radius) * scale[0];
                    let record = LightRecord { primitive, ..base };
                    of_primitives.push(add_sphere(all, centre, radius, brightness, record));
                }
            }
        }
        light_of[i] = (scene.instances.len() + first) as u32;
    }

    // no table where nothing emits
    if light_of.iter().all(|&first| first == INVALID) {
        return Vec::new();
    }
    light_of.extend(of_primitives);
    light_of
}

/// Adds a sphere, and returns its light. `base` is its record without place and shape.
fn add_sphere(all: &mut LightCollector, centre: DVec3, radius: f64, brightness: f64, base: LightRecord) -> u32 {
    let record = LightRecord {
        kind: Kind::Sphere as u32,
        position: centre.as_vec3().to_array(),
        radius: radius as f32,
        lift: ((centre.abs().max_element() + radius) * ROUNDING_BOUND) as f32,
        ..base
    };
    let bounds = Bounds {
        lo: centre - radius,
        hi: centre + radius,
        axis: DVec3::Z,
        spread: PI,
        falloff: 0.5 * PI,
        two_sided: false,
        intensity: PI * radius * radius * brightness,
    };
    all.push_placed(record, bounds)
}

/// Adds the triangles of a mesh. Two neighbours that form a rectangle of one radiance (`plain`) are
/// one light; a triangle that has `parts` is as many lights. `brightness`: that of the whole mesh,
/// and the factor in it that alpha is. Returns the light of each triangle, the first of its parts.
fn add_triangles<'p>(
    all: &mut LightCollector,
    mesh: &TriangleMesh,
    point: impl Fn(u32) -> DVec3,
    plain: bool,
    (brightness, alpha_factor): (f64, f64),
    parts: impl Fn(usize) -> &'p [Part],
    base: LightRecord,
) -> Vec<u32> {
    let mut of_primitives = Vec::with_capacity(mesh.indices.len());
    let two_sided = base.flags & LIGHT_TWO_SIDED != 0;
    // a mirroring transform reverses the winding
    let turn = if base.flags & LIGHT_MIRRORED != 0 { -1.0 } else { 1.0 };

    // a light with its bounds
    let mut push =
        |kind: Kind, [a, e1, e2]: [DVec3; 3], primitive: usize, slack: f64, part: (u32, f64), brightness: f64| {
            let (flags, share) = part;
            let normal = turn * e1.cross(e2);
            let area = if kind == Kind::Rectangle { 1.0 } else { 0.5 } * normal.length();
            let (b, c) = (a + e1, a + e2);
            let far = if kind == Kind::Rectangle { a + e1 + e2 } else { a };
            let extent = a.abs().max(b.abs()).max(c.abs()).max_element() + e1.abs().max(e2.abs()).max_element();
            // barycentric coordinates follow the vertices; a reversed winding reverses the normal
            let record = LightRecord {
                kind: kind as u32,
                position: a.as_vec3().to_array(),
                axis: e1.as_vec3().to_array(),
                edge: e2.as_vec3().to_array(),
                primitive: primitive as u32,
                lift: (extent * ROUNDING_BOUND + slack) as f32,
                flags: base.flags | flags,
                ..base
            };
            let bounds = Bounds {
                lo: a.min(b).min(c).min(far),
                hi: a.max(b).max(c).max(far),
                axis: normal.normalize_or(DVec3::Z),
                spread: 0.0,
                falloff: 0.5 * PI,
                two_sided,
                intensity: area * brightness,
            };
            all.push_part(record, bounds, share)
        };

    // two triangles, a triangle, or its parts at a time
    let whole = (0, 1.0);
    let mut k = 0;
    while k < mesh.indices.len() {
        let corners = mesh.indices[k].map(&point);
        let next = mesh.indices.get(k + 1).filter(|_| plain).map(|n| n.map(&point));
        if let Some((rectangle, slack)) = next.and_then(|next| rectangle(corners, next)) {
            let index = push(Kind::Rectangle, rectangle, k, slack, whole, brightness);
            of_primitives.extend([index; 2]);
            k += 2;
            continue;
        }
        let [a, b, c] = corners;
        let (e1, e2) = (b - a, c - a);
        let all_parts: f64 = parts(k).iter().map(|p| p.brightness).sum();
        let mut part = |part: &Part| {
            let corner = a + part.corner.x * e1 + part.corner.y * e2;
            let triangle = [corner, part.scale * e1, part.scale * e2];
            push(
                Kind::Triangle,
                triangle,
                k,
                0.0,
                (part.flags, part.brightness / all_parts),
                part.brightness * alpha_factor,
            )
        };
        // they follow one another: shaders count from the first
        let indices: Vec<u32> = parts(k).iter().map(&mut part).collect();
        let first = indices.first().copied();
        of_primitives.push(first.unwrap_or_else(|| push(Kind::Triangle, [a, e1, e2], k, 0.0, whole, brightness)));
        k += 1;
    }
    of_primitives
}

/// The rectangle that two triangles form, as a corner and two edges, with the error of its corners;
/// `None` if they form none.
fn rectangle(first: [DVec3; 3], second: [DVec3; 3]) -> Option<([DVec3; 3], f64)> {
    let extent = first.iter().chain(&second).fold(0.0f64, |e, p| e.max(p.abs().max_element()));
    // positions are rounded to single precision, both in object and in world space
    let slack = 2.0 * extent / 16_777_216.0;
    for k in 0..3 {
        let [a, b, c] = [first[k], first[(k + 1) % 3], first[(k + 2) % 3]];
        let (e1, e2) = (b - a, c - a);
        let shorter = e1.length().min(e2.length());
        if shorter.is_nan() || shorter <= 1e4 * slack || e1.dot(e2).abs() > 1e-5 * e1.length() * e2.length() {
            continue;
        }
        // the second triangle shares the diagonal, in the opposite direction
        let d = a + e1 + e2;
        for j in 0..3 {
            let other = [second[j], second[(j + 1) % 3], second[(j + 2) % 3]];
            if other[0] == c && other[1] == b && (other[2] - d).length() <= slack {
                return Some(([a, e1, e2], slack));
            }
        }
    }
    None
}

/// Mean alpha of an emitter with transparency, as a factor of its power; an estimate suffices.
fn mean_alpha(material: &Material, geometry: &Geometry, of_texture: f32) -> f64 {
    let of_vertices = match geometry {
        Geometry::Triangles(t) if !t.colors.is_empty() => {
            t.colors.iter().map(|c| c.w).sum::<f32>() / t.colors.len() as f32
        }
        _ => 1.0,
    };
    let mean = material.base_color.w * of_texture * of_vertices;
    match material.alpha_mode {
        // for a mask the mean says little: opaque texels may have any alpha above the cutoff
        AlphaMode::Mask { .. } => f64::from(mean.clamp(0.25, 1.0)),
        _ => f64::from(mean.clamp(1e-3, 1.0)),
    }
}

/// Mean of an sRGB texture, linear, and of its alpha.
fn mean_texture(scene: &Scene, texture: Option<usize>) -> Vec4 {
    let Some(texture) = texture else { return Vec4::ONE };
    let texels = &scene.textures[texture].texels;
    let mut sum = DVec4::ZERO;
    for i in 0..texels.len() {
        sum += Vec4::from_array(texels.decode_srgb(i)).as_dvec4();
    }
    (sum / texels.len().max(1) as f64).as_vec4()
}
