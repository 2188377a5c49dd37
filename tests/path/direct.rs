//! Light that arrives at a plane directly. The camera looks straight down at a patch so small that the closed form hardly varies over it.

use super::*;
use skylit::scene::builtin::shapes;
use skylit::scene::material::{DiffuseTransmission, Specular};
use skylit::scene::sky::Sky;

const ALBEDO: f32 = 0.6;
const RHO: f64 = 0.6;

/// A floor at height 0, its middle seen from above through a view of 2e-3 units.
fn floor_and(mut parts: Vec<(Geometry, Material)>) -> Scene {
    // what emits is not in the way: the camera is near
    let camera = Camera::look_at(DVec3::new(0.0, 0.1, 0.0), DVec3::ZERO, DVec3::Z, 0.02);
    parts.insert(0, (shapes::floor(DVec3::ZERO, 10.0), matte(ALBEDO)));
    scene_of(parts, camera)
}

fn options(strategy: Strategy, spp: u32) -> PathOptions {
    PathOptions { samples: SampleSettings::new([16, 16], spp, 5), strategy, ..Default::default() }
}

fn light(kind: LightKind, position: DVec3, direction: DVec3, intensity: f32) -> Light {
    Light {
        name: String::new(),
        kind,
        intensity: Vec3::splat(intensity),
        position,
        direction: direction.normalize(),
        range: f64::INFINITY,
    }
}

#[test]
fn gpu_points_spots_and_directions() {
    let device = device();
    let at = DVec3::new(0.6, 0.8, 0.0);
    let lit = |light: Light| {
        let mut scene = floor_and(Vec::new());
        scene.lights.push(light);
        scene
    };
    let reflected = RHO / std::f64::consts::PI;
    // one unit away, cosine 0.8
    let point = lit(light(LightKind::Point, at, -at, 3.0));
    holds(&device, "point", &point, &options(Strategy::Mis, 16), reflected * 3.0 * 0.8, 1e-3);
    let spot = LightKind::Spot { inner_angle: 0.2, outer_angle: 0.4 };
    let middle = lit(light(spot, at, -at, 3.0));
    holds(&device, "spot, on its axis", &middle, &options(Strategy::Mis, 16), reflected * 3.0 * 0.8, 1e-3);
    // turned by 0.3 radians: between the two
    let turned = DVec3::new(-(0.6f64.asin() + 0.3).sin(), -(0.6f64.asin() + 0.3).cos(), 0.0);
    let share = ((0.3f64.cos() - 0.4f64.cos()) / (0.2f64.cos() - 0.4f64.cos())).powi(2);
    let beside = lit(light(spot, at, turned, 3.0));
    holds(&device, "spot, beside its axis", &beside, &options(Strategy::Mis, 16), reflected * 3.0 * 0.8 * share, 1e-3);
    let away = lit(light(spot, at, at, 3.0));
    let flat = FlatScene::new(&away);
    for kind in picked(&device) {
        let film = render(&tracer(&device, kind, &flat), &flat, &options(Strategy::Mis, 1)).image.film;
        assert!(film.mean.iter().all(|&m| m == 0.0), "{kind}: a spot that shines away");
    }
    let sun = lit(light(LightKind::Directional { angle: 0.0 }, DVec3::ZERO, DVec3::new(-0.6, -0.8, 0.0), 3.0));
    holds(&device, "directional", &sun, &options(Strategy::Mis, 16), reflected * 3.0 * 0.8, 1e-3);
    // three lights at once: each is sampled in proportion to its power
    let mut all = lit(light(LightKind::Point, at, -at, 3.0));
    all.lights.push(light(LightKind::Directional { angle: 0.0 }, DVec3::ZERO, DVec3::new(-0.6, -0.8, 0.0), 3.0));
    all.lights.push(light(spot, DVec3::Y, DVec3::NEG_Y, 5.0));
    holds(&device, "three lights", &all, &options(Strategy::Mis, 1024), reflected * (3.0 * 0.8 * 2.0 + 5.0), 1e-2);
}

