//! Section 1, scale and place: closed forms and furnaces from 1e-6 to 1e6 units, up to 1e7 from the
//! origin, through mirrored, sheared and non-uniform transforms.

use base64::Engine as _;
use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};

use super::closed_forms::{self, Case, on_plane, options};
use super::{Check, Section, Setup, StressSession, Watch};
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::integrators::rays::{Mode, trace};
use crate::oracle::OracleRay;
use crate::oracle::closed_form as exact;
use crate::ray::Ray;
use crate::scene::builtin::{self, SceneTransform, analytic};
use crate::scene::{Camera, Geometry, Scene, load};
use crate::tracer::{Needs, Tracer, TracerKind};

pub const SECTION: Section = Section {
    name: "scale",
    title: "Scale and place",
    about: "closed forms from 1e-6 to 1e6 units, up to 1e7 units from the origin, and through mirrored, sheared and non-uniform transforms",
    of_scene: false,
    run,
};

/// Largest bias of an image's mean ambient visibility, beside its noise.
const BIAS: f64 = 2e-4;
/// Standard errors within which noise alone leaves an image's mean.
const ERRORS: f64 = 4.5;

/// Scales and places at which what is exact must be exact.
pub fn places() -> Vec<SceneTransform> {
    [
        (1.0, DVec3::ZERO),
        (1e-6, DVec3::ZERO),
        (1e-3, DVec3::ZERO),
        (1e3, DVec3::ZERO),
        (1e6, DVec3::ZERO),
        (1.0, DVec3::new(1e6, 0.37e6, -0.71e6)),
        (1e-3, DVec3::new(1.0, 0.37, -0.71)),
        (1e3, DVec3::splat(-1e6)),
        (1.0, DVec3::new(1e7, 0.0, -1e7)),
        (1e-3, DVec3::new(1e7, -0.3e7, 1e7)),
    ]
    .map(|(scale, offset)| SceneTransform { scale, offset })
    .to_vec()
}

/// Has single precision the digits for a scene whose vertices are at this place in the world?
pub fn can_bake(place: &SceneTransform) -> bool {
    place.offset.abs().max_element() <= 1e6 * place.scale
}

/// Linear maps beside the identity, with their names.
pub fn linear_maps() -> Vec<(&'static str, DMat3)> {
    let sheared = DMat3::from_cols(DVec3::X, DVec3::new(0.7, 1.0, 0.0), DVec3::new(-0.2, 0.4, 1.0));
    vec![
        ("turned", DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.7, -0.4, 1.1))),
        ("mirrored", DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0))),
        ("stretched", DMat3::from_diagonal(DVec3::new(1e-2, 1.0, 30.0))),
        ("sheared", sheared),
        ("sheared and mirrored", sheared * DMat3::from_diagonal(DVec3::new(2.0, -0.5, 1.0))),
    ]
}

/// A scene with `map` in the transforms of its triangle meshes and its inverse in their vertices.
pub fn through(scene: &Scene, map: &DMat3) -> Scene {
    let mut out = scene.clone();
    let (inverse, mirrors, map) = (map.inverse(), map.determinant() < 0.0, DAffine3::from_mat3(*map));
    for mesh in &mut out.meshes {
        if let Geometry::Triangles(t) = &mut mesh.geometry {
            t.positions.iter_mut().for_each(|p| *p = (inverse * p.as_dvec3()).as_vec3());
            t.normals.clear();
            // such a transform turns faces over
            if mirrors {
                t.indices.iter_mut().for_each(|t| t.swap(1, 2));
            }
        }
    }
    for instance in &mut out.instances {
        if let Geometry::Triangles(_) = &out.meshes[instance.mesh].geometry {
            instance.object_to_world *= map;
        }
    }
    out
}

/// Where a ray meets the surface of a closed form.
type Surface = Box<dyn Fn(&OracleRay) -> Option<DVec3>>;

/// A closed form at a place.
pub struct PlacedForm {
    pub what: &'static str,
    pub scene: Scene,
    camera: Camera,
    surface: Surface,
    expected: Box<dyn Fn(DVec3) -> f64>,
}

impl PlacedForm {
    pub fn case(&self, size: u32, spp: u32) -> Case<'_> {
        Case {
            what: self.what,
            scene: &self.scene,
            camera: self.camera.clone(),
            options: options(size, spp, 1.0, f64::INFINITY),
            surface: &self.surface,
            expected: &self.expected,
        }
    }
}

