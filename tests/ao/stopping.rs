//! How a render begins, reports its progress and stops.

use std::time::{Duration, Instant};

use skylit::Error;
use skylit::film::{Control, SampleSettings};
use skylit::integrators::{ao, aov};

use crate::common::{assert_validation_clean, device, picked, record, scene, tracer};
use crate::{AoOptions, render};

#[test]
fn gpu_time_limit() {
    let device = device();
    let scene = scene("cornell-box");
    let limit = Duration::from_millis(400);
    let options = AoOptions {
        samples: SampleSettings { time_limit: Some(limit), ..SampleSettings::new([64, 64], 1 << 24, 0) },
        ..Default::default()
    };
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        let start = Instant::now();
        let image = render(&tracer, &scene, &scene.cameras[0], &options);
        let took = start.elapsed();
        println!(
            "{kind}: {} samples in {took:?}, the longest launch took {:.4} s",
            image.image.spp, image.image.longest_launch
        );
        assert!(
            image.image.stopped_early && image.image.spp >= 1 && image.image.spp < options.samples.spp,
            "{kind}: {}",
            image.image.spp
        );
        assert!(image.image.film.samples.iter().all(|&s| s == image.image.spp), "{kind}: pixels with other counts");
        assert_eq!(image.image.primary_rays, 64 * 64 * image.image.spp as u64);
        // generous: the machine may be busy. Compiling counts too
        assert!(took >= limit && took < limit + Duration::from_secs(20), "{kind}: {took:?}");
        let mean = image.image.film.mean_and_error().0;
        assert!((0.2..0.7).contains(&mean), "{kind}: mean {mean}");
    }
    assert_validation_clean(&device);
}

/// Says what it is told to after some questions, and records the progress.
struct Stopper {
    questions: u32,
    answer: fn() -> skylit::error::Result<bool>,
    progress: Vec<(u64, u64)>,
}

impl Control for Stopper {
    fn progress(&mut self, done: u64, total: u64) {
        self.progress.push((done, total));
    }

    fn should_stop(&mut self) -> skylit::error::Result<bool> {
        self.questions = self.questions.saturating_sub(1);
        if self.questions == 0 { (self.answer)() } else { Ok(false) }
    }
}

#[test]
fn gpu_interruption_and_progress() {
    let device = device();
    let scene = scene("cornell-box");
    let camera = record(&scene, &scene.cameras[0], [64, 64]);
    let options = AoOptions { samples: SampleSettings::new([64, 64], 800, 0), ..Default::default() };
    let stopper = |questions, answer| Stopper { questions, answer, progress: Vec::new() };
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        let mut control = stopper(9, || Err(Error::Interrupted));
        let result = ao::render(&tracer, &camera, &options, &mut control);
        assert!(matches!(result, Err(Error::Interrupted)), "{kind}: {:?}", result.map(|r| r.image.spp));
        // the same through the auxiliary outputs
        let result = aov::render(&tracer, &camera, [64, 64], &mut stopper(1, || Err(Error::Interrupted)));
        assert!(matches!(result, Err(Error::Interrupted)), "{kind}");
        // stop, but keep what there is
        let image = ao::render(&tracer, &camera, &options, &mut stopper(9, || Ok(true))).unwrap();
        println!("{kind}: stopped after {} samples", image.image.spp);
        assert!(
            image.image.stopped_early && image.image.spp >= 1 && image.image.spp < 800,
            "{kind}: {}",
            image.image.spp
        );
        let same =
            render(&tracer, &scene, &scene.cameras[0], &options.clone().with_samples(|s| s.spp = image.image.spp));
        assert_eq!(image.image.film.mean, same.image.film.mean, "{kind}: not the image of as many samples");
        assert!(!same.image.stopped_early);
        // in the midst of the first samples that are taken together: one is finished, or there would be no image
        let image = ao::render(&tracer, &camera, &options, &mut stopper(1, || Ok(true))).unwrap();
        assert!(image.image.stopped_early && image.image.spp == 1, "{kind}: {}", image.image.spp);
        let same = render(&tracer, &scene, &scene.cameras[0], &options.clone().with_samples(|s| s.spp = 1));
        assert_eq!(image.image.film.mean, same.image.film.mean, "{kind}: not the image of one sample");
        let mut control = stopper(u32::MAX, || Ok(false));
        let image = ao::render(&tracer, &camera, &options, &mut control).unwrap();
        assert!(!image.image.stopped_early && image.image.spp == 800);
        assert!(control.progress.windows(2).all(|w| w[0].0 <= w[1].0), "{kind}: progress goes back");
        assert_eq!(control.progress.last(), Some(&(64 * 64 * 800, 64 * 64 * 800)), "{kind}");
    }
    assert_validation_clean(&device);
}