/// A clear sky with its sun, on every tracer: a floor reflects what the host adds up of the map's rows, and the sun's irradiance times its cosine.
#[test]
fn gpu_a_clear_sky() {
    let device = device();
    let sky = Sky { elevation: 35.0, azimuth: 60.0, turbidity: 3.0 };
    let (map, sun) = sky.light(0.5);
    let sun = sun.expect("it is day");
    let height = map.height as usize;
    let below = |y: usize| (std::f64::consts::PI * y as f64 / height as f64).sin().powi(2);
    let row = |y: usize| {
        let row = &map.radiance[y * map.width as usize..][..map.width as usize];
        let mean = row.iter().map(|c| (*c * map.factor).as_dvec3()).sum::<DVec3>() / row.len() as f64;
        mean * std::f64::consts::PI * (below(y + 1) - below(y))
    };
    let by_sky = (0..height / 2).map(row).sum::<DVec3>().element_sum() / 3.0;
    let by_sun = sun.intensity.as_dvec3().element_sum() / 3.0 * 35f64.to_radians().sin();
    assert!(by_sky > 0.1 * by_sun && by_sun > by_sky);
    let expected = RHO / std::f64::consts::PI * (by_sky + by_sun);
    let mut scene = floor_and(Vec::new());
    scene.lights.push(sun);
    scene.environment = Environment::Map(map);
    holds_with(&tracers(&device), 2e-4, &device, "a sky", &scene, &options(Strategy::Mis, 512), expected, 2e-3);
}

/// Light from below a floor that transmits diffusely: color times share times irradiance over pi, of every light and by every strategy; and light from above is reflected by the
/// rest.
#[test]
fn gpu_light_through_a_translucent_floor() {
    let device = device();
    let (share, color, at) = (0.7f32, 0.5f32, DVec3::new(0.6, -0.8, 0.0));
    let through = DiffuseTransmission { factor: share, color: Vec3::splat(color), ..Default::default() };
    let floor = Material {
        base_color: glam::Vec4::new(ALBEDO, ALBEDO, ALBEDO, 1.0),
        diffuse_transmission: through,
        specular: Specular { factor: 0.0, ..Default::default() },
        ..Material::default()
    };
    let scene = |light: Option<Light>, sky: f32| {
        let mut scene = floor_and(Vec::new());
        let material = scene.meshes[0].material;
        scene.materials[material] = floor.clone();
        scene.lights.extend(light);
        scene.environment = Environment::Uniform(Vec3::splat(sky));
        scene
    };
    let transmitted = f64::from(share * color);
    let irradiance = 3.0 * 0.8 / std::f64::consts::PI;
    let below = light(LightKind::Point, at, -at, 3.0);
    holds(
        &device,
        "a point below",
        &scene(Some(below), 0.0),
        &options(Strategy::Mis, 16),
        transmitted * irradiance,
        1e-3,
    );
    let sun = light(LightKind::Directional { angle: 0.0 }, DVec3::ZERO, -at, 3.0);
    holds(&device, "a sun below", &scene(Some(sun), 0.0), &options(Strategy::Mis, 16), transmitted * irradiance, 1e-3);
    let above = light(LightKind::Point, -at, at, 3.0);
    let reflected = f64::from(ALBEDO * (1.0 - share));
    holds(
        &device,
        "a point above",
        &scene(Some(above), 0.0),
        &options(Strategy::Mis, 16),
        reflected * irradiance,
        1e-3,
    );
    for strategy in [Strategy::Mis, Strategy::Light, Strategy::Bsdf] {
        holds(&device, "a sky all around", &scene(None, 1.0), &options(strategy, 256), transmitted + reflected, 1e-2);
    }
}

