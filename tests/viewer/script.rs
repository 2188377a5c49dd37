//! The whole viewer, used by scripts without a window.

use std::path::Path;
use std::time::{Duration, Instant};

use skylit::Error;
use skylit::renderer::RenderSettings;
use skylit::tracer::DeviceSettings;
use skylit::viewer::{ViewOptions, headless};

pub fn options(scene: Option<&str>) -> ViewOptions {
    ViewOptions {
        scene: scene.map(str::to_owned),
        gltf_scene: None,
        confine: Default::default(),
        geometry: Default::default(),
        settings: RenderSettings::default(),
        device: DeviceSettings::default(),
        size: Some([760, 520]),
        frame_rate: Some(10.0),
        painter: Default::default(),
        device_name: None,
    }
}

fn run(scene: Option<&str>, folder: &Path, text: &str) -> skylit::Result<Vec<skylit::viewer::script::Section>> {
    let script = folder.join("script.txt");
    std::fs::write(&script, text.replace("FOLDER", &folder.to_string_lossy())).unwrap();
    headless::run(&options(scene), &script)
}

#[test]
fn gpu_a_session() {
    let folder = tempfile::tempdir().unwrap();
    let sections = run(
        Some("builtin:stairs"),
        folder.path(),
        "wait picture 500
screenshot FOLDER/first.png
mark orbit
drag 200 200 320 240 1
wheel 200 200 3
key W 0.3
screenshot FOLDER/moved.png
mark settings
click Radius
set Radius = 0.6
key 1
key 3
expect AO quality
key X
wait compared 90
expect RMSE
drag-control Line between the images -80 0 0.3
key Space
key X
resize 500 400
wait 0.3
resize 760 520
press 200 250
wait text:What was clicked on
click What was clicked on
wait text:Instance
key Ctrl+S
wait text:Save the image
key Ctrl+A
type FOLDER/saved.exr
key Enter
wait text:saved
drop builtin:no-such-scene
wait text:no built-in scene
expect AO quality
key Ctrl+Q
wait 1",
    );
    let sections = sections.unwrap();
    // Ctrl+Q ends the script
    let names: Vec<&str> = sections.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["start", "orbit", "settings"]);
    assert!(sections.iter().all(|s| s.pictures > 0 && s.ui_frames > 0) && sections[2].seconds < 100.0, "{sections:?}");
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_ne!(read("first.png"), read("moved.png"));
    let saved = skylit::output::load(&folder.path().join("saved.exr")).unwrap();
    assert!(saved.f32("Y").is_some() && saved.f32("depth.Z").is_some() && saved.metadata("command").is_some());
}

/// A click on the image while the scene is being rebuilt selects what is there once it is: nothing is deselected. Lights and the ground rebuild it.
#[test]
fn gpu_clicks_wait_for_a_scene_that_is_rebuilt() {
    let folder = tempfile::tempdir().unwrap();
    run(
        Some("builtin:stairs"),
        folder.path(),
        "wait picture 500
press 200 250
wait text:What was clicked on
click Light
click Ground
click Plane
press 200 250
wait 5
wait samples 4 300
expect What was clicked on
expect-no-errors",
    )
    .unwrap();
}

/// A scene that is opened after another one is seen by a camera of its own, also where nothing else
/// that is requested differs: the camera of the first one was moved, and neither has an AO radius.
#[test]
fn gpu_another_scene_has_a_camera_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let text = "wait picture 300
drag 200 200 260 220 0.3 left
wait 0.5
drop builtin:cornell-spheres
wait 1
wait picture 60
expect-no-errors";
    run(Some("builtin:plane"), folder.path(), text).unwrap();
}

/// A file whose light is candela and lux: the first path of it shows something, and says by which exposure; ambient occlusion has none.
#[test]
fn gpu_light_of_a_file_is_exposed() {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = skylit::scene::builtin::by_name("cornell-box").unwrap();
    scene.materials.iter_mut().for_each(|m| m.emissive *= 1000.0);
    let file = folder.path().join("bright.glb");
    skylit::scene::export::export_gltf(&scene, &file).unwrap();
    let text = "wait picture 500
wait 0.3
screenshot FOLDER/occlusion.png
key 4
wait text:exposure -
wait samples 8 500
screenshot FOLDER/path.png
expect-no-errors";
    run(Some(&file.to_string_lossy()), folder.path(), text).unwrap();
    // the image is grey, and not white
    let path = image::open(folder.path().join("path.png")).unwrap().into_rgb8();
    let middle = path.enumerate_pixels().filter(|(x, y, _)| (100..400).contains(x) && (100..400).contains(y));
    let (white, all) = middle.fold((0, 0), |(white, all), (_, _, p)| (white + u32::from(p.0 == [255; 3]), all + 1));
    assert!(white * 4 < all, "{white} of {all} pixels are white");
}

#[test]
fn gpu_tracers_are_switched_while_it_runs() {
    let folder = tempfile::tempdir().unwrap();
    let text = "wait picture 500
click Device
click Tracer
click pipeline
wait text:Tracer pipeline
wait samples 8 500
key X
wait compared 500
click Tracer
click query
key Ctrl+S
wait text:Save the image
key Ctrl+A
type FOLDER/query.png
key Enter
wait text:saved
expect Tracer query: requested
key X
click Tracer
click compute
wait text:Tracer compute
wait samples 8 500
expect-no-errors";
    let available = crate::common::tracers(&crate::common::device());
    let text: Vec<&str> = text.lines().collect();
    let text = if available.len() == 3 { text.join("\n") } else { "wait picture 500\nexpect-no-errors".into() };
    let sections = run(Some("builtin:cornell-box"), folder.path(), &text).unwrap();
    assert!(
        sections.len() == 1 && sections[0].pictures > 0 && sections[0].first_picture_seconds.is_some(),
        "{sections:?}"
    );
    assert_eq!(
        folder.path().join("query.png").exists(),
        available.len() == 3,
        "what is to be saved waits for an image"
    );
}

