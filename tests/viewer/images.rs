//! Images in the window, used through their accessibility tree.

use std::sync::Arc;

use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use skylit::colour::srgb_byte;
use skylit::interface::ToneMap;
use skylit::output::{Channel, Image};
use skylit::viewer::images::{Content, Images, Loaded};
use skylit::viewer::window::WindowApp;

/// 40 x 20 pixels whose red counts columns and whose green counts rows; and the same without red.
fn harness() -> Harness<'static, Images> {
    let plane = |of: &dyn Fn(usize, usize) -> f32| (0..800).map(|k| of(k % 40, k / 40)).collect::<Vec<_>>();
    let image = |red: f32, name: &str| {
        let channels = [
            ("R", plane(&|x, _| red * x as f32 / 40.0)),
            ("G", plane(&|_, y| y as f32 / 20.0)),
            ("B", plane(&|_, _| 0.25)),
            ("depth.Z", plane(&|x, _| 3.0 + x as f32)),
        ];
        let channels = channels.map(|(name, values)| Channel::from_floats(name, values)).to_vec();
        let image = Image { width: 40, height: 20, channels, metadata: Vec::new() };
        Loaded { path: name.into(), image: Arc::new(image) }
    };
    let app = Images::new(vec![image(1.0, "first.exr"), image(0.0, "second.exr")]);
    let mut harness = Harness::builder()
        .with_size(egui::vec2(800.0, 600.0))
        .build_state(|context, app: &mut Images| app.show_frame(context), app);
    harness.run_steps(3);
    harness
}

/// The colour of pixel (20, 10), whose upper left corner is in the middle of the picture.
fn middle(app: &Images) -> [u8; 3] {
    let picture = &app.layers()[0].picture;
    let [width, height] = picture.size.map(|n| n as usize);
    let half = (width as f32 / 40.0).min(height as f32 / 20.0) / 2.0;
    let [x, y] = [width, height].map(|n| (n as f32 / 2.0 + half) as usize);
    let at = 4 * (y * width + x);
    [0, 1, 2].map(|c| picture.rgba[at + c])
}

fn press(harness: &mut Harness<'static, Images>, key: egui::Key) {
    harness.key_press(key);
    harness.run_steps(2);
}

#[test]
fn colours_exposures_and_layers() {
    let mut harness = harness();
    assert_eq!(middle(harness.state()), [srgb_byte(0.5), srgb_byte(0.5), srgb_byte(0.25)]);
    assert_eq!(harness.state().title(), "first.exr - skylit");
    press(&mut harness, egui::Key::Minus);
    press(&mut harness, egui::Key::Minus);
    assert_eq!(middle(harness.state()), [srgb_byte(0.25), srgb_byte(0.25), srgb_byte(0.125)]);
    press(&mut harness, egui::Key::Num0);
    harness.state_mut().look.tone_map = ToneMap::Agx;
    harness.run_steps(2);
    assert_eq!(middle(harness.state()), ToneMap::Agx.map([0.5, 0.5, 0.25]).map(srgb_byte));
    harness.state_mut().look.tone_map = ToneMap::Linear;

    // a single number from its least to its greatest value
    harness.get_by_role_and_label(egui::accesskit::Role::ComboBox, "Layer").click();
    harness.run_steps(5);
    harness.get_by_label("depth").click();
    harness.run_steps(5);
    assert_eq!(middle(harness.state()), [srgb_byte(20.0 / 39.0); 3]);
}

#[test]
fn images_take_turns_and_are_compared() {
    let mut harness = harness();
    press(&mut harness, egui::Key::Num2);
    assert_eq!(middle(harness.state())[0], 0);
    press(&mut harness, egui::Key::Num1);
    press(&mut harness, egui::Key::Space);
    assert_eq!((harness.state().shown, harness.state().reference), (1, 0));
    press(&mut harness, egui::Key::Space);
    assert_eq!((harness.state().shown, harness.state().reference), (0, 1));

    // red differs by k / 40: the mean of its square over three channels
    let squares = (0..40).map(|k| (f64::from(k) / 40.0).powi(2)).sum::<f64>() / 120.0;
    let comparison = harness.state_mut().comparison().unwrap().unwrap();
    assert!((comparison.rmse - squares.sqrt()).abs() < 1e-6, "{}", comparison.rmse);
    assert!(harness.query_all_by_label_contains(&format!("RMSE {:.3e}", squares.sqrt())).count() > 0);
    press(&mut harness, egui::Key::D);
    assert_eq!(harness.state().content, Content::Difference);
    assert_eq!(middle(harness.state()), skylit::output::palette::heat(0.5));
    press(&mut harness, egui::Key::L);
    assert_eq!(harness.state().content, Content::Flip);
    assert_ne!(middle(harness.state()), skylit::output::palette::heat(0.5));

    // what is dropped is one more; what cannot be read is said
    harness.state_mut().add("nowhere.exr".as_ref());
    harness.run_steps(2);
    assert!(harness.query_all_by_label_contains("nowhere.exr").count() > 0);
    assert_eq!(harness.state().images.len(), 2);
}