/// LEDs, whose intensity is a power of the cosine: half at their half angle, that power elsewhere, nothing behind them.
#[test]
fn gpu_leds() {
    let device = device();
    let at = DVec3::new(0.6, 0.8, 0.0);
    let reflected = RHO / std::f64::consts::PI;
    let expected = reflected * 3.0 * 0.8;
    let lit = |half_angle: f32, beside: f64| {
        let mut scene = floor_and(Vec::new());
        let angle = 0.6f64.asin() + beside;
        scene.lights.push(light(LightKind::Led { half_angle }, at, DVec3::new(-angle.sin(), -angle.cos(), 0.0), 3.0));
        scene
    };
    let options = options(Strategy::Mis, 16);
    for half_angle in [0.3f32, 1.2] {
        let half = f64::from(half_angle);
        holds(&device, "on its axis", &lit(half_angle, 0.0), &options, expected, 1e-3);
        holds(&device, "at its half angle", &lit(half_angle, half), &options, 0.5 * expected, 1e-3);
        let share = 0.5f64.powf(0.5f64.cos().ln() / half.cos().ln());
        holds(&device, "beside its axis", &lit(half_angle, 0.5), &options, share * expected, 1e-3);
        let away = lit(half_angle, 2.0);
        let flat = FlatScene::new(&away);
        for kind in picked(&device) {
            let film = render(&tracer(&device, kind, &flat), &flat, &options).image.film;
            assert!(film.mean.iter().all(|&m| m == 0.0), "{kind}: an LED that shines away");
        }
    }
    // chosen by the light tree: 300 at one place, in turn along two directions, and as many that shine away
    let mut many = lit(0.7, 0.0);
    let one = many.lights.pop().unwrap();
    let turned = DVec3::new(-(0.6f64.asin() + 0.5).sin(), -(0.6f64.asin() + 0.5).cos(), 0.0);
    for k in 0..600 {
        let direction = [one.direction, -one.direction, turned, -turned][k % 4];
        many.lights.push(light(one.kind, at, direction, 3.0 / 300.0));
    }
    let share = 0.5f64.powf(0.5f64.cos().ln() / 0.7f64.cos().ln());
    let expected = expected * 0.5 * (1.0 + share);
    holds(&device, "many", &many, &options.with_samples(|s| s.spp = 1024), expected, 1e-2);
}

/// A sphere seen under a half angle a from a point, its centre at angle t from the normal and all of it above the horizon: pi L sin^2 a cos t.
#[test]
fn gpu_a_sphere() {
    let device = device();
    let centre = DVec3::new(0.9, 1.2, 0.0);
    for radius in [0.03, 0.7] {
        let scene = floor_and(vec![(shapes::sphere(centre, radius), emitter(4.0))]);
        let expected = RHO * 4.0 * (radius / 1.5f64).powi(2) * 0.8;
        holds(&device, "sphere", &scene, &options(Strategy::Mis, 128), expected, 2e-3);
        holds(&device, "sphere", &scene, &options(Strategy::Light, 128), expected, 2e-3);
        if radius > 0.1 {
            holds(&device, "sphere", &scene, &options(Strategy::Bsdf, 512), expected, 5e-3);
            holds(&device, "sphere", &scene, &options(Strategy::Uniform, 512), expected, 5e-3);
        }
    }
}

/// A square area light over the floor, its form factor from its corners (Lambert 1760).
#[test]
fn gpu_a_square() {
    let device = device();
    let lamp = |up: bool| {
        let (u, v) = (DVec3::X * 0.8, DVec3::Z * 0.5);
        let middle = DVec3::new(0.5, 0.9, 0.2);
        // counter-clockwise seen from the front
        if up { shapes::rectangle(middle, v, u) } else { shapes::rectangle(middle, u, v) }
    };
    let Geometry::Triangles(corners) = lamp(false) else { unreachable!() };
    let polygon: Vec<DVec3> = corners.positions.iter().map(|p| p.as_dvec3()).collect();
    let factor = skylit::oracle::closed_form::polygon_form_factor(DVec3::ZERO, DVec3::Y, &polygon).abs();
    assert!(factor > 0.05);
    let expected = RHO * 4.0 * factor;
    let scene = floor_and(vec![(lamp(false), emitter(4.0))]);
    holds(&device, "square", &scene, &options(Strategy::Mis, 128), expected, 2e-3);
    holds(&device, "square", &scene, &options(Strategy::Light, 128), expected, 2e-3);
    holds(&device, "square", &scene, &options(Strategy::Cosine, 512), expected, 5e-3);
    // its back is dark, unless it has two sides
    let away = floor_and(vec![(lamp(true), emitter(4.0))]);
    let flat = FlatScene::new(&away);
    for kind in picked(&device) {
        let film = render(&tracer(&device, kind, &flat), &flat, &options(Strategy::Mis, 16)).image.film;
        assert!(film.mean.iter().all(|&m| m == 0.0), "{kind}: light from the back of a lamp");
    }
    let both = floor_and(vec![(lamp(true), Material { double_sided: true, ..emitter(4.0) })]);
    holds(&device, "square, both sides", &both, &options(Strategy::Mis, 128), expected, 2e-3);
}

