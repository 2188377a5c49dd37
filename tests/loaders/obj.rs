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
    folder.load("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n").unwrap()
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
                assert_eq!(m.positions[i as usize].to_array(), place(m.texcoords[0][i as usize].into()));
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

/// Text that is no UTF-8 is named for what it is.
#[test]
fn utf_16_is_refused() {
    let folder = Folder::new();
    for mark in [[0xfe, 0xff], [0xff, 0xfe]] {
        let units = "v 0 0 0\nf 1 1 1\n".encode_utf16();
        let text = units.flat_map(|u| if mark[0] == 0xfe { u.to_be_bytes() } else { u.to_le_bytes() });
        let error = folder.load("a.obj", mark.into_iter().chain(text).collect::<Vec<u8>>()).err().unwrap().to_string();
        assert!(error.contains("UTF-16 text; save it as UTF-8"), "{error}");
    }
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

#[test]
fn opacity_in_its_many_spellings() {
    let folder = Folder::new();
    let kind = |mtl: &str| {
        let scene = with_mtl(&folder, &format!("newmtl m\n{mtl}\n"));
        let m = &scene.materials[0];
        assert_eq!((m.alpha_mode, m.base_color.w), (AlphaMode::Opaque, 1.0), "{mtl}");
        m.kind
    };
    for opaque in ["d 1", "d 1\nTr 0", "d 1\nTr 1", "Tr 1", "Tr 0", ""] {
        assert_eq!(kind(opaque), MaterialKind::MetallicRoughness, "{opaque}");
    }
    for glass in ["d 0", "Tr 0.9", "d 0.5\nillum 2", "illum 7\nTf 0.1 0.1 0.1", "d -halo 0.5"] {
        assert_eq!(kind(glass), MaterialKind::Glass, "{glass}");
    }
    assert_eq!(kind("Kd 0 0 0\nKs 0.95 0.95 0.95\nillum 5"), MaterialKind::Mirror);
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

#[test]
fn opacity_maps_become_masks() {
    let folder = Folder::new();
    folder.write("color.png", png(4, 4, [10, 20, 30, 255]));
    folder.write("alpha.png", png(2, 8, [200, 200, 200, 255]));
    let scene = with_mtl(&folder, "newmtl m\nKd 1 1 1\nd 0.9\nmap_Kd color.png\nmap_d alpha.png\n");
    let m = &scene.materials[0];
    assert_eq!((m.alpha_mode, m.kind), (AlphaMode::Mask { cutoff: 0.5 }, MaterialKind::MetallicRoughness));
    let texture = &scene.textures[m.base_color_texture.unwrap().texture];
    assert_eq!((texture.width, texture.height), (4, 8));
    assert!(texture.texels.as_bytes().chunks(4).all(|p| p == [10, 20, 30, 200]));
    let scene = with_mtl(&folder, "newmtl m\nmap_d alpha.png\n");
    let texture = &scene.textures[scene.materials[0].base_color_texture.unwrap().texture];
    assert!(texture.texels.as_bytes().chunks(4).all(|p| p == [255, 255, 255, 200]));
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
