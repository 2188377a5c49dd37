//! OBJ and MTL.

use glam::{Vec2, Vec3, Vec4};
use skylit::scene::material::MaterialKind;
use skylit::scene::{AlphaMode, Scene, Wrap};

use crate::build::*;

fn error(text: &str) -> String {
    Folder::new().load("a.obj", text).map(|_| ()).unwrap_err().to_string()
}

/// A triangle with the material `m` of this library.
fn with_mtl(folder: &Folder, mtl: &str) -> Scene {
    folder.write("a.mtl", mtl);
    folder
        .load("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n")
        .unwrap()
}

#[test]
fn polygons_groups_and_relative_indices() {
    let text = "# comment\no first\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\ng second\nv 0 0 1\nf -1 1 2 # after\n\
                f 1 2 \\\n  3\ng second\nf 1 2 3 4 5\nl 1 2\n";
    let scene = Folder::new().load("a.obj", text).unwrap();
    let names: Vec<_> = scene.instances.iter().map(|i| i.name.as_str()).collect();
    assert_eq!(names, ["first", "second"]);
    assert_eq!(corners(mesh(&scene, 0)).len(), 2);
    assert_eq!(corners(mesh(&scene, 1))[0], [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]);
    assert_eq!(scene.triangle_count(), 2 + 2 + 3);
    // no vn: flat
    assert!(mesh(&scene, 0).normals.is_empty());
    assert_eq!((scene.report.normals_computed, scene.materials.len()), (2, 1));
}

#[test]
fn vertices_are_welded_by_position_texcoord_and_normal() {
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0.25\nvt 1\nvn 0 0 2\nvn 1 0 0\n\
                f 1/1/1 2/1/1 3/1/1\nf 1/1/1 3/1/1 4/1/1\nf 1/2/1 3//2 4/1\n";
    let scene = Folder::new().load("a.obj", text).unwrap();
    let m = mesh(&scene, 0);
    assert_eq!(m.positions.len(), 7);
    assert_eq!(m.indices[..2], [[0, 1, 2], [0, 2, 3]]);
    assert_eq!((m.normals.len(), m.texcoords[0].len()), (7, 7));
    // v is turned over; what is missing is zero
    assert_eq!(m.texcoords[0][0], Vec2::new(0.0, 0.75));
    assert_eq!((m.texcoords[0][4], m.texcoords[0][5]), (Vec2::new(1.0, 1.0), Vec2::ZERO));
    assert_eq!((m.normals[0], m.normals[5]), (Vec3::Z, Vec3::X));
    // the corner without a normal gets that of its triangle
    assert_eq!(m.normals[6], Vec3::Z);
}

/// The outline is counter-clockwise.
fn check_cut(outline: &[[f32; 2]]) {
    let n = outline.len();
    let cross = |a: [f32; 2], b: [f32; 2]| a[0] * b[1] - a[1] * b[0];
    let area: f32 = (0..n).map(|i| cross(outline[i], outline[(i + 1) % n]) / 2.0).sum();
    assert!(area > 0.0);
    // whichever corner comes first, whichever way it turns, in whichever plane, near and far
    for case in 0..n * 2 * 3 * 2 {
        let (start, case) = (case % n, case / n);
        let (reversed, axis, far) = (case % 2 == 1, case / 2 % 3, case / 6 == 1);
        let at = |i: usize| {
            let i = (start + i) % n;
            outline[if reversed { n - 1 - i } else { i }]
        };
        let place = |[x, y]: [f32; 2]| {
            // a slope, so that the plane is no axis plane
            let mut p = [x, y, 0.25 * x + 0.125 * y];
            p.rotate_right(axis);
            p.map(|c| c + if far { 1024.0 } else { 0.0 })
        };
        let mut text = String::new();
        let mut face = "f".to_owned();
        for (i, p) in (0..n).map(at).enumerate() {
            let [x, y, z] = place(p);
            text += &format!("v {x} {y} {z}\nvt {} {}\n", p[0], 1.0 - p[1]);
            face += &format!(" {0}/{0}", i + 1);
        }
        let scene = Folder::new().load("a.obj", text + &face).unwrap();
        let m = mesh(&scene, 0);
        assert_eq!(m.indices.len(), n - 2);
        let mut sum = 0.0;
        for t in &m.indices {
            let [a, b, c] = t.map(|i| m.texcoords[0][i as usize]);
            let signed = (b - a).perp_dot(c - a) / 2.0;
            assert!(if reversed { signed < 0.0 } else { signed > 0.0 }, "{t:?} of {outline:?} from {start}");
            sum += signed.abs();
            // texture coordinates stay with their corners
            for &i in t {
                let position = scene.instances[0].object_to_world.transform_point3(m.positions[i as usize].as_dvec3());
                assert_eq!(position.as_vec3().to_array(), place(m.texcoords[0][i as usize].into()));
            }
        }
        // all turn the same way and add up: they cover the polygon once
        assert!((sum - area).abs() < 1e-4, "{sum} for {area}: {outline:?} from {start}");
    }
}

#[test]
fn concave_polygons() {
    let dart = [[-1.0, -1.0], [0.0, -0.5], [1.0, -1.0], [0.0, 1.0]];
    let l = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]];
    let star: Vec<[f32; 2]> = (0..10)
        .map(|i| {
            let (s, c) = (i as f32 * std::f32::consts::TAU / 10.0).sin_cos();
            // digits that f32 text, the shift to far away and the slope keep
            [s, c].map(|x| ((if i % 2 == 0 { 64.0 } else { 16.0 }) * -x).round() / 32.0)
        })
        .rev()
        .collect();
    let comb = [
        [0.0, 0.0],
        [7.0, 0.0],
        [7.0, 4.0],
        [6.0, 4.0],
        [6.0, 1.0],
        [4.0, 1.5],
        [4.0, 4.0],
        [3.0, 4.0],
        [3.0, 1.0],
        [1.0, 1.5],
        [1.0, 4.0],
        [0.0, 4.5],
    ];
    let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    for outline in [&dart[..], &l, &star, &comb, &square] {
        check_cut(outline);
    }
}

