//! An animated scene: blocks that slide and rotate, a rotor, a skinned column, a ball with morph
//! targets, and a moving camera. It loops seamlessly after two seconds.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3, Vec3};

use super::shapes;
use crate::scene::animation::{
    Animation, Channel, Deformation, Influences, Interpolation, LocalTransform, MorphTarget, Node, Property, RigParts,
    Sampler, Skin,
};
use crate::scene::{AnimationRig, Camera, Geometry, Scene, TriangleMesh};

/// Duration of the loop in seconds.
const DURATION: f64 = 2.0;

/// Distance from joint to joint of the column.
const BONE: f64 = 0.7;

/// Animation 0 moves everything, animation 1 only bends the column.
pub fn parade() -> Scene {
    let mut scene = Scene { name: "parade".to_owned(), ..Scene::default() };
    let mut stage = RigBuilder::default();
    let [grey, red, blue, yellow] = [
        ("floor", Vec3::new(0.7, 0.7, 0.68)),
        ("block", Vec3::new(0.65, 0.2, 0.15)),
        ("rotor", Vec3::new(0.2, 0.35, 0.6)),
        ("soft", Vec3::new(0.75, 0.6, 0.2)),
    ]
    .map(|(name, color)| scene.add_matte(name, color));

    // what stands still
    scene.add_object("floor", shapes::floor(DVec3::ZERO, 8.0), grey, DAffine3::IDENTITY);
    stage.parts.instances.push(None);
    let block = scene.add_mesh("block", shapes::cuboid(DVec3::splat(-0.3), DVec3::splat(0.3)), red);
    scene.add_object(
        "wall",
        shapes::cuboid(DVec3::new(-3.0, 0.0, -2.4), DVec3::new(3.0, 1.2, -2.2)),
        grey,
        DAffine3::IDENTITY,
    );
    stage.parts.instances.push(None);

    // slides to and fro, and turns once; a smaller one rides on it
    let slider = stage.node("slider", None, DVec3::new(-1.5, 0.3, 1.2));
    stage.place(&mut scene, slider, block);
    let path = |t: f64| DVec3::new(-1.5 + 3.0 * wave(t), 0.3, 1.2);
    stage.spline(slider, Property::Translation, 5, |t| path(t).to_array().to_vec());
    stage.turn(slider, DVec3::Y);
    let rider = stage.node_scaled("rider", Some(slider), DVec3::new(0.0, 0.45, 0.0), 0.5);
    stage.place(&mut scene, rider, block);
    stage.line(rider, Property::Scale, 3, |t| vec![0.5 + 0.3 * wave(t); 3]);

    // three blades around an axle
    let axle = stage.node("axle", None, DVec3::new(1.7, 0.9, -1.0));
    let hub = scene.add_mesh("hub", shapes::torus(0.18, 0.09, 24, 12), blue);
    stage.place(&mut scene, axle, hub);
    stage.turn(axle, DVec3::NEG_Y);
    let blade =
        scene.add_mesh("blade", shapes::cuboid(DVec3::new(0.2, -0.03, -0.12), DVec3::new(1.0, 0.03, 0.12)), blue);
    for k in 0..3 {
        let arm = stage.node("arm", Some(axle), DVec3::ZERO);
        let rotation = DQuat::from_rotation_y(TAU * f64::from(k) / 3.0) * DQuat::from_rotation_x(0.4);
        stage.parts.nodes[arm].local = LocalTransform::Trs { translation: DVec3::ZERO, rotation, scale: DVec3::ONE };
        stage.place(&mut scene, arm, blade);
    }

    // meshes that bend and swell
    stage.column(&mut scene, yellow);
    stage.ball(&mut scene, yellow);

    // a fixed camera, and one on a swing
    scene.add_camera(DVec3::new(2.2, 2.6, 5.2), DVec3::new(0.0, 0.7, -0.3), 45.0);
    stage.parts.cameras.push(None);
    let swing = |t: f64| {
        let angle = 0.35 * (TAU * t / DURATION).sin();
        Camera::look_at(DVec3::new(5.4 * angle.sin(), 1.6, 5.4 * angle.cos()), DVec3::Y * 0.6, DVec3::Y, 0.8)
    };
    let cart = stage.node("swing", None, DVec3::ZERO);
    let seat = |t: f64| swing(t).camera_to_world.to_scale_rotation_translation();
    let (scale, rotation, translation) = seat(0.0);
    stage.parts.nodes[cart].local = LocalTransform::Trs { translation, rotation, scale };
    stage.line(cart, Property::Translation, 17, |t| seat(t).2.to_array().to_vec());
    stage.line(cart, Property::Rotation, 17, |t| seat(t).1.to_array().to_vec());
    scene.cameras.push(Camera { name: "swing".to_owned(), ..swing(0.0) });
    stage.parts.cameras.push(Some(cart));

    // the second animation has the bending alone
    let bends =
        stage.channels.iter().filter(|c| stage.parts.nodes[c.node].name.starts_with("joint")).cloned().collect();
    let animation = |name: &str, channels| Animation {
        name: name.to_owned(),
        duration: DURATION,
        channels,
        ..Animation::default()
    };
    stage.parts.animations = vec![animation("parade", std::mem::take(&mut stage.channels)), animation("bend", bends)];
    // valid by construction; otherwise the scene has no rig, and tests fail
    let _ = AnimationRig::attach(&mut scene, stage.parts);
    scene
}