/// Closed forms of ambient occlusion that vary over the image.
pub fn closed_forms_at(place: SceneTransform) -> Vec<PlacedForm> {
    let local = move |p: DVec3| (p - place.offset) / place.scale;
    let angle = std::f64::consts::FRAC_PI_2;
    let (sin, cos) = (angle * 0.5).sin_cos();
    let (up, normal) = (DVec3::new(sin, cos, 0.0), DVec3::new(-cos, sin, 0.0));
    let point = up + DVec3::Z * 0.5;
    let look = |eye: DVec3, target: DVec3, up: DVec3, fov: f64| {
        Camera::look_at(place.point(eye), place.point(target), up, fov)
    };
    let (radius, height) = (1.0, 1.25);
    let ball = analytic::sphere_over_plane(radius, height, 60.0, place);
    let gap = 1.0;

    // Each closed form knows the solid angle that is free at a point of its surface.
    vec![
        PlacedForm {
            what: "groove of 90 degrees",
            scene: analytic::v_groove(angle, 4.0, 6.0, place),
            camera: look(point + normal * 0.6, point, DVec3::Z, 0.6),
            surface: Box::new(move |ray| on_plane(ray, place.offset, normal)),
            expected: Box::new(move |p| {
                let p = local(p);
                exact::v_groove_finite(angle, p.dot(up), p.z, 4.0, 6.0)
            }),
        },
        PlacedForm {
            what: "sphere over a plane",
            camera: ball.cameras[0].clone(),
            scene: ball,
            surface: Box::new(move |ray| floor_beside_sphere(ray, place, radius, height)),
            expected: Box::new(move |p| {
                let p = local(p);
                exact::sphere_over_plane(radius, height, p.x.hypot(p.z)).unwrap_or(f64::NAN)
            }),
        },
        PlacedForm {
            what: "parallel planes",
            scene: analytic::parallel_planes(8.0, 6.0, gap, place),
            camera: look(DVec3::new(3.1, 0.7 * gap, 2.5), DVec3::new(3.3, 0.0, 2.4), DVec3::X, 0.7),
            surface: Box::new(move |ray| on_plane(ray, place.offset, DVec3::Y)),
            expected: Box::new(move |p| {
                let p = local(p);
                exact::parallel_rectangle(gap, [-4.0 - p.x, 4.0 - p.x], [-3.0 - p.z, 3.0 - p.z])
            }),
        },
    ]
}

/// The floor's point that a ray meets, if it passes the sphere well (a twentieth of its radius).
pub fn floor_beside_sphere(ray: &OracleRay, place: SceneTransform, radius: f64, height: f64) -> Option<DVec3> {
    let hit = on_plane(ray, place.offset, DVec3::Y)?;
    let local = (hit - place.offset) / place.scale;
    let from = place.point(DVec3::Y * height) - ray.origin;
    let passes = (from - ray.direction * from.dot(ray.direction)).length() > 1.05 * radius * place.scale;
    (passes && local.x.abs().max(local.z.abs()) < 29.0).then_some(hit)
}

/// Bias of a closed form's image by one tracer.
pub fn check_form(
    setup: &Setup,
    kind: TracerKind,
    name: &str,
    form: &PlacedForm,
    spp: u32,
    watch: &mut Watch,
) -> Result<Check> {
    let case = form.case(32, spp);
    let expected = case.expectations();
    let bias = case.bias(&setup.tracer(kind, &form.scene)?, &expected, watch)?;
    let bound = BIAS.max(ERRORS * bias.standard_error + 2e-6);
    let sentence =
        format!("closed form {:.5}, standard error {:.1e}, {} pixels", bias.expected, bias.standard_error, bias.pixels);
    // an image that looks past its surface says nothing
    let value = if bias.uncovered > 0 || bias.pixels < 256 { f64::NAN } else { bias.bias.abs() };
    Ok(Check::at_most(name, value, "of visibility", bound).says(sentence))
}