/// Under a sky that is the same everywhere a plane is as bright as its albedo; so it is under a map of one colour, however it is cut into
/// texels, and under a map of one bright texel as much as that brings.
#[test]
fn gpu_skies() {
    let device = device();
    let under = |environment: Environment| Scene { environment, ..floor_and(Vec::new()) };
    let uniform = under(Environment::Uniform(Vec3::splat(2.0)));
    for strategy in [Strategy::Mis, Strategy::Bsdf, Strategy::Light, Strategy::Uniform] {
        let precision = if strategy == Strategy::Uniform { 3e-3 } else { 2e-3 };
        holds(&device, "uniform sky", &uniform, &options(strategy, 128), RHO * 2.0, precision);
    }
    let map = |width: u32, height: u32, radiance: &dyn Fn(u32, u32) -> f32| {
        let texels = (0..width * height).map(|k| Vec3::splat(radiance(k % width, k / width))).collect();
        under(Environment::Map(skylit::scene::EnvironmentMap {
            name: "map".into(),
            width,
            height,
            radiance: texels,
            factor: Vec3::ONE,
            to_map: glam::DMat3::IDENTITY,
        }))
    };
    for strategy in [Strategy::Mis, Strategy::Bsdf, Strategy::Light] {
        holds(&device, "map of one colour", &map(7, 5, &|_, _| 2.0), &options(strategy, 128), RHO * 2.0, 5e-3);
    }
    // a texel and what is interpolated around it, integrated on a fine grid
    let (width, height, bright) = (64u32, 32u32, [20u32, 9u32]);
    let sun = map(width, height, &|x, y| if [x, y] == bright { 5e3 } else { 0.0 });
    let expected = RHO / std::f64::consts::PI * 5e3 * irradiance_of_texel(bright, [width, height]);
    holds(&device, "map with a sun", &sun, &options(Strategy::Mis, 256), expected, 1e-2);
    holds(&device, "map with a sun", &sun, &options(Strategy::Light, 256), expected, 1e-2);
    holds(&device, "map with a sun", &sun, &options(Strategy::Bsdf, 1 << 12), expected, 3e-3);
    // so many texels that a number of single precision which chose one of them would have nothing left for more: beside a sky
    let (width, height, bright) = (2048u32, 1024u32, [700u32, 301u32]);
    let sun = map(width, height, &|x, y| if [x, y] == bright { 1e6 } else { 1.0 });
    let expected = RHO * (1.0 + (1e6 - 1.0) / std::f64::consts::PI * irradiance_of_texel(bright, [width, height]));
    holds(&device, "large map with a sun", &sun, &options(Strategy::Mis, 256), expected, 1e-3);
    holds(&device, "large map with a sun", &sun, &options(Strategy::Light, 256), expected, 2e-3);
}

/// Nothing is left to chance where a sky of one colour lights a diffuse plane and nothing is in the way: light sampling is distributed as the plane reflects
/// them. Rough thin walls are lit from both sides, and the strategies agree on how much.
#[test]
fn gpu_uniform_skies_are_sampled_as_surfaces_reflect() {
    let device = device();
    let scene = Scene { environment: Environment::Uniform(Vec3::splat(2.0)), ..floor_and(Vec::new()) };
    let flat = FlatScene::new(&scene);
    for kind in picked(&device) {
        for strategy in [Strategy::Mis, Strategy::Light] {
            let film = render(&tracer(&device, kind, &flat), &flat, &options(strategy, 1)).image.film;
            let worst = film.mean.iter().map(|&m| (f64::from(m) - RHO * 2.0).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-5, "{kind}, {strategy:?}: a pixel is {worst} off");
        }
    }
    let transmission = skylit::scene::material::Transmission { factor: 0.5, ..Default::default() };
    let wall = Material { transmission, roughness: 0.6, metallic: 0.0, ..Material::default() };
    let camera = Camera::look_at(DVec3::new(0.0, 0.1, 0.0), DVec3::ZERO, DVec3::Z, 0.02);
    let scene = Scene {
        environment: Environment::Uniform(Vec3::splat(2.0)),
        ..scene_of(vec![(skylit::scene::builtin::shapes::floor(DVec3::ZERO, 10.0), wall)], camera)
    };
    let flat = FlatScene::for_paths(&scene);
    let tracer = tracer(&device, TracerKind::Compute, &flat);
    let means = [Strategy::Mis, Strategy::Bsdf, Strategy::Light]
        .map(|s| mean_of(&render(&tracer, &flat, &options(s, 1024)).image.film));
    for (mean, error) in &means[1..] {
        let noise = error.hypot(means[0].1);
        assert!(noise < 4e-3 * mean && (mean - means[0].0).abs() < 4.0 * noise, "{means:?}");
    }
}