/// A wave that goes from 0 to 1 and back.
fn wave(t: f64) -> f64 {
    0.5 - 0.5 * (TAU * t / DURATION).cos()
}

#[derive(Default)]
struct RigBuilder {
    parts: RigParts,
    channels: Vec<Channel>,
}

impl RigBuilder {
    fn node(&mut self, name: &str, parent: Option<usize>, translation: DVec3) -> usize {
        self.node_scaled(name, parent, translation, 1.0)
    }

    fn node_scaled(&mut self, name: &str, parent: Option<usize>, translation: DVec3, scale: f64) -> usize {
        let local = LocalTransform::Trs { translation, rotation: DQuat::IDENTITY, scale: DVec3::splat(scale) };
        self.parts.nodes.push(Node { name: name.to_owned(), parent, local, ..Node::default() });
        self.parts.nodes.len() - 1
    }

    /// Lets a node place a mesh.
    fn place(&mut self, scene: &mut Scene, node: usize, mesh: usize) {
        scene.add_instance(&self.parts.nodes[node].name, mesh, DAffine3::IDENTITY);
        self.parts.instances.push(Some(node));
    }

    /// `keys` keys in equal steps over the whole time, the last one beginning again.
    fn keys(
        &mut self,
        node: usize,
        property: Property,
        interpolation: Interpolation,
        keys: u32,
        value: impl Fn(u32) -> Vec<f64>,
    ) {
        let times: Arc<[f32]> = (0..keys).map(|k| (DURATION * f64::from(k) / f64::from(keys - 1)) as f32).collect();
        let values = (0..keys).flat_map(value).map(|v| v as f32).collect();
        self.channels.push(Channel { node, property, sampler: Sampler { interpolation, times, values } });
    }

    fn line(&mut self, node: usize, property: Property, keys: u32, value: impl Fn(f64) -> Vec<f64>) {
        self.keys(node, property, Interpolation::Linear, keys, |k| {
            value(DURATION * f64::from(k) / f64::from(keys - 1))
        });
    }

    /// Splines whose tangents are the slopes of `value`.
    fn spline(&mut self, node: usize, property: Property, keys: u32, value: impl Fn(f64) -> Vec<f64>) {
        let h = 1e-4;
        self.keys(node, property, Interpolation::CubicSpline, keys, |k| {
            let t = DURATION * f64::from(k) / f64::from(keys - 1);
            let slope: Vec<f64> = value(t + h).iter().zip(value(t - h)).map(|(b, a)| (b - a) / (2.0 * h)).collect();
            [slope.clone(), value(t), slope].concat()
        });
    }

    /// Once around.
    fn turn(&mut self, node: usize, axis: DVec3) {
        self.line(node, Property::Rotation, 5, |t| {
            DQuat::from_axis_angle(axis, TAU * t / DURATION).to_array().to_vec()
        });
    }