/// Samples of a scene whose value is not `want` as it should be: 0 on the compute tracer. Rays that
/// leave a closed box may lose one in 100,000 on others, which is their driver's affair.
pub fn check_exact(
    setup: &Setup,
    kind: TracerKind,
    name: &str,
    scene: &Scene,
    want: f32,
    watch: &mut Watch,
) -> Result<Check> {
    let options = options(setup.effort().pick(48, 192), setup.effort().pick(4, 64), 1.0, f64::INFINITY);
    let image = closed_forms::render(&setup.tracer(kind, scene)?, scene, &scene.cameras[0], &options, watch)?;
    let (covered, off) = closed_forms::samples_off(&image.image.film, image.image.spp, want);
    let least = 0.25 * f64::from(options.samples.size[0] * options.samples.size[1] * options.samples.spp);
    let value = if covered < least { f64::NAN } else { off };
    let spare = if kind == TracerKind::Compute || want == 1.0 { 0.0 } else { (1e-5 * covered).ceil() };
    Ok(Check::at_most(name, value, "samples", spare).says(format!("of {covered}, that are not {want}")))
}

fn place_text(place: &SceneTransform) -> String {
    let far = place.offset.abs().max_element();
    if far == 0.0 {
        format!("scale {:e}", place.scale)
    } else {
        format!("scale {:e}, {far:e} from the origin", place.scale)
    }
}

fn run(session: &mut StressSession) -> Result<()> {
    let (kinds, effort) = (session.setup().tracers(), session.setup().effort());

    // Planes are 1 and closed boxes 0, wherever they are.
    for (k, place) in places().into_iter().enumerate() {
        let text = place_text(&place);
        let (plane, closed) = (analytic::plane(10.0, place), analytic::closed_box(2.0, place));
        session.measure_each(&format!("plane does not occlude itself, {text}"), &kinds, |s, kind, w| {
            check_exact(s, kind, &format!("plane does not occlude itself, {text}"), &plane, 1.0, w)
        })?;
        let name = format!("closed box is dark, {text}");
        session.measure_each(&name, &kinds, |s, kind, w| check_exact(s, kind, &name, &closed, 0.0, w))?;
        // in the vertices, the world's coordinates round the corners
        if can_bake(&place) {
            let baked = builtin::bake(&plane);
            let name = format!("plane does not occlude itself, baked, {text}");
            session.measure_each(&name, &kinds, |s, kind, w| check_exact(s, kind, &name, &baked, 1.0, w))?;
        }
        // every map at one place, and every place with one map
        let maps = linear_maps();
        let chosen = if k == 5 { 0..maps.len() } else { k % maps.len()..k % maps.len() + 1 };
        for (map_name, map) in &maps[chosen] {
            let (plane, closed) = (through(&plane, map), through(&closed, map));
            let name = format!("plane does not occlude itself, {map_name}, {text}");
            session.measure_each(&name, &kinds, |s, kind, w| check_exact(s, kind, &name, &plane, 1.0, w))?;
            let name = format!("closed box is dark, {map_name}, {text}");
            session.measure_each(&name, &kinds, |s, kind, w| check_exact(s, kind, &name, &closed, 0.0, w))?;
        }
    }

    // Closed forms vary over the image.
    let near = |k: usize| effort.pick(k.is_multiple_of(3) || k == 5, true);
    for (k, place) in places().into_iter().enumerate().filter(|(k, _)| near(*k)) {
        let maps = linear_maps();
        for (m, mut form) in closed_forms_at(place).into_iter().enumerate() {
            let map = (k > 0).then(|| &maps[(k + m) % maps.len()]);
            if let Some((_, map)) = map {
                form.scene = through(&form.scene, map);
            }
            let suffix = map.map_or(String::new(), |(name, _)| format!(", {name}"));
            let name = format!("{}{suffix}, {}", form.what, place_text(&place));
            session.measure_each(&name, &kinds, |s, kind, w| {
                check_form(s, kind, &name, &form, effort.pick(256, 4096), w)
            })?;
        }
    }
    super::direct_light::run(session)?;
    georeferenced(session)
}

