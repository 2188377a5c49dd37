//! What bounces bring to Cornell boxes, as people see it: colours bleed with the second, a metal box shows the room with the second and
//! another metal box with the third, glass lets light through with the third (Coello 2024, figures of one to four bounces).

use super::*;
use skylit::integrators::path::View;
use skylit::scene::builtin::by_name;

const SIZE: [u32; 2] = [48, 48];
/// Of the box's mirrors.
const MIRROR_ALBEDO: f32 = 0.95;

/// A scene, a tracer of it, and what is seen with each number of bounces.
struct Seen<'a> {
    tracer: Tracer,
    flat: &'a FlatScene<'a>,
}

impl Seen<'_> {
    fn with(&self, max_depth: u32) -> Film {
        render(
            &self.tracer,
            self.flat,
            &PathOptions { samples: SampleSettings::new(SIZE, 64, 0), max_depth, ..PathOptions::default() },
        )
        .image
        .film
    }

    /// Pixels that show nothing but the mirrors.
    fn mirrors(&self) -> Vec<usize> {
        let options = PathOptions {
            samples: SampleSettings::new(SIZE, 64, 0),
            view: Some(View::Albedo),
            ..PathOptions::default()
        };
        let albedo = render(&self.tracer, self.flat, &options).image.film;
        let whole = |p: &[f32]| p.iter().all(|c| (c - MIRROR_ALBEDO).abs() < 1e-5);
        albedo.mean.chunks(3).enumerate().filter(|(_, p)| whole(p)).map(|(k, _)| k).collect()
    }
}

fn on_a_tracer(scene: &Scene, check: impl Fn(TracerKind, &Seen)) {
    let device = device();
    let flat = FlatScene::for_paths(scene);
    for kind in picked(&device) {
        check(kind, &Seen { tracer: tracer(&device, kind, &flat), flat: &flat });
    }
    assert_validation_clean(&device);
}

/// Sum over channels of a pixel.
fn brightness(film: &Film, pixel: usize) -> f32 {
    film.mean[3 * pixel..3 * pixel + 3].iter().sum()
}

fn mean_brightness(film: &Film, pixels: &[usize]) -> f32 {
    pixels.iter().map(|&p| brightness(film, p)).sum::<f32>() / pixels.len() as f32
}

#[test]
fn gpu_colours_bleed_with_the_second_bounce() {
    // the light is white here, so that what is coloured is the walls' doing
    let mut scene = by_name("cornell-empty").unwrap();
    for m in scene.materials.iter_mut() {
        m.kind = MaterialKind::Matte;
        if m.emissive != Vec3::ZERO {
            m.emissive = Vec3::splat(10.0);
        }
    }
    on_a_tracer(&scene, |kind, seen| {
        // ratio of red to green on the floor, beside the red wall and beside the green one
        let ratio = |film: &Film, columns: std::ops::Range<usize>| {
            let pixels = (41..44).flat_map(|y| columns.clone().map(move |x| y * SIZE[0] as usize + x));
            let (r, g) = pixels.fold((0.0, 0.0), |(r, g), p| (r + film.mean[3 * p], g + film.mean[3 * p + 1]));
            r / g
        };
        let both = |film: &Film| [ratio(film, 8..12), ratio(film, 36..40)];
        let grey = 0.725 / 0.71;
        let [red, green] = both(&seen.with(1));
        assert!((red - grey).abs() < 1e-4 && (green - grey).abs() < 1e-4, "{kind}: one bounce colours: {red}, {green}");
        let [red, green] = both(&seen.with(2));
        println!("{kind}: red over green {red:.3} beside the red wall, {green:.3} beside the green one");
        assert!(red > 1.05 * grey && green < 0.985 * grey, "{kind}: two bounces do not bleed: {red}, {green}");
    });
}

#[test]
fn gpu_metal_boxes_show_each_other_with_the_third_bounce() {
    let mut scene = by_name("cornell-mirror").unwrap();
    let mirror = scene.materials.len() - 1;
    for mesh in scene.meshes.iter_mut().filter(|m| m.name == "short block") {
        mesh.material = mirror;
    }
    on_a_tracer(&scene, |kind, seen| {
        let mirrors = seen.mirrors();
        assert!(mirrors.len() > 200, "{kind}: {} pixels of mirrors", mirrors.len());
        let films: Vec<Film> = (1..=4).map(|depth| seen.with(depth)).collect();
        let dark = |film: &Film| mirrors.iter().filter(|&&p| brightness(film, p) == 0.0).count();
        let counts: Vec<usize> = films.iter().map(dark).collect();
        println!("{kind}: of {} pixels of mirrors, black with 1 to 4 bounces: {counts:?}", mirrors.len());
        // one bounce: only the light itself could be seen in them
        assert!(counts[0] * 20 > mirrors.len() * 19, "{kind}: {counts:?}");
        // two: the room is there, and the other box in it is black, as what lies before the box's open front always is
        assert!(counts[0] - counts[1] > mirrors.len() / 6, "{kind}: {counts:?}");
        // three: the other box shows the room, too; four: that is all of it
        assert!(counts[1] - counts[2] > mirrors.len() / 9 && counts[2] - counts[3] < 5, "{kind}: {counts:?}");
        let lit_by_the_third = |&p: &usize| brightness(&films[1], p) == 0.0 && brightness(&films[2], p) > 0.0;
        let late: Vec<usize> = mirrors.iter().copied().filter(lit_by_the_third).collect();
        assert!(mean_brightness(&films[2], &late) > 0.02, "{kind}: hardly anything is in it");
        // nothing ever gets darker
        for (less, more) in films.iter().zip(&films[1..]) {
            let all: Vec<usize> = (0..less.mean.len() / 3).collect();
            assert!(mean_brightness(more, &all) > mean_brightness(less, &all), "{kind}");
        }
    });
}

#[test]
fn gpu_glass_lets_light_through_with_the_third_bounce() {
    let scene = by_name("cornell-glass-sphere").unwrap();
    on_a_tracer(&scene, |kind, seen| {
        // the middle of the sphere's image
        let [x, y] = [(0.64 * f64::from(SIZE[0])) as usize, (0.74 * f64::from(SIZE[1])) as usize];
        let middle: Vec<usize> =
            (y - 2..y + 2).flat_map(|y| (x - 2..x + 2).map(move |x| y * SIZE[0] as usize + x)).collect();
        let seen: Vec<f32> = (1..=4).map(|depth| mean_brightness(&seen.with(depth), &middle)).collect();
        println!("{kind}: through the glass with 1 to 4 bounces: {seen:?}");
        // what is reflected is a twenty-fifth
        assert!(seen[0] < 0.02 && seen[1] < 0.2 * seen[2], "{kind}: {seen:?}");
        assert!(seen[2] > 0.1, "{kind}: {seen:?}");
    });
}