#[test]
fn convex_polygons_stay_fans() {
    let text = "v 0 0 0\nv 2 0 0\nv 3 1 0\nv 2 2 0\nv 0 2 0\nf 2 3 4 5 1\n";
    let scene = Folder::new().load("a.obj", text).unwrap();
    assert_eq!(mesh(&scene, 0).indices, [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
}

#[test]
fn polygons_that_are_none() {
    // crossing itself, on a line, one point, there and back
    for face in ["1 3 2 4", "1 2 5 2", "1 1 1 1 1", "1 2 3 2 1", "1 3 2 4 1 3 2 4 5"] {
        let text = format!("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nf {face}\nf 1 2 3\n");
        assert!(Folder::new().load("a.obj", text).unwrap().triangle_count() >= 1);
    }
}

#[test]
fn vertex_colors() {
    let scene = Folder::new().load("a.obj", "v 0 0 0 1 0.5 0\nv 1 0 0 1 1 1\nv 0 1 0\nf 1 2 3\n").unwrap();
    assert_eq!(mesh(&scene, 0).colors, [Vec4::new(1.0, 0.5, 0.0, 1.0), Vec4::ONE, Vec4::ONE]);
}

/// Points and lines that a converter left over do not hide the model.
#[test]
fn faces_without_area_are_left_out() {
    let scene = Folder::new().load("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1\nf 1 2\nf 1 2 3\nf 3 1\n").unwrap();
    assert_eq!((scene.triangle_count(), scene.report.warnings.len()), (1, 1));
    assert!(scene.report.warnings[0].contains("3 faces with fewer than three corners: left out"));
    assert!(error("v 0 0 0\nf 1 9\n").contains("vertex 9"));
}

/// A triangle that is red by a material of its name alone.
const RED: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n";

/// The colour of the first mesh.
fn color(scene: &Scene) -> [f32; 3] {
    scene.materials[scene.meshes[0].material].base_color.truncate().to_array()
}

#[test]
fn encodings_and_byte_order_marks() {
    let folder = Folder::new();
    for first in ["", "v 9 9 9\n"] {
        let text = format!("{first}{RED}");
        let mtl = "newmtl red\nKd 1 0 0\n";
        for encode in [
            |t: &str| [b"\xef\xbb\xbf", t.as_bytes()].concat(),
            |t: &str| [b"\xfe\xff".to_vec(), t.encode_utf16().flat_map(u16::to_be_bytes).collect()].concat(),
            |t: &str| [b"\xff\xfe".to_vec(), t.encode_utf16().flat_map(u16::to_le_bytes).collect()].concat(),
            |t: &str| t.encode_utf16().flat_map(u16::to_le_bytes).collect(),
            |t: &str| t.replace('\n', "\r").into_bytes(),
            |t: &str| t.replace('\n', "\r\n").into_bytes(),
            |t: &str| format!("{}\0\0\0", t.replace(' ', "\t")).into_bytes(),
        ] {
            folder.write("a.mtl", encode(mtl));
            let scene = folder.load("a.obj", encode(&text)).unwrap();
            assert_eq!(
                (color(&scene), scene.report.warnings.len()),
                ([1.0, 0.0, 0.0], 0),
                "{:?}",
                scene.report.warnings
            );
        }
    }
}

/// Names are bytes; so are those of files.
#[test]
fn names_that_are_no_utf_8() {
    let folder = Folder::new();
    let names = [&b"r\xe9d"[..], b"r\xe8d", b"r\xc3\xa9d", b"\xc4\xbe\xcd\xb7", b"\xc4\xbe\xcd\xb8", b"\x95\x5c"];
    let mut mtl = Vec::new();
    let mut obj = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n".to_vec();
    for (k, name) in names.iter().enumerate() {
        mtl.extend([b"newmtl ", *name, format!("\nKd 0.{k} 0 0\n").as_bytes()].concat());
        obj.extend([b"o ", *name, b"\nusemtl ", *name, b"\nf 1 2 3\n"].concat());
    }
    folder.write("a.mtl", mtl);
    let scene = folder.load("a.obj", obj).unwrap();
    let colors: Vec<f32> = scene.meshes.iter().map(|m| scene.materials[m.material].base_color.x).collect();
    assert_eq!(colors, [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]);
    assert_eq!((scene.meshes[0].name.as_str(), scene.meshes[5].name.as_str()), ("réd", "\\x95\\"));

    // a picture whose name is UTF-8 on this disk and Latin-1 in the file, and one that is Latin-1 on both
    folder.write("t\u{e9}.png", png(1, 1, [1, 2, 3, 255]));
    folder.write("a.mtl", b"newmtl m\nmap_Kd t\xe9.png\n");
    let text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";
    assert_eq!(folder.load("a.obj", text).unwrap().textures.len(), 1);
}

#[test]
fn lists_of_libraries() {
    let folder = Folder::new();
    folder.write("blue.mtl", "newmtl blue\nKd 0 0 1\nnewmtl both\nKd 0 0 1\n");
    folder.write("red.mtl", "newmtl red\nKd 1 0 0\nnewmtl both\nKd 1 0 0\n");
    folder.write("my own lib.mtl", "newmtl green\nKd 0 1 0\n");
    let load = |libraries: &str, material: &str| {
        let text = RED.replace("mtllib a.mtl", libraries).replace("usemtl red", &format!("usemtl {material}"));
        let scene = folder.load("a.obj", text).unwrap();
        assert!(scene.report.warnings.is_empty(), "{libraries}: {:?}", scene.report.warnings);
        color(&scene)
    };
    let (red, green, blue) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    assert_eq!(load("mtllib blue.mtl red.mtl", "red"), red);
    // the first file that has the name counts
    assert_eq!(load("mtllib blue.mtl red.mtl", "both"), blue);
    assert_eq!(load("mtllib red.mtl\nmtllib blue.mtl\nmtllib red.mtl", "both"), red);
    assert_eq!(load("mtllib \"red.mtl\"", "red"), red);
    for list in [
        "my own lib.mtl",
        "\"my own lib.mtl\"",
        "red.mtl my own lib.mtl blue.mtl",
        "\"red.mtl\" \"my own lib.mtl\" # all",
    ] {
        assert_eq!(load(&format!("mtllib {list}"), "green"), green, "{list}");
    }
    assert_eq!(load("mtllib C:\\models\\red.mtl", "red"), red);
    assert_eq!(load("mtllib RED.MTL", "red"), red);
    let text = RED.replace("a.mtl", "red.mtl gone.mtl");
    let scene = folder.load("b.obj", text).unwrap();
    assert_eq!(color(&scene), red);
    assert!(scene.report.warnings[0].contains("`gone.mtl` was not found"), "{:?}", scene.report.warnings);
}

#[test]
fn a_library_of_the_same_name_needs_no_mention() {
    let folder = Folder::new();
    folder.write("Model.MTL", "newmtl red\nKd 1 0 0\n");
    let scene = folder.load("model.obj", RED.replace("mtllib a.mtl\n", "")).unwrap();
    assert_eq!((color(&scene), scene.report.warnings.len()), ([1.0, 0.0, 0.0], 0));
    let scene = folder.load("model.obj", RED.replace("a.mtl", "lost.mtl")).unwrap();
    assert_eq!(color(&scene), [1.0, 0.0, 0.0]);
    assert!(scene.report.warnings[0].ends_with("model.mtl is read in its place"), "{:?}", scene.report.warnings);
    // without materials, none is looked for
    let scene = folder.load("model.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    assert_eq!(scene.materials.len(), 1);
}

#[test]
fn names_of_materials() {
    let folder = Folder::new();
    let mtl = "newmtl Material #25\nKd 1 0 0\nnewmtl Material #26\nKd 0 1 0\nnewmtl \"a b\"\nKd 0 0 1\nnewmtl x # note\nKd 1 1 0\n";
    folder.write("a.mtl", mtl);
    let of = |name: &str| {
        let scene = folder.load("a.obj", RED.replace("usemtl red", &format!("usemtl {name}"))).unwrap();
        (color(&scene), scene.report.warnings.len())
    };
    assert_eq!(of("Material #25"), ([1.0, 0.0, 0.0], 0));
    assert_eq!(of("Material #26 # a comment"), ([0.0, 1.0, 0.0], 0));
    assert_eq!((of("a b"), of("\"a b\"")), (([0.0, 0.0, 1.0], 0), ([0.0, 0.0, 1.0], 0)));
    assert_eq!((of("x"), of("X\t")), (([1.0, 1.0, 0.0], 0), ([1.0, 1.0, 0.0], 0)));
    // no name is no material, and nothing to be said
    assert_eq!((of(""), of("other").1), (([0.8; 3], 0), 1));
}

#[test]
fn numbers_as_programs_write_them() {
    let text =
        "v 1.0e+03 -5. .5\nv 1,5 2,25 -0,5\nv 1.0D+1 0 0\nvt nan(ind) -1.#IND\nvn 1.#QNAN 0 0\nf 1/1/1 2/1/1 3/0/0\n";
    let scene = Folder::new().load("a.obj", text).unwrap();
    assert_eq!(corners(mesh(&scene, 0)), [[[1000.0, -5.0, 0.5], [1.5, 2.25, -0.5], [10.0, 0.0, 0.0]]]);
    assert!(
        scene.report.warnings.iter().any(|w| w.contains("3 numbers have a decimal comma")),
        "{:?}",
        scene.report.warnings
    );
    assert!(mesh(&scene, 0).normals.iter().all(|n| n.is_normalized()));
    assert!(error("v 1,2,3 0 0\n").contains("`1,2,3` is not a number"));
    assert!(error("v 1.#INF 0 0\n").contains("is not finite"));
}

/// A comment may end with the backslash of a folder.
#[test]
fn comments_are_not_continued() {
    let scene = Folder::new().load("a.obj", "# C:\\models\\\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 \\\n3\n").unwrap();
    assert_eq!(corners(mesh(&scene, 0)), [TRIANGLE]);
}

#[test]
fn far_from_the_origin() {
    let at = |x: f64, y: f64, z: f64| {
        let mut text = String::new();
        for [dx, dy, dz] in [[0.0, 0.0, 0.0], [0.137, 0.0, 0.0], [0.137, 0.0831, 1.5]] {
            text += &format!("v {:.4} {:.4} {:.4}\n", x + dx, y + dy, z + dz);
        }
        text + "v 0 0 0\ng a\nf 1 2 3\ng b\nf 3 2 1\n"
    };
    let folder = Folder::new();
    let near = folder.load("near.obj", at(0.0, 0.0, 0.0)).unwrap();
    let far = folder.load("far.obj", at(448_262.25, 35.5, -5_411_932.75)).unwrap();
    assert_eq!(near.instances[0].object_to_world, glam::DAffine3::IDENTITY);
    // the vertex that nothing uses does not count, and meshes that touch have one place
    assert_eq!(far.instances[0].object_to_world, far.instances[1].object_to_world);
    let place = |scene: &Scene, k: usize| {
        scene.instances[0].object_to_world.transform_point3(mesh(scene, 0).positions[k].as_dvec3())
    };
    for k in 0..3 {
        let expected = place(&near, k) + glam::DVec3::new(448_262.25, 35.5, -5_411_932.75);
        assert!((place(&far, k) - expected).length() < 1e-6, "{} {expected}", place(&far, k));
    }
    assert!((far.origin() - place(&far, 0)).length() < 2.0);
}

/// An octahedron whose faces are in a smoothing group, but for the first.
#[test]
fn smoothing_groups() {
    let vertices = "v 1 0 0\nv -1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nv 0 0 -1\n";
    let faces = "f 1 3 5\ns 1\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nusemtl other\nf 2 3 6\nf 4 2 6\nf 1 4 6\n";
    let scene = Folder::new().load("a.obj", format!("{vertices}{faces}")).unwrap();
    let m = mesh(&scene, 0);
    let normals = |t: usize| m.indices[t].map(|i| m.normals[i as usize]);
    // flat, with corners of its own
    let flat = Vec3::splat(1.0 / 3f32.sqrt());
    assert!(normals(0).iter().all(|n| n.abs_diff_eq(flat, 1e-6)), "{:?}", normals(0));
    // what is around (0, -1, 0) is in the group, also beyond the change of material
    let around = m.indices[2].iter().zip(normals(2)).find(|(i, _)| m.positions[**i as usize] == Vec3::NEG_Y).unwrap().1;
    assert!(around.abs_diff_eq(Vec3::NEG_Y, 1e-6), "{around}");
    assert_eq!(scene.report.normals_computed, 2);
    // `off`, no group, and normals that the file has
    for faces in ["s off\nf 1 3 5\nf 3 2 5\n", "f 1 3 5\nf 3 2 5\n", "s 1\ns 0\nf 1 3 5\nf 3 2 5\n"] {
        let scene = Folder::new().load("a.obj", format!("{vertices}{faces}")).unwrap();
        assert!(mesh(&scene, 0).normals.is_empty(), "{faces}");
    }
    let scene =
        Folder::new().load("a.obj", format!("{vertices}vn 1 0 0\ns 1\nf 1//1 3//1 5//1\nf 3//1 2//1 5//1\n")).unwrap();
    assert!(mesh(&scene, 0).normals.iter().all(|n| *n == Vec3::X));
}

/// Sixty thousand corners of one position are no matter of squares.
#[test]
fn many_corners_at_a_position() {
    let mut text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned();
    for i in 0..60_000 {
        text += &format!("vt {} {i}\ns {i}\nf 1/{c} 2/{c} 3/{c}\nf 1 2 3\n", i % 1000, c = i + 1);
    }
    let start = std::time::Instant::now();
    let scene = Folder::new().load("a.obj", text).unwrap();
    assert_eq!(scene.triangle_count(), 120_000);
    assert!(start.elapsed().as_secs() < 10, "{:?}", start.elapsed());
}

/// A kind of warning is said once with a count, however large the file is.
#[test]
fn warnings_are_bounded() {
    let folder = Folder::new();
    let mut mtl = String::new();
    for i in 0..2000 {
        mtl += &format!("newmtl m{i}\nmap_Kd gone {i}.png\nmap_Xs s.png\nKd x\nodd{i} on\n");
    }
    folder.write("a.mtl", mtl);
    let mut text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned();
    for i in 0..2000 {
        text += &format!("mtllib gone{i}.mtl\nusemtl {}{i}\nf 1 2 3\nf 1 1 1\n", "long".repeat(1000));
    }
    let scene = folder.load("a.obj", text).unwrap();
    let warnings = &scene.report.warnings;
    assert!(
        warnings.len() < 10 && warnings.iter().all(|w| w.len() < 2000),
        "{} warnings: {:.500?}",
        warnings.len(),
        warnings
    );
    assert!(warnings.iter().any(|w| w.contains("map_Xs is not used (and 1999 more of this kind)")), "{warnings:?}");
}

#[test]
fn errors_name_the_line() {
    assert!(error("v 0 0 0\nv 1 nan 0\n").contains("line 2: the vertex position `1 nan 0` is not finite"));
    assert!(error("v 0 0 inf\n").contains("line 1"));
    assert!(error("v 0 0\n").contains("3 numbers"));
    assert!(error("v 0 x 0\n").contains("`x` is not a number"));
    assert!(error("v 0 0 0\n\nf 1 2 3\n").contains("line 3: the face refers to vertex 2, but there are 1"));
    assert!(error("v 0 0 0\nf 0 1 1\n").contains("vertex 0"));
    assert!(error("v 0 0 0\nf -2 1 1\n").contains("vertex -2"));
    assert!(error("v 0 0 0\nf 1/-9223372036854775807 1 1\n").contains("texture coordinate"));
    assert!(error("v 0 0 0\nf 1/1 1/1 1/1\n").contains("texture coordinate 1"));
    assert!(error("v 0 0 0\nf 1//1 1 1\n").contains("normal 1"));
    assert!(error("v 0 0 0\nf a b c\n").contains("`a` is not a corner"));
}

#[test]
fn materials() {
    let folder = Folder::new();
    let scene = with_mtl(
        &folder,
        "newmtl other\nnewmtl m\nKd 0.1 0.2 0.3\nKs 0.5 0.5 0.5\nKe 17 12 4\nNi 1.3\nNs 10\nd 1\nTr 0\nillum 2\n",
    );
    let m = &scene.materials[scene.meshes[0].material];
    assert_eq!((m.base_color, m.emissive), (Vec4::new(0.1, 0.2, 0.3, 1.0), Vec3::new(17.0, 12.0, 4.0)));
    assert_eq!((m.ior, m.specular_color, m.alpha_mode), (1.3, Vec3::splat(0.5), AlphaMode::Opaque));
    assert_eq!((m.kind, m.name.as_str()), (MaterialKind::MetallicRoughness, "m"));
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
}

/// `d` is coverage, and `Tr` is 1 - d.
#[test]
fn opacity_in_its_many_spellings() {
    let folder = Folder::new();
    let material = |mtl: &str| {
        let scene = with_mtl(&folder, &format!("newmtl m\n{mtl}\n"));
        scene.materials[0].clone()
    };
    for opaque in ["d 1", "d 1\nTr 0", "d 1\nTr 1", "Tr 1", "Tr 0", "", "d 2", "d -halo 1", "d 0", "d -1"] {
        let m = material(opaque);
        assert_eq!(
            (m.kind, m.alpha_mode, m.base_color.w),
            (MaterialKind::MetallicRoughness, AlphaMode::Opaque, 1.0),
            "{opaque}"
        );
    }
    for (mtl, alpha) in [
        ("d 0.999", 0.999),
        ("Tr 0.75", 0.25),
        ("d 0.5\nTr 0.25", 0.5),
        ("d 0.5\nillum 2\nNi 1.5", 0.5),
        ("d -halo 0.5", 0.5),
        ("d 0.5\nTf 1 1 1", 0.5),
        ("d 0.5\nTf 0 0 0\nNi 1.5", 0.5),
        // 3ds Max: Tf is a copy of d
        ("Ni 1.5\nd 0.25\nTr 0.75\nTf 0.25 0.25 0.25\nillum 2", 0.25),
    ] {
        let m = material(&format!("Kd 1 0.5 0\n{mtl}"));
        assert_eq!((m.kind, m.alpha_mode), (MaterialKind::MetallicRoughness, AlphaMode::Blend), "{mtl}");
        assert_eq!(m.base_color, Vec4::new(1.0, 0.5, 0.0, alpha), "{mtl}");
    }
    for glass in [
        "illum 7\nTf 0.1 0.1 0.1",
        "illum 4",
        "illum 6\nd 0.5",
        "illum 9\nNi 1.3",
        "Tf 0.9 0.9 0.9\nNi 1.5",
        "d 0\nTf 1 1 1\nNi 1.5\nillum 2",
    ] {
        let m = material(glass);
        assert_eq!((m.kind, m.alpha_mode, m.base_color.w), (MaterialKind::Glass, AlphaMode::Opaque, 1.0), "{glass}");
    }
    // what 3ds Max and Maya write of every opaque surface
    for opaque in ["Ni 1.5\nd 1\nTr 0\nTf 1 1 1\nillum 2", "illum 4\nKd 0.5 0.5 0.5\nTf 1.00 1.00 1.00\nNi 1.00"] {
        assert_eq!(
            (material(opaque).kind, material(opaque).alpha_mode),
            (MaterialKind::MetallicRoughness, AlphaMode::Opaque)
        );
    }
    assert_eq!(material("Kd 0 0 0\nKs 0.95 0.95 0.95\nillum 5").kind, MaterialKind::Mirror);
    // a library in which all is hidden has d for Tr; one in which something shows has not
    for hidden in ["Tr 1", "d 0", "d -1"] {
        let scene = with_mtl(&folder, &format!("newmtl m\n{hidden}\nnewmtl n\nTr 0\n"));
        assert_eq!((scene.materials[0].alpha_mode, scene.materials[0].base_color.w), (AlphaMode::Blend, 0.0));
        let scene = with_mtl(&folder, &format!("newmtl m\n{hidden}\nnewmtl n\nillum 1\nd 0\n"));
        assert!(scene.materials.iter().all(|m| m.alpha_mode == AlphaMode::Opaque), "{hidden}");
        let warnings = &scene.report.warnings;
        assert!(warnings.iter().any(|w| w.contains("would hide every material")), "{warnings:?}");
    }
}

/// Exporters that write `d` for glass have a setting, which can be changed at any time.
#[test]
fn dissolve_as_glass() {
    use skylit::scene::settings::{MtlDissolve, SceneSettings};
    let folder = Folder::new();
    let mut scene = with_mtl(&folder, "newmtl m\nKd 1 0 0\nd 0.5\nTf 0.5 0.5 0.5\nnewmtl n\nnewmtl k\nillum 7\n");
    let before = scene.materials.clone();
    let glass = SceneSettings { mtl_dissolve: Some(MtlDissolve::Glass), ..Default::default() };
    assert!(glass.apply(&mut scene).unwrap() && !glass.apply(&mut scene).unwrap());
    let m = &scene.materials[0];
    assert_eq!(
        (m.kind, m.alpha_mode, m.base_color.w, m.transmission.factor),
        (MaterialKind::Glass, AlphaMode::Opaque, 1.0, 1.0)
    );
    assert_eq!((m.transmittance, &scene.materials[1..]), (Vec3::splat(0.5), &before[1..]));
    assert!(SceneSettings::default().apply(&mut scene).unwrap());
    assert_eq!(scene.materials, before);
}

#[test]
fn textures_are_found_where_they_may_lie() {
    let folder = Folder::new();
    folder.write("proj/scene/a.obj", "mtllib models/lib/a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n");
    folder.write("proj/lib/a.mtl", "newmtl m\nmap_Kd -clamp on models\\tex\\wood bark.png\nmap_Ke gone.png\n");
    folder.write("proj/tex/wood bark.png", png(2, 2, [10, 20, 30, 40]));
    let scene = load(&folder.path("proj/scene/a.obj")).unwrap();
    let m = &scene.materials[0];
    let texture = &scene.textures[m.base_color_texture.unwrap().texture];
    assert_eq!((texture.wrap, texture.width), ([Wrap::Clamp; 2], 2));
    assert_eq!((m.alpha_mode, m.emissive_texture), (AlphaMode::Opaque, None));
    assert!(scene.report.warnings[0].contains("gone.png"), "{:?}", scene.report.warnings);
}

/// Paths of other machines, and names that are not spelled as on this disk.
#[test]
fn textures_with_names_of_other_machines() {
    let folder = Folder::new();
    for name in ["t.png", "maps/wood bark.png", "100%.png", "Gr\u{fc}n.png", "sharp #1.png"] {
        folder.write(name, png(1, 1, [10, 20, 30, 255]));
    }
    for name in [
        "C:\\Users\\me\\maps\\t.png",
        "/home/someone/t.png",
        "\\\\server\\share\\maps\\wood bark.png",
        "D:/project/maps/wood bark.png",
        "elsewhere/t.png",
        "..\\..\\textures\\t.png",
        "T.PNG",
        "MAPS\\Wood Bark.PNG",
        "maps/wood%20bark.png",
        "\"maps/wood bark.png\"",
        "100%.png",
        "gr\u{fc}n.png",
        "sharp #1.png",
        "t.png # the bark",
        "-bm 1 -o 0 0 0 -s 1 1 1 maps/wood bark.png",
        "./t.png",
    ] {
        let scene = with_mtl(&folder, &format!("newmtl m\nmap_Kd {name}\n"));
        assert!(scene.report.warnings.is_empty() && scene.textures.len() == 1, "{name}: {:?}", scene.report.warnings);
    }
    let scene = with_mtl(&folder, "newmtl m\nmap_Kd C:\\me\\other.png\n");
    assert!(
        scene.report.warnings[0].contains("the texture `C:\\me\\other.png` was not found in"),
        "{:?}",
        scene.report.warnings
    );
}

#[test]
fn opacity_maps() {
    let folder = Folder::new();
    folder.write("color.png", png(4, 4, [10, 20, 30, 255]));
    folder.write("alpha.png", png(2, 8, [200, 200, 200, 255]));
    folder.write("holes.png", png(2, 2, [0, 0, 0, 255]));
    let scene = with_mtl(&folder, "newmtl m\nKd 1 1 1\nd 0.9\nmap_Kd color.png\nmap_d alpha.png\n");
    let m = &scene.materials[0];
    assert_eq!((m.alpha_mode, m.kind, m.base_color.w), (AlphaMode::Blend, MaterialKind::MetallicRoughness, 0.9));
    let texture = &scene.textures[m.base_color_texture.unwrap().texture];
    assert_eq!((texture.width, texture.height), (4, 8));
    assert!(texture.texels.as_bytes().chunks(4).all(|p| p == [10, 20, 30, 200]));
    let scene = with_mtl(&folder, "newmtl m\nmap_d alpha.png\n");
    let m = &scene.materials[0];
    assert_eq!((m.alpha_mode, m.base_color.w), (AlphaMode::Blend, 1.0));
    let texture = &scene.textures[m.base_color_texture.unwrap().texture];
    assert!(texture.texels.as_bytes().chunks(4).all(|p| p == [255, 255, 255, 200]));
    // yes or no is a mask, as leaves have it
    let scene = with_mtl(&folder, "newmtl m\nmap_Kd color.png\nmap_d holes.png\n");
    assert_eq!(scene.materials[0].alpha_mode, AlphaMode::Mask { cutoff: 0.5 });
}

/// Maps are used, or named.
#[test]
fn maps_of_surfaces() {
    let folder = Folder::new();
    folder.write("half.png", png(1, 1, [128, 128, 128, 255]));
    folder.write("dark.png", png(2, 1, [51, 51, 51, 255]));
    folder.write("normals.png", png(1, 1, [128, 128, 255, 255]));
    let scene = with_mtl(&folder, "newmtl m\nPr 0.5\nmap_Pr half.png\nmap_Pm dark.png\nmap_Bump -bm 0.5 normals.png\n");
    let m = &scene.materials[0];
    assert_eq!((m.roughness, m.metallic, m.normal_scale), (0.5, 1.0, 0.5));
    let texels = |slot: Option<skylit::scene::TextureSlot>| scene.textures[slot.unwrap().texture].texels.as_bytes();
    assert_eq!(texels(m.metallic_roughness_texture), [255, 128, 51, 255, 255, 128, 51, 255]);
    assert_eq!(texels(m.normal_texture), [128, 128, 255, 255]);
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
    // exponents: 51 / 255 of 1000
    let scene = with_mtl(&folder, "newmtl m\nKs 1 1 1\nNs 1000\nmap_Ns dark.png\n");
    let m = &scene.materials[0];
    let expected = ((2.0f32 / 202.0).powf(0.25) * 255.0).round() as u8;
    assert_eq!((m.roughness, scene.textures[0].texels.as_bytes()[1]), (1.0, expected));
    // -mm is a base and a gain
    let scene = with_mtl(&folder, "newmtl m\nKd 1 1 1\nmap_Kd -mm 0.2 0.5 dark.png\nmap_Ke half.png\n");
    assert_eq!(scene.textures[0].texels.as_bytes()[..4], [77, 77, 77, 255]);
    assert_eq!(scene.materials[0].emissive, Vec3::ONE);
    // what is not used is named, and what says nothing new is not
    let scene = with_mtl(
        &folder,
        "newmtl m\nmap_Ka half.png\nmap_Kd half.png\nmap_Ks s.png\nmap_Ns n.png\nrefl -type sphere r.png\ndisp h.png\n\
         decal d.png\nmap_refl r.png\nbump -bm 2 half.png\nmap_RMA x.png\nmap_aat on\n",
    );
    let said = scene.report.warnings.join("\n");
    for key in ["`s.png` was", "map_Ns is", "refl is", "disp is", "decal is", "map_refl is", "map_RMA is"] {
        assert!(said.contains(&format!("{key} not")), "{key}: {said}");
    }
    assert!(!said.contains("map_Ka") && !said.contains("map_aat"), "{said}");
}

#[test]
fn what_is_missing_is_said() {
    let folder = Folder::new();
    let scene = folder.load("b.obj", "mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl x\nf 1 2 3\n").unwrap();
    assert!(scene.report.warnings[0].contains("gone.mtl") && scene.report.warnings.len() == 1);
    assert_eq!(scene.materials[0].name, "x");
    let scene = with_mtl(&folder, "newmtl n\nKd 1 2\n");
    assert_eq!(scene.report.warnings.len(), 2, "{:?}", scene.report.warnings);
    assert!(scene.report.warnings[0].contains("a.mtl, line 2"), "{:?}", scene.report.warnings);
}

#[test]
fn other_encodings_and_line_ends() {
    let scene = Folder::new().load("a.OBJ", b"o caf\xe9\r\nv 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n").unwrap();
    assert_eq!(scene.triangle_count(), 1);
}

/// The layers of Blender's and other programs' MTL files.
#[test]
fn clearcoat_sheen_and_anisotropy() {
    let folder = Folder::new();
    folder.write("a.mtl", "newmtl layers\nKd 1 0 0\nPr 0.4\nPc 0.75\nPcr 0.25\nPs 0.5\naniso 0.8\nanisor 0.25\nnewmtl none\nPc 0\nPs 0\naniso 0\n");
    let text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl layers\nf 1 2 3\nusemtl none\nf 1 2 3\n";
    let scene = folder.load("a.obj", text).unwrap();
    let material = |name: &str| scene.materials.iter().find(|m| m.name == name).unwrap().clone();
    let layers = material("layers");
    assert_eq!((layers.clearcoat.factor, layers.clearcoat.roughness), (0.75, 0.25));
    assert_eq!((layers.sheen.color, layers.sheen.roughness), (glam::Vec3::splat(0.5), 0.5));
    assert_eq!((layers.anisotropy.strength, layers.anisotropy.rotation), (0.8, std::f32::consts::FRAC_PI_2));
    let none = material("none");
    assert_eq!((none.clearcoat, none.sheen, none.anisotropy), Default::default());
}

/// What a file says and nobody shows is named with how often it is said.
#[test]
fn statements_that_are_not_used() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2\n#comment\nl 2 3\np 1\nwibble 7\n\nf 1 2 3\ncstype bspline\nwobble\nwibble 8\n";
    let scene = Folder::new().load("a.obj", text).unwrap();
    let expected = [
        "statements of the .obj about points, lines, curves or their display are not used: cstype (1), l (2), p (1)",
        "3 lines of the .obj begin with a word that is no statement of the format, and are not used: `wibble` (line 8), `wobble` (line 12)",
    ];
    assert_eq!(scene.report.warnings, expected);
    let scene = Folder::new().load("a.obj", "s off\no a\ng b\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
}

/// The normals of a material's normal map, row by row, of unit length up to the texels' rounding.
fn normals_of(scene: &Scene) -> Vec<Vec3> {
    let slot = scene.materials[0].normal_texture.unwrap();
    let texels = &scene.textures[slot.texture].texels;
    texels.iter().map(|[x, y, z, _]| 2.0 * Vec3::new(x, y, z) - 1.0).collect()
}

/// A ramp has the normal of its slope: a height of 1 is one texel, and `-bm` multiplies it.
#[test]
fn heights_become_normals() {
    let folder = Folder::new();
    let grey = |v: u32| [v as u8, v as u8, v as u8, 255];
    folder.write("right.png", png_of(8, 4, |x, _| grey(16 * x)));
    folder.write("down.png", png_of(4, 8, |_, y| grey(16 * y)));
    folder.write("alpha.png", png_of(8, 4, |x, y| [200, (31 * y) as u8, 10, (16 * x) as u8]));
    let check = |mtl: &str, expected: &dyn Fn(usize) -> Vec3| {
        let scene = with_mtl(&folder, &format!("newmtl m\n{mtl}\n"));
        assert!(scene.report.warnings.is_empty(), "{mtl}: {:?}", scene.report.warnings);
        for (i, normal) in normals_of(&scene).into_iter().enumerate() {
            assert!(normal.abs_diff_eq(expected(i).normalize(), 1e-4), "{mtl}, texel {i}: {normal}");
        }
        scene.materials[0].normal_scale
    };
    // higher to the right: it leans to the left, everywhere where the border is clamped
    let slope = 16.0 / 255.0;
    for key in ["bump", "map_Bump", "map_bump"] {
        assert_eq!(check(&format!("{key} -clamp on -bm 3 right.png"), &|_| Vec3::new(-slope, 0.0, 1.0)), 3.0);
    }
    // higher downwards: it leans up, which is green above a half
    assert_eq!(check("bump -clamp on down.png", &|_| Vec3::new(0.0, slope, 1.0)), 1.0);
    // where it repeats, the border falls to the other side: by 7 steps over two texels, one of them up
    let repeated = |i: usize| Vec3::new(if matches!(i % 8, 0 | 7) { 3.0 * slope } else { -slope }, 0.0, 1.0);
    check("map_Bump right.png", &repeated);
    // the range of -mm, and the channel of -imfchan
    check("map_Bump -clamp on -mm 0.2 0.5 right.png", &|_| Vec3::new(-0.5 * slope, 0.0, 1.0));
    check("map_Bump -clamp on -imfchan m alpha.png", &|_| Vec3::new(-slope, 0.0, 1.0));
    // two materials with one map share its texels, whatever their -bm
    let scene = with_mtl(&folder, "newmtl m\nbump right.png\nnewmtl n\nbump -bm 2 right.png\n");
    assert_eq!((scene.textures.len(), scene.materials[1].normal_scale), (1, 2.0));
    // a single texel has no slope
    folder.write("one.png", png(1, 1, [77, 77, 77, 255]));
    check("map_Bump one.png", &|_| Vec3::Z);
    check("map_Bump -clamp on one.png", &|_| Vec3::Z);
}

/// Maps of specular colour, sheen, clearcoat and anisotropy.
#[test]
fn maps_of_layers() {
    let folder = Folder::new();
    folder.write("half.png", png(2, 2, [128, 64, 32, 255]));
    let maps = "map_Ks half.png\nmap_Ps half.png\nmap_Pc half.png\nmap_Pcr -imfchan g half.png\nmap_aniso half.png\n";
    let scene = with_mtl(&folder, &format!("newmtl m\n{maps}"));
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
    let m = &scene.materials[0];
    let texels = |slot: Option<skylit::scene::TextureSlot>| &scene.textures[slot.unwrap().texture].texels;
    // factors that are missing leave it to the map
    assert_eq!((m.sheen.color, m.sheen.roughness), (Vec3::ONE, 0.5));
    assert_eq!((m.clearcoat.factor, m.clearcoat.roughness, m.anisotropy.strength), (1.0, 1.0, 1.0));
    // a colour stays sRGB, a number that is read as sRGB comes out as it was
    assert_eq!(texels(m.specular.color_texture).get(0)[..3], [128.0 / 255.0, 64.0 / 255.0, 32.0 / 255.0]);
    let sheen = texels(m.sheen.color_texture).decode_srgb(3);
    assert!(sheen[..3].iter().all(|v| (v - 128.0 / 255.0).abs() < 2e-3), "{sheen:?}");
    assert_eq!(texels(m.clearcoat.texture).get(0)[0], 128.0 / 255.0);
    assert_eq!(texels(m.clearcoat.roughness_texture).get(0)[1], 64.0 / 255.0);
    // the direction of anisotropy is the tangent, its strength is blue
    let [x, y, strength, _] = texels(m.anisotropy.texture).get(0);
    assert_eq!((x, (y - 0.5).abs() < 2e-3, strength), (1.0, true, 128.0 / 255.0));
    // factors that are there are multiplied by the map
    let scene = with_mtl(&folder, &format!("newmtl m\nPs 0.5\nPc 0.25\nPcr 0.75\naniso 0.5\nNs 100\n{maps}"));
    let m = &scene.materials[0];
    assert_eq!((m.sheen.color, m.clearcoat.factor, m.clearcoat.roughness), (Vec3::splat(0.5), 0.25, 0.75));
    assert_eq!((m.anisotropy.strength, m.roughness < 0.5), (0.5, true));
    // a mirror and glass have no such layers
    let scene = with_mtl(&folder, &format!("newmtl m\nillum 7\n{maps}"));
    let said = scene.report.warnings.join("\n");
    for key in ["map_Ks", "map_Ps", "map_Pc", "map_Pcr", "map_aniso"] {
        assert!(said.contains(&format!("{key} of a mirror or glass is not used")), "{key}: {said}");
    }
    assert!(scene.textures.is_empty());
}

/// A cube of eight vertices, two of whose sides are of another material.
const CUBE: &str = "v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\nvn 1 0 0\n\
    f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nusemtl other\nf 2 3 7 6\nf 1 5 8 4\n";

/// Normals by an angle, whatever the file says of them.
#[test]
fn normals_by_an_angle() {
    let folder = Folder::new();
    let path = folder.write("a.obj", CUBE);
    let outwards = |p: Vec3| p.normalize();
    // all corners are alike: the mean by angle is the diagonal, also where the materials meet
    for normals in ["smooth", "90.001"] {
        let scene = load_vertices(&path, normals, None);
        assert_eq!((scene.report.normals_replaced, scene.report.normals_computed), (2, 0));
        for m in [mesh(&scene, 0), mesh(&scene, 1)] {
            assert_eq!(m.positions.len(), 8, "{normals}");
            for (p, n) in m.positions.iter().zip(&m.normals) {
                assert!(n.abs_diff_eq(outwards(*p), 1e-6), "{normals}: {p} {n}");
            }
        }
    }
    // below a right angle each side is flat, with corners of its own
    let scene = load_vertices(&path, "89", None);
    let m = mesh(&scene, 0);
    assert_eq!((m.positions.len(), m.indices.len()), (16, 8));
    for t in &m.indices {
        let [a, b, c] = t.map(|i| m.positions[i as usize]);
        let normal = (b - a).cross(c - a).normalize();
        assert!(t.iter().all(|i| m.normals[*i as usize].abs_diff_eq(normal, 1e-6)));
    }
    // the normals of the file go, and its smoothing groups count for nothing
    let wrong = folder.write("b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 1 0 0\ns 1\nf 1//1 2//1 3//1\nf 1 4 2\n");
    assert_eq!(mesh(&load_vertices(&wrong, "file", None), 0).normals[0], Vec3::X);
    assert!(mesh(&load_vertices(&wrong, "flat", None), 0).normals.is_empty());
    let m = load_vertices(&wrong, "10", None);
    assert!(mesh(&m, 0).normals.iter().all(|n| *n == Vec3::Z || *n == Vec3::Y), "{:?}", mesh(&m, 0).normals);
    // a sheet of paper, modelled from both sides, stays two sheets
    let sheet = folder.write("c.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nf 4 3 2 1\n");
    let scene = load_vertices(&sheet, "smooth", None);
    let m = mesh(&scene, 0);
    for t in &m.indices {
        let [a, b, c] = t.map(|i| m.positions[i as usize]);
        let side = (b - a).cross(c - a);
        assert!(t.iter().all(|i| m.normals[*i as usize].dot(side) > 0.99), "{:?}", m.normals);
    }
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
    for odd in ["181", "-1", "nan", "rough", ""] {
        assert!(odd.parse::<skylit::scene::load::NormalSource>().is_err(), "{odd}");
    }
}

/// Meshes without texture coordinates get some where a texture needs them, and are named where not.
#[test]
fn projected_texture_coordinates() {
    use skylit::scene::load::Projection;
    let folder = Folder::new();
    folder.write("t.png", png(2, 2, [10, 20, 30, 255]));
    folder.write("a.mtl", "newmtl m\nmap_Kd t.png\nnewmtl plain\n");
    // an octahedron twice as high as wide, and a triangle whose material has no texture
    let shape = "v 1 0 0\nv 0 2 0\nv 0 0 1\nv -1 0 0\nv 0 -2 0\nv 0 0 -1\n";
    let faces = "f 1 2 3\nf 3 2 4\nf 4 2 6\nf 6 2 1\nf 3 5 1\nf 4 5 3\nf 6 5 4\nf 1 5 6\n";
    let text = format!("mtllib a.mtl\n{shape}o ball\nusemtl m\n{faces}o other\nusemtl plain\nf 1 2 3\n");
    let path = folder.write("a.obj", &text);
    let scene = load_vertices(&path, "file", None);
    let expected =
        "mesh `ball`: has no texture coordinates 0, which textures of its material `m` use: taken as zero; --uv box";
    assert!(scene.report.warnings[0].starts_with(expected), "{:?}", scene.report.warnings);
    assert_eq!((scene.report.warnings.len(), scene.report.texcoords_projected), (1, 0));

    // where each vertex may be on the image
    let found = |projection, at: [f32; 3]| {
        let scene = load_vertices(&path, "file", Some(projection));
        assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
        assert_eq!((scene.report.texcoords_projected, mesh(&scene, 1).texcoords[0].len()), (1, 0));
        let m = mesh(&scene, 0);
        assert_eq!(m.texcoords[0].len(), m.positions.len());
        let of_vertex = m.positions.iter().zip(&m.texcoords[0]).filter(|(p, _)| p.to_array() == at);
        let mut found: Vec<[f32; 2]> = of_vertex.map(|(_, t)| t.to_array().map(|x| (1e4 * x).round() / 1e4)).collect();
        found.sort_by(|a, b| a.partial_cmp(b).unwrap());
        found
    };
    use Projection::{Box as Cube, Cylindrical, Spherical};
    for projection in [Spherical, Cylindrical] {
        assert_eq!(found(projection, [0.0, 0.0, 1.0]), [[0.5, 0.5]]);
        assert_eq!(found(projection, [1.0, 0.0, 0.0]), [[0.75, 0.5]]);
        assert_eq!(found(projection, [-1.0, 0.0, 0.0]), [[0.25, 0.5]]);
        // at the seam it is at both ends of the image
        assert_eq!(found(projection, [0.0, 0.0, -1.0]), [[0.0, 0.5], [1.0, 0.5]]);
        // a pole is where the triangle is: in the middle of each of the four quarters
        let top = [[0.125, 0.0], [0.375, 0.0], [0.625, 0.0], [0.875, 0.0]];
        assert_eq!(found(projection, [0.0, 2.0, 0.0]), top);
    }
    // faces of an octahedron this high lean to x and z equally: the first of both counts
    let box_at_top = found(Cube, [0.0, 2.0, 0.0]);
    assert!(box_at_top.iter().all(|[u, v]| *u == 0.5 && *v == 0.0), "{box_at_top:?}");
    assert_eq!(found(Cube, [0.0, 0.0, 1.0]), [[0.25, 0.5], [0.75, 0.5]]);
    // coordinates of the file stay
    let text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5 0.5\nusemtl m\nf 1/1 2/1 3/1\n";
    let scene = load_vertices(&folder.write("b.obj", text), "file", Some(Spherical));
    assert_eq!((mesh(&scene, 0).texcoords[0][0], scene.report.texcoords_projected), (Vec2::splat(0.5), 0));
}

/// Objects are above their groups, and groups above their runs of one material.
#[test]
fn objects_and_groups_are_nodes() {
    let folder = Folder::new();
    let run = |statements: &str| format!("{statements}\nf 1 2 3\n");
    let text = [
        "g ground",
        "o car",
        "g wheel",
        "usemtl rubber",
        "g door",
        "o house\ng door",
        "usemtl wood",
        "o house\ng roof",
    ];
    let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{}", text.map(run).concat());
    let scene = folder.load("a.obj", text).unwrap();
    let names: Vec<&str> = scene.instances.iter().map(|i| i.name.as_str()).collect();
    assert_eq!(names, ["ground", "car", "wheel", "wheel", "door", "door", "door", "roof"]);
    let nodes: Vec<_> = scene.nodes.iter().map(|node| (&*node.name, node.parent(), node.instances())).collect();
    let expected = [("car", None, 1..5), ("wheel", Some(0), 2..4), ("house", None, 5..8), ("door", Some(2), 5..7)];
    assert_eq!(nodes, expected);
}