/// A glTF file with two horizontal squares a millimetre apart, 4e6 metres from the origin: in
/// translations of nested nodes, or (`in_vertices`) in positions.
pub fn georeferenced_scene(in_vertices: bool) -> Result<Scene> {
    let place = [4e6, 3e6, -4e6];
    let [x, y, z] = if in_vertices { place } else { [0.0; 3] };
    let square = |x0: f64, height: f64| {
        [[x0, height, -1.0], [x0, height, 1.0], [x0 + 2.0, height, 1.0], [x0 + 2.0, height, -1.0]]
    };
    let corners: Vec<f32> = [square(-2.0, 0.0), square(0.0, 1e-3)]
        .into_iter()
        .flatten()
        .flat_map(|p| [p[0] + x, p[1] + y, p[2] + z].map(|v| v as f32))
        .collect();
    let indices: [u32; 12] = [0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7];
    let bytes: Vec<u8> = [bytemuck::cast_slice::<f32, u8>(&corners), bytemuck::cast_slice(&indices)].concat();
    let data = base64::engine::general_purpose::STANDARD.encode(bytes);
    let (lo, hi) = bounds(&corners);
    let nodes = if in_vertices {
        r#"[{"mesh":0}]"#.to_owned()
    } else {
        // half of the way in each of two nested nodes
        let [x, y, z] = place.map(|p| p / 2.0);
        format!(r#"[{{"translation":[{x},{y},{z}],"children":[1]}},{{"translation":[{x},{y},{z}],"mesh":0}}]"#)
    };
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":{nodes},
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":8,"type":"VEC3","min":{lo:?},"max":{hi:?}}},
        {{"bufferView":1,"componentType":5125,"count":12,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":96}},{{"buffer":0,"byteOffset":96,"byteLength":48}}],
        "buffers":[{{"uri":"data:application/octet-stream;base64,{data}","byteLength":144}}]}}"#
    );
    load_text("georeferenced.gltf", &text)
}

/// Loads a file of this name with this text.
pub(super) fn load_text(name: &str, text: &str) -> Result<Scene> {
    let dir = tempfile::tempdir().map_err(|e| Error::write("a temporary folder", &e))?;
    let file = dir.path().join(name);
    std::fs::write(&file, text).map_err(|e| Error::write(&file, &e))?;
    load::load(&file.to_string_lossy())
}

fn bounds(corners: &[f32]) -> ([f32; 3], [f32; 3]) {
    let points = corners.chunks_exact(3).map(Vec3::from_slice);
    let (lo, hi) = points.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
    (lo.to_array(), hi.to_array())
}

/// Height of one square of [`georeferenced_scene`] over the other as a tracer sees it, in metres.
pub fn traced_step(tracer: &Tracer, scene: &Scene, watch: &mut Watch) -> Result<f64> {
    let origin = scene.origin();
    let (lo, hi) = scene.bounds().ok_or_else(|| Error::Scene("no geometry".into()))?;
    let at = |x: f64| {
        let from = DVec3::new(x, hi.y + 0.05, 0.5 * (lo.z + hi.z)) - origin;
        Ray { origin: from.as_vec3().to_array(), tmin: 0.0, direction: [0.0, -1.0, 0.0], tmax: f32::INFINITY }
    };
    let rays = [at(lo.x + 0.9), at(hi.x - 0.9)];
    let hits = trace(tracer, &rays, Mode::Closest, 1, watch)?.0;
    Ok(f64::from(hits[0].t) - f64::from(hits[1].t))
}

fn georeferenced(session: &mut StressSession) -> Result<()> {
    let kinds = session.setup().tracers();
    let name = "a millimetre at 4e6 m, in translations of nested nodes";
    session.measure_each(name, &kinds, |s, kind, w| {
        let scene = georeferenced_scene(false)?;
        let off = (traced_step(&s.tracer(kind, &scene)?, &scene, w)? - 1e-3).abs() * 1e3;
        Ok(Check::at_most(name, off, "mm", 1e-3).says("off: georeferenced nodes keep their detail"))
    })?;
    let name = "a millimetre at 4e6 m, in positions";
    session.measure(name, None, |_, _| {
        let scene = georeferenced_scene(true)?;
        let (lo, hi) = scene.bounds().ok_or_else(|| Error::Scene("no geometry".into()))?;
        let off = (hi.y - lo.y - 1e-3).abs() * 1e3;
        Ok(Check::reported(name, off, "mm")
            .says("off: 32 bits do not hold it; put the distance into a node's translation"))
    })
}

pub(super) fn path_tracer(setup: &Setup, kind: TracerKind, flat: &FlatScene) -> Result<Tracer> {
    Tracer::new(setup.device(), kind, flat, Needs { shading: true, ..Default::default() })
}