#[test]
fn pixels_are_found_and_enlarged() {
    let mut harness = harness();
    // the middle of the picture, wherever the bars leave it
    let area = harness.state().layers()[0].area;
    let centre = egui::pos2((area[0] + area[2]) as f32 / 2.0, (area[1] + area[3]) as f32 / 2.0);
    harness.event(egui::Event::PointerMoved(centre + egui::vec2(1.0, 1.0)));
    harness.run_steps(2);
    assert_eq!(harness.state().pixel, Some([20, 10]));
    assert_eq!(harness.state().values(1).unwrap(), "R 0.00000  G 0.50000  B 0.25000");

    // what is under the pointer stays there
    let wheel = |y| egui::Event::MouseWheel {
        unit: egui::MouseWheelUnit::Point,
        delta: egui::vec2(0.0, y),
        modifiers: egui::Modifiers::NONE,
    };
    let at = centre + egui::vec2(150.0, 60.0);
    harness.event(egui::Event::PointerMoved(at));
    harness.run_steps(2);
    let before = harness.state().pixel.unwrap();
    harness.event(wheel(300.0));
    harness.run_steps(40);
    assert_eq!(harness.state().pixel, Some(before));
    let zoom = harness.state().zoom;
    assert!(zoom > 20.0, "{zoom}");

    // a drag of ten pixels' length moves the image by ten pixels
    let button = |pressed, pos| egui::Event::PointerButton {
        pos,
        button: egui::PointerButton::Primary,
        pressed,
        modifiers: egui::Modifiers::NONE,
    };
    let middle = harness.state().middle;
    harness.event(button(true, at));
    harness.run_steps(1);
    harness.event(egui::Event::PointerMoved(at - egui::vec2(10.0 * zoom, 0.0)));
    harness.run_steps(1);
    harness.event(button(false, at - egui::vec2(10.0 * zoom, 0.0)));
    harness.run_steps(1);
    assert!((harness.state().middle.x - middle.x - 10.0).abs() < 0.5, "{middle} {}", harness.state().middle);
    press(&mut harness, egui::Key::F);
    assert_eq!(harness.state().zoom, 0.0);
    harness.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::Q);
    harness.run_steps(1);
    assert!(harness.state().closes());
}

/// Large images are compared beside the window, which answers meanwhile.
#[test]
fn large_images_are_compared_beside_the_window() {
    let image = |value: f32, name: &str| {
        let channels = ["R", "G", "B"].map(|name| Channel::from_floats(name, vec![value; 600 * 500])).to_vec();
        let image = Image { width: 600, height: 500, channels, metadata: Vec::new() };
        Loaded { path: name.into(), image: Arc::new(image) }
    };
    let app = Images::new(vec![image(0.5, "first.exr"), image(0.25, "second.exr")]);
    let mut harness = Harness::builder()
        .with_size(egui::vec2(800.0, 600.0))
        .build_state(|context, app: &mut Images| app.show_frame(context), app);
    let begun = std::time::Instant::now();
    harness.run_steps(1);
    press(&mut harness, egui::Key::D);
    assert_eq!(harness.state().layers().len(), 1, "the image is there");
    while harness.state().is_comparing() {
        assert!(begun.elapsed().as_secs() < 60 && harness.query_by_label_contains("comparing").is_some());
        std::thread::sleep(std::time::Duration::from_millis(5));
        harness.run_steps(1);
    }
    harness.run_steps(2);
    assert!(harness.query_by_label_contains("RMSE 2.500e-1").is_some());
}