    /// A column on three joints.
    fn column(&mut self, scene: &mut Scene, material: usize) {
        let mut mesh = tube(0.2, 3.0 * BONE, 24, 20);
        let joint = |y: f64| {
            // smoothly from each joint to the next, halfway at the bend
            let upper = |k: f64| smoothstep((y - BONE * k) / (0.8 * BONE) + 0.5);
            let (first, second) = (upper(1.0), upper(2.0));
            [1.0 - first, first - second, second, 0.0].map(|w| w as f32)
        };
        let weights: Vec<[f32; 4]> = mesh.positions.iter().map(|p| joint(f64::from(p.y))).collect();
        let influences = vec![Influences { joints: vec![[0, 1, 2, 0]; weights.len()], weights }];
        mesh.normals = smooth_normals(&mesh);
        let mesh = scene.add_mesh("column", Geometry::Triangles(mesh), material);
        let node = self.node("column", None, DVec3::ZERO);
        scene.add_instance("column", mesh, DAffine3::IDENTITY);
        self.parts.instances.push(None);
        let mut parent = None;
        let mut skin = Skin { name: "column".to_owned(), ..Skin::default() };
        for k in 0..3 {
            let at = if k == 0 { DVec3::new(-0.2, 0.0, -1.0) } else { DVec3::Y * BONE };
            let joint = self.node(&format!("joint {k}"), parent, at);
            let axis = [DVec3::X, DVec3::Z, DVec3::new(-0.6, 0.0, 0.8)][k as usize];
            let lean = [0.15, 0.6, 0.8][k as usize];
            self.line(joint, Property::Rotation, 9, |t| {
                DQuat::from_axis_angle(axis, lean * (TAU * t / DURATION + f64::from(k)).sin()).to_array().to_vec()
            });
            skin.joints.push(joint);
            skin.inverse_bind.push(DAffine3::from_translation(DVec3::NEG_Y * (BONE as f32 * k as f32) as f64));
            parent = Some(joint);
        }
        self.parts.skins.push(skin);
        let skin = Some(self.parts.skins.len() - 1);
        self.parts.deformations.push(Deformation { mesh, node, skin, influences, targets: Vec::new() });
    }

    /// A ball that hops, flattens and grows bumps.
    fn ball(&mut self, scene: &mut Scene, material: usize) {
        let Geometry::Triangles(ball) = shapes::icosphere(0.45, 3) else { return };
        let target = |shape: &dyn Fn(DVec3) -> DVec3| {
            let mut changed = ball.clone();
            for p in &mut changed.positions {
                *p = shape(p.as_dvec3()).as_vec3();
            }
            changed.normals = smooth_normals(&changed);
            let delta = |a: &[Vec3], b: &[Vec3]| a.iter().zip(b).map(|(a, b)| *a - *b).collect();
            MorphTarget {
                positions: delta(&changed.positions, &ball.positions),
                normals: delta(&changed.normals, &ball.normals),
            }
        };
        let flat = target(&|p| p * DVec3::new(1.35, 0.55, 1.35));
        let bumps = target(&|p| p * (1.0 + 0.35 * (11.0 * p.x).sin() * (11.0 * p.y).sin() * (11.0 * p.z).sin()));
        let node = self.node("ball", None, DVec3::new(-1.9, 0.5, -0.4));
        self.parts.nodes[node].weights = vec![0.0, 0.25];
        let mesh = scene.add_mesh("ball", Geometry::Triangles(ball), material);
        self.place(scene, node, mesh);
        self.spline(node, Property::Translation, 9, |t| vec![-1.9, 0.5 + 0.9 * (FRAC_PI_2 * t).sin().powi(2), -0.4]);
        self.line(node, Property::Weights, 9, |t| vec![(1.0 - 3.0 * wave(t)).max(0.0), wave(t)]);
        self.parts.deformations.push(Deformation { mesh, node, targets: vec![flat, bumps], ..Deformation::default() });
    }
}

fn smoothstep(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// A closed tube around the y axis from 0 to `height`, its ends drawn together to points.
fn tube(radius: f64, height: f64, segments: u32, rings: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh { positions: vec![Vec3::ZERO, Vec3::Y * height as f32], ..TriangleMesh::default() };
    for ring in 0..=rings {
        for segment in 0..segments {
            let (s, c) = (TAU * f64::from(segment) / f64::from(segments)).sin_cos();
            let y = height * f64::from(ring) / f64::from(rings);
            mesh.positions.push(DVec3::new(c * radius, y, -s * radius).as_vec3());
        }
    }
    let at = |ring: u32, segment: u32| 2 + ring * segments + segment % segments;
    for s in 0..segments {
        mesh.indices.extend([[0, at(0, s + 1), at(0, s)], [1, at(rings, s), at(rings, s + 1)]]);
        for r in 0..rings {
            let (a, b, c, d) = (at(r, s), at(r, s + 1), at(r + 1, s + 1), at(r + 1, s));
            mesh.indices.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

/// The mean of the adjacent triangles' normals, weighted by area.
fn smooth_normals(mesh: &TriangleMesh) -> Vec<Vec3> {
    let mut sums = vec![DVec3::ZERO; mesh.positions.len()];
    for t in &mesh.indices {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize].as_dvec3());
        let area = (b - a).cross(c - a);
        t.iter().for_each(|&i| sums[i as usize] += area);
    }
    sums.iter().map(|n| n.normalize_or(DVec3::Y).as_vec3()).collect()
}