/// A scene whose image does not arrive before it is seen without it: a pipe. When the image is replaced on disk the scene is loaded anew.
#[test]
fn gpu_images_follow_the_geometry_and_are_watched() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    for name in ["courtyard.gltf", "courtyard.bin", "courtyard_0.png"] {
        std::fs::copy(own.join(name), at(name)).unwrap();
    }
    skylit::files::probes::hold(Some(&at("courtyard_0.png")));
    let wait_for = |name: &str| {
        let start = Instant::now();
        while !at(name).exists() && start.elapsed().as_secs() < 100 {
            std::thread::sleep(Duration::from_millis(50));
        }
    };
    let script = "wait text:primitives in
wait picture 500
screenshot FOLDER/geometry.png
wait text:loaded the images
screenshot FOLDER/images.png
mark changed
wait text:primitives in
wait samples 8 500
expect-no-errors";
    let sections = std::thread::scope(|scope| {
        scope.spawn(|| {
            wait_for("geometry.png");
            skylit::files::probes::hold(None);
            wait_for("images.png");
            // files are looked at once a second
            std::thread::sleep(Duration::from_millis(1500));
            std::fs::copy(own.join("courtyard_0.png"), at("new.png")).unwrap();
            std::fs::rename(at("new.png"), at("courtyard_0.png")).unwrap();
        });
        run(Some(&at("courtyard.gltf").to_string_lossy()), folder.path(), script)
    });
    let sections = sections.unwrap();
    assert!(sections.len() == 2 && sections.iter().all(|s| s.pictures > 0), "{sections:?}");
}

#[test]
fn gpu_scripts_fail_where_they_should() {
    let folder = tempfile::tempdir().unwrap();
    for (text, expected) in [
        ("wait 0.1\nexpect no such text", "line 2: nothing on the screen"),
        ("wait 0.1\nclick No such button", "line 2: no control is called"),
        ("wait settled", "no scene is open"),
        ("drop no/such/file.glb\nwait picture", "no/such/file.glb"),
        ("drop no/such/file.glb\nwait settled", "no/such/file.glb"),
        ("drop builtin:plane\nwait picture\nwait compared", "nothing is compared"),
        ("drop builtin:plane\nwait picture\ndrop no/such/file.glb\nwait settled", "no/such/file.glb"),
    ] {
        let start = Instant::now();
        let error = run(None, folder.path(), text).unwrap_err();
        assert!(matches!(error, Error::CheckFailed(_)) && error.to_string().contains(expected), "{error}");
        assert!(start.elapsed().as_secs() < 60, "{text}: the reason is known at once");
    }
    assert!(matches!(headless::run(&options(None), Path::new("no such script")), Err(Error::Input { .. })));
}

/// From behind the walls of a dark room nothing is to be seen: a line says so, F finds the place from which there is, and so does Ctrl+R. An environment that is dropped lights
/// it from outside, and one that cannot be read changes nothing.
#[test]
fn gpu_black_views_are_left() {
    let folder = tempfile::tempdir().unwrap();
    let sky = skylit::output::Image {
        width: 4,
        height: 2,
        channels: ["R", "G", "B"]
            .map(|name| skylit::output::Channel {
                name: name.into(),
                samples: skylit::output::Samples::F32(vec![0.5; 8]),
            })
            .to_vec(),
        metadata: Vec::new(),
    };
    skylit::output::save(&sky, &folder.path().join("sky.exr")).unwrap();
    std::fs::write(folder.path().join("broken.hdr"), "no image").unwrap();
    let script = folder.path().join("script.txt");
    let text = "wait picture 500
wheel 200 200 -12
wait text:Black
screenshot FOLDER/black.png
key F
wait text:framed what can be seen
wait 3
screenshot FOLDER/framed.png
wheel 200 200 -12
wait text:Black
drop FOLDER/broken.hdr
wait text:the light stays
key Ctrl+R
wait text:framed what can be seen
drop FOLDER/sky.exr
wait text:environment: FOLDER/sky.exr
wheel 200 200 -12
wait 8
screenshot FOLDER/lit.png";
    std::fs::write(&script, text.replace("FOLDER", &folder.path().to_string_lossy())).unwrap();
    let mut options = options(Some("builtin:closed-box"));
    options.settings.integrator = Some("direct".parse().unwrap());
    headless::run(&options, &script).unwrap();
    let mean = |name: &str| {
        let image = skylit::output::load(&folder.path().join(name)).unwrap();
        let red = image.f32("R").unwrap();
        // the middle of the image, without titles and the line
        let row = |y: usize| &red[y * image.width as usize..][100..400];
        let values: Vec<f32> = (150..300).flat_map(|y| row(y).iter().copied()).collect();
        values.iter().sum::<f32>() / values.len() as f32
    };
    let means = ["black.png", "framed.png", "lit.png"].map(mean);
    assert!(means[0] < 0.01 && means[1] > 0.05 && means[2] > 0.05, "{means:?}");
}
