use skylit::gpu::*;
use skylit::render::*;
use skylit::scene::flatten::FlatScene;
use skylit::tracer::*;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let scene = if a[1].ends_with(".bin") { bin(&a[1]) } else { skylit::scene::builtin::by_name(&a[1]).unwrap() };
    let device = Device::open(&Options { validation: std::env::var_os("VAL").is_some(), ..Default::default() }).unwrap();
    let flat = FlatScene::new(&scene);
    let size = [a[3].parse().unwrap(), a[4].parse().unwrap()];
    let ch = if a[1].contains("dragon") {
        camera::Choice::LookAt {
            eye: glam::dvec3(0.065, 0.1857, 0.198),
            target: glam::dvec3(-0.0059, 0.125, -0.0046),
            up: glam::DVec3::Y,
            fov_y: 45f64.to_radians(),
        }
    } else {
        camera::Choice::Auto
    };
    let cam = camera::choose(&scene, &ch, size[0] as f64 / size[1] as f64).unwrap();
    let rec = camera::CameraRecord::new(&cam, flat.origin, size[0] as f64 / size[1] as f64);
    for k in TracerKind::ALL {
        if !a[2].contains(k.name()) {
            continue;
        }
        let t = Tracer::new(&device, k, &flat, Needs::default()).unwrap();
        println!("{k} {:?}", t.stats());
        let o = ao::AoOptions {
            size,
            spp: a[5].parse().unwrap(),
            falloff: a.get(6).map_or(1.0, |x| x.parse().unwrap()),
            ..Default::default()
        };
        let r = ao::render(&t, &rec, &o, &mut Uncontrolled).unwrap();
        println!(
            "{k} mean {:?} rays {} {} in {:.3}s device {:?} longest {:.3}",
            r.film.mean_and_error(),
            r.primary_rays,
            r.occlusion_rays,
            r.trace_seconds,
            r.device_seconds,
            r.longest_launch
        );
        let img = image::GrayImage::from_fn(size[0], size[1], |x, y| {
            image::Luma([(r.film.mean[(y * size[0] + x) as usize].powf(1.0 / 2.2) * 255.0) as u8])
        });
        img.save(format!("/tmp/q-{}-{k}.png", a[1].replace(['/', ':'], "_"))).unwrap();
        for m in device.validation_messages().iter().take(3) {
            println!("VALIDATION {m}");
        }
    }
}
fn bin(p: &str) -> skylit::scene::Scene {
    let b = std::fs::read(p).unwrap();
    let u = |o: usize| u32::from_le_bytes(b[o..o + 4].try_into().unwrap());
    let (nv, nt) = (u(0) as usize, u(4) as usize);
    let positions = bytemuck::pod_collect_to_vec(&b[8..8 + 12 * nv]);
    let indices = bytemuck::pod_collect_to_vec(&b[8 + 12 * nv..8 + 12 * nv + 12 * nt]);
    skylit::scene::Scene {
        meshes: vec![skylit::scene::Mesh {
            name: "m".into(),
            material: 0,
            geometry: skylit::scene::Geometry::Triangles(skylit::scene::TriangleMesh {
                positions,
                indices,
                ..Default::default()
            }),
        }],
        instances: vec![skylit::scene::Instance { name: "".into(), mesh: 0, object_to_world: Default::default() }],
        materials: vec![Default::default()],
        ..Default::default()
    }
}