/// What a texel of radiance 1 and what is interpolated around it bring to a plane that faces up, by integration on a fine grid.
fn irradiance_of_texel(at: [u32; 2], size: [u32; 2]) -> f64 {
    let fine = 128;
    // in texels, from the corner of the map
    let places = |k: u32| (0..3 * fine).map(move |i| f64::from(k) - 1.0 + (f64::from(i) + 0.5) / f64::from(fine));
    let tent = |place: f64, k: u32| (1.0 - (place - 0.5 - f64::from(k)).abs()).max(0.0);
    let mut sum = 0.0;
    for y in places(at[1]) {
        let theta = y / f64::from(size[1]) * std::f64::consts::PI;
        let across: f64 = places(at[0]).map(|x| tent(x, at[0])).sum();
        sum += across * tent(y, at[1]) * theta.cos().max(0.0) * theta.sin();
    }
    let texel = 2.0 * std::f64::consts::PI.powi(2) / f64::from(size[0]) / f64::from(size[1]);
    sum * texel / f64::from(fine * fine)
}

/// More lights than a table chooses among: squares that tile a ceiling, in their closed form one rectangle; and with a sun besides.
#[test]
fn gpu_many_lights() {
    let device = device();
    let (n, side, height) = (24, 3.0, 1.0);
    let step = side / f64::from(n);
    let corner = |k: i32| -0.5 * side + step * f64::from(k);
    let tiles = (0..n * n).map(|k| {
        let at = DVec3::new(corner(k % n) + 0.5 * step, height, corner(k / n) + 0.5 * step);
        shapes::rectangle(at, DVec3::X * step, DVec3::Z * step)
    });
    let ceiling = |strength: f32| {
        let mut scene = floor_and(Vec::new());
        for (k, tile) in tiles.clone().enumerate() {
            scene.materials.push(emitter(strength));
            scene.meshes.push(Mesh { name: format!("tile {k}"), geometry: tile, material: 1 + k, source: None });
            scene.instances.push(Instance {
                name: format!("tile {k}"),
                mesh: 1 + k,
                object_to_world: DAffine3::IDENTITY,
            });
        }
        scene
    };
    let (e, y) = (0.5 * side, height);
    let whole = [(-e, -e), (e, -e), (e, e), (-e, e)].map(|(x, z)| DVec3::new(x, y, z));
    let form = skylit::oracle::closed_form::polygon_form_factor(DVec3::ZERO, DVec3::Y, &whole).abs();
    let scene = ceiling(4.0);
    let flat = FlatScene::for_paths(&scene);
    let options = options(Strategy::Mis, 256);
    let result = render(&tracer(&device, TracerKind::Compute, &flat), &flat, &options);
    assert!(result.light_tree && result.lights == (n * n) as u32, "{} lights", result.lights);
    for strategy in [Strategy::Mis, Strategy::Light] {
        holds(
            &device,
            "many lights",
            &scene,
            &PathOptions { strategy, max_depth: 1, ..options.clone() },
            RHO * 4.0 * form,
            2e-2,
        );
    }
    let mut sunny = ceiling(4.0);
    // below the ceiling's edge
    let from = DVec3::new(0.95, -0.3122499, 0.0);
    sunny.lights.push(light(LightKind::Directional { angle: 0.01 }, DVec3::ZERO, from, 3.0));
    let sun = RHO / std::f64::consts::PI * 3.0 * 0.3122499;
    holds(&device, "with a sun", &sunny, &PathOptions { max_depth: 1, ..options }, RHO * 4.0 * form + sun, 2e-2);
}

/// A sun with an extent lights what faces it as one without: by the cosine of its middle, as long as all of it is above the horizon.
#[test]
fn gpu_a_wide_sun() {
    let device = device();
    for angle in [0.0093, 0.5, 1.0] {
        let mut scene = floor_and(Vec::new());
        scene.lights.push(light(LightKind::Directional { angle }, DVec3::ZERO, DVec3::new(-0.6, -0.8, 0.0), 3.0));
        let expected = RHO / std::f64::consts::PI * 3.0 * 0.8;
        holds(&device, &format!("sun of {angle}"), &scene, &options(Strategy::Mis, 128), expected, 3e-3);
    }
}
