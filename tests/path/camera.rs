//! What a pixel is the mean of: filters by an edge that runs between pixels, lenses by a light that is out of focus.

use super::*;
use skylit::integrators::ao::{self, AoOptions};
use skylit::integrators::path::{Lens, PixelFilter};
use skylit::scene::Projection;
use skylit::scene::builtin::shapes;

/// An emissive square from x = 1/4 to the right, seen in parallel, 16 pixels to 16 units: the edge is a quarter of a pixel from the centre of one.
fn edge() -> Scene {
    let mut camera = Camera::look_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 1.0);
    camera.projection = Projection::Orthographic { half_height: 8.0 };
    let right = shapes::rectangle(DVec3::new(20.25, 0.0, 0.0), DVec3::X * 40.0, DVec3::Y * 80.0);
    scene_of(vec![(right, Material { double_sided: true, ..emitter(1.0) })], camera)
}

#[test]
fn gpu_filters_weigh_an_edge() {
    let device = device();
    let scene = edge();
    let flat = FlatScene::new(&scene);
    // share of each filter's weight beyond a distance, by the midpoint rule
    let beyond = |filter: PixelFilter, distance: f64| {
        let (radius, weight): (f64, &dyn Fn(f64) -> f64) = match filter {
            PixelFilter::Box => (0.5, &|_| 1.0),
            PixelFilter::Tent => (1.0, &|x: f64| 1.0 - x.abs()),
            PixelFilter::BlackmanHarris => (1.5, &|x: f64| {
                let t = std::f64::consts::TAU * (x / 3.0 + 0.5);
                0.35875 - 0.48829 * t.cos() + 0.14128 * (2.0 * t).cos() - 0.01168 * (3.0 * t).cos()
            }),
            PixelFilter::Centre => (1e-6, &|_| 1.0),
        };
        let n = 30_000;
        let at = |k: i32| (f64::from(k) + 0.5) / f64::from(n) * 2.0 * radius - radius;
        let (mut past, mut all) = (0.0, 0.0);
        for x in (0..n).map(at) {
            all += weight(x);
            past += if x > distance { weight(x) } else { 0.0 };
        }
        past / all
    };
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &flat);
        for pixel_filter in [PixelFilter::Box, PixelFilter::Tent, PixelFilter::BlackmanHarris, PixelFilter::Centre] {
            let options = PathOptions {
                samples: SampleSettings { pixel_filter, ..SampleSettings::new([16, 16], 256, 0) },
                max_depth: 0,
                ..Default::default()
            };
            let film = render(&tracer, &flat, &options).image.film;
            let options = AoOptions {
                samples: SampleSettings { pixel_filter, ..SampleSettings::new([16, 16], 256, 0) },
                ..Default::default()
            };
            let record = CameraRecord::new(&scene.cameras[0], flat.origin, 1.0);
            let coverage = ao::render(&tracer, &record, &options, &mut NoControl).unwrap().image.film.coverage;
            for x in 0..16 {
                let column =
                    |value: &dyn Fn(usize) -> f32| (0..16).map(|y| f64::from(value(y * 16 + x))).sum::<f64>() / 16.0;
                let expected = beyond(pixel_filter, 7.75 - x as f64);
                for (what, found) in
                    [("radiance", column(&|i| film.mean[3 * i])), ("coverage", column(&|i| coverage[i]))]
                {
                    assert!(
                        (found - expected).abs() < 2e-3,
                        "{kind} {pixel_filter:?}, {what} of column {x}: {found}, expected {expected}"
                    );
                }
            }
        }
    }
    assert_validation_clean(&device);
}

/// A small area light at twice the distance of focus is a disk as wide as the lens, there: half of it in the plane of focus.
#[test]
fn gpu_a_lens_blurs_what_is_not_in_focus() {
    let device = device();
    let (focus, radius, size) = (4.0, 0.5, 64usize);
    let lamp = |distance: f64| {
        // one unit in the plane of focus is `size` / 4 pixels
        let camera = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 2.0 * (2.0f64 / focus).atan());
        let side = 0.02 * distance;
        let square = shapes::rectangle(DVec3::NEG_Z * distance, DVec3::X * side, DVec3::Y * side);
        scene_of(vec![(square, Material { double_sided: true, ..emitter(1.0) })], camera)
    };
    let lens = Some(Lens { radius: radius as f32, focus: focus as f32 });
    let options =
        PathOptions { samples: SampleSettings::new([size as u32; 2], 64, 0), max_depth: 0, lens, ..Default::default() };
    for kind in picked(&device) {
        let image = |distance: f64, options: &PathOptions| {
            let scene = lamp(distance);
            let flat = FlatScene::new(&scene);
            render(&tracer(&device, kind, &flat), &flat, options).image.film
        };
        // mean square distance from the middle, in pixels, of what emits
        let spread = |film: &Film| {
            let (mut sum, mut all) = (0.0, 0.0);
            for k in 0..size * size {
                let [x, y] = [k % size, k / size].map(|i| i as f64 + 0.5 - size as f64 / 2.0);
                let light = f64::from(film.mean[3 * k]);
                (sum, all) = (sum + light * (x * x + y * y), all + light);
            }
            assert!(all > 1.0, "{kind}: there is no lamp");
            (sum / all, all)
        };
        let ((sharp, bright), (pinhole, as_bright)) =
            (spread(&image(focus, &options)), spread(&image(focus, &PathOptions { lens: None, ..options.clone() })));
        assert!(
            (sharp - pinhole).abs() < 0.1 && (bright / as_bright - 1.0).abs() < 0.02,
            "{kind}: {sharp} in focus, {pinhole}"
        );
        let (blurred, _) = spread(&image(2.0 * focus, &options));
        // a disk of radius r spreads by r^2 / 2
        let disk = (0.5 * radius * size as f64 / 4.0).powi(2) / 2.0;
        println!("{kind}: {sharp:.3} in focus, {blurred:.3} at twice the distance, a disk of {disk:.3}");
        assert!(
            (blurred - sharp - disk).abs() < 0.05 * disk,
            "{kind}: {blurred}, in focus {sharp}, expected {disk} more"
        );
    }
    assert_validation_clean(&device);
}
