//! Settings of image files.

use std::path::PathBuf;

use skylit::output::settings::{Background, ExrCompression, FileSettings, PngBits, PngEncoding, check_alpha};

#[test]
fn backgrounds_are_text() {
    for text in ["transparent", "0,0.5,1"] {
        let background: Background = text.parse().unwrap();
        assert_eq!(background.to_string(), text);
        let json = serde_json::to_string(&background).unwrap();
        assert_eq!(serde_json::from_str::<Background>(&json).unwrap(), background, "{json}");
    }
    for bad in ["", "black", "1,1", "0,0,2", "-1,0,0", "nan,0,0", "1,1,1,1"] {
        assert!(bad.parse::<Background>().unwrap_err().contains("transparent"), "{bad}");
    }
}

#[test]
fn settings_need_a_file_that_has_them() {
    let check = |settings: &FileSettings, outputs: &[&str]| {
        let outputs: Vec<_> = outputs.iter().map(PathBuf::from).collect();
        settings.check(&outputs, None).map_err(|e| e.to_string())
    };
    let none = FileSettings::default();
    let cases = [
        (FileSettings { png_bits: Some(PngBits::Sixteen), ..none.clone() }, "a.exr", "a.png", "--png-bits"),
        (FileSettings { png_encoding: Some(PngEncoding::Linear), ..none.clone() }, "a.apng", "a.PNG", "--png-encoding"),
        (FileSettings { jpeg_quality: Some(3), ..none.clone() }, "a.webp", "a.jpg", "--jpeg-quality"),
        (FileSettings { exr_half: true, ..none.clone() }, "a.png", "a.exr", "--exr-half"),
        (
            FileSettings { exr_compression: Some(ExrCompression::Piz), ..none.clone() },
            "a.png",
            "a.exr",
            "--exr-compression",
        ),
    ];
    for (settings, without, with, option) in cases {
        assert_eq!(check(&settings, &[with]), Ok(()), "{option}");
        assert!(check(&settings, &[without]).is_err_and(|e| e.starts_with(option)), "{option}");
    }
    for (file, has_alpha) in [("a.jpeg", false), ("a.mp4", false), ("a.webp", true), ("a.exr", true)] {
        assert_eq!(check_alpha(Some(Background::Transparent), &[file.into()]).is_ok(), has_alpha, "{file}");
        assert!(check_alpha(Some(Background::Colour([0.0; 3])), &[file.into()]).is_ok());
    }
    let b44 = FileSettings { exr_compression: Some(ExrCompression::B44), ..none };
    assert!(check(&b44, &["a.exr"]).is_err_and(|e| e.contains("add --exr-half")));
    assert_eq!(check(&FileSettings { exr_half: true, ..b44 }, &["a.exr"]), Ok(()));
}
