//! `.brhan` text scenes.

use glam::{DVec3, Vec3};
use skylit::scene::material::MaterialKind;
use skylit::scene::{Geometry, Projection, Sphere};

use crate::build::*;

const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

fn error(text: &str) -> String {
    let folder = Folder::new();
    folder.write("models/m.obj", OBJ);
    let text = folder.load("a.brhan", text).map(|_| ()).unwrap_err().to_string();
    assert!(!text.contains('\n'), "{text}");
    text
}

#[test]
fn everything() {
    let folder = Folder::new();
    folder.write("Dir/m.obj", OBJ);
    let text = "# comment\n\
        Camera position[1 2 3] view_direction[0 0 -2] vertical_fov[90] width[640] height[480] # more\n\n\
        Integrator type[path] spp[16] max_depth[4]\n\
        Model file[models/Dir/m.obj]\n\
        Model file[models/Dir/m.obj] translate[10 0 0] rotate[0 0 90] scale[2 3 4] material[copper] specular[0.3 0.2 0.1]\n\
        Model file[models/Dir/m.obj] material[copper] specular[0.3 0.2 0.1]\n\
        Sphere center[0 1 0] radius[0.5] material[glass] reflectance[1 1 1] transmittance[1 0.5 1]\n\
        SphericalLight center[0 9 0] radius[2] emittance[10 5 1]\n\
        SaveIntervals[4 8]\nGenDepthImage[true]\n";
    folder.write("scenes/a.brhan", text);
    let scene = load(&folder.path("scenes/a.brhan")).unwrap();

    let camera = &scene.cameras[0];
    assert_eq!(camera.projection, Projection::Perspective { fov_y: std::f64::consts::FRAC_PI_2 });
    assert_eq!(camera.camera_to_world.translation, DVec3::new(1.0, 2.0, 3.0));
    assert_eq!(camera.camera_to_world.matrix3.z_axis, DVec3::Z);
    assert_eq!(camera.aspect, Some(640.0 / 480.0));
    let hints = &scene.hints;
    assert_eq!((hints.size, hints.spp, hints.max_depth), (Some([640, 480]), Some(16), Some(4)));
    assert_eq!((&hints.save_intervals[..], hints.depth_image), (&[4, 8][..], true));

    // the second copper model is the first one again
    assert_eq!((scene.meshes.len(), scene.instances.len()), (4, 5));
    assert_eq!(scene.instances[1].mesh, scene.instances[2].mesh);
    // scaled, turned, moved
    let p = scene.instances[1].object_to_world.transform_point3(DVec3::X);
    assert!((p - DVec3::new(10.0, 2.0, 0.0)).length() < 1e-12, "{p}");
    let material = |i: usize| &scene.materials[scene.meshes[scene.instances[i].mesh].material];
    assert_eq!((material(1).kind, material(1).specular_color), (MaterialKind::Copper, Vec3::new(0.3, 0.2, 0.1)));
    assert_eq!((material(3).kind, material(3).transmittance), (MaterialKind::Glass, Vec3::new(1.0, 0.5, 1.0)));
    let spheres = |i: usize| match &scene.meshes[scene.instances[i].mesh].geometry {
        Geometry::Spheres(s) => s[0],
        Geometry::Triangles(_) => panic!(),
    };
    assert_eq!(spheres(3), Sphere { center: Vec3::Y, radius: 0.5 });
    // a light is a sphere that emits, and counted once
    assert_eq!((spheres(4).radius, material(4).emissive), (2.0, Vec3::new(10.0, 5.0, 1.0)));
    assert!(scene.lights.is_empty());
    // each model is a node
    let nodes: Vec<_> = scene.nodes.iter().map(|node| (&*node.name, node.instances())).collect();
    assert_eq!(nodes, [("m.obj", 0..1), ("m.obj", 1..2), ("m.obj", 2..3)]);
    assert_eq!((scene.triangle_count(), scene.sphere_count()), (3, 2));
}

#[test]
fn rotation_order() {
    let folder = Folder::new();
    folder.write("m.obj", OBJ);
    let scene = folder.load("a.brhan", "Model file[m.obj] rotate[90 90 0]\n").unwrap();
    // about x first: y -> z, then about y: z -> x
    let p = scene.instances[0].object_to_world.transform_vector3(DVec3::Y);
    assert!((p - DVec3::X).length() < 1e-12, "{p}");
}

#[test]
fn materials_by_name() {
    let folder = Folder::new();
    let names = [
        ("matte", MaterialKind::Matte),
        ("mirror", MaterialKind::Mirror),
        ("glass", MaterialKind::Glass),
        ("copper", MaterialKind::Copper),
        ("gold", MaterialKind::Gold),
    ];
    for (name, kind) in names {
        let scene = folder.load("a.brhan", format!("Sphere material[{name}] diffuse[0.5 0.25 1]\n")).unwrap();
        assert_eq!((scene.materials[0].kind, scene.materials[0].base_color.y), (kind, 0.25));
    }
}

#[test]
fn a_missing_model_is_named_with_its_line() {
    let text = error("# first\nModel file[models/Gone/gone.obj]\n");
    assert!(text.contains("a.brhan: line 2: the model models/Gone/gone.obj does not exist; searched in /"), "{text}");
}

#[test]
fn errors_name_the_line() {
    assert!(error("\nCamra position[0 0 0]").contains("line 2: unknown key `Camra`"));
    assert!(error("Camera positon[0 0 0]").contains("unknown field `positon`"));
    assert!(error("Camera position[0 0]").contains("line 1: Camera: position[0 0]: three numbers expected"));
    assert!(error("Camera position[0 0 nan]").contains("three numbers"));
    assert!(error("Camera vertical_fov[x]").contains("one number"));
    assert!(error("Camera vertical_fov[180]").contains("between 0 and 180"));
    assert!(error("Camera view_direction[0 0 0]").contains("zero"));
    assert!(error("Camera position[0 0 0").contains("not closed"));
    assert!(error("Camera width[-3]").contains("whole number"));
    assert!(error("Camera position").contains("no values"));
    assert!(error("Integrator spp[1.5]").contains("whole number"));
    assert!(error("Sphere radius[0]").contains("above zero"));
    assert!(error("Sphere radius[1] material[jade]").contains("unknown material `jade`"));
    assert!(error("Model scale[1 1 1]").contains("file[] is missing"));
    assert!(error("SaveIntervals[a]").contains("`a` is not a number"));
    assert!(error("GenDepthImage[maybe]").contains("true or false"));
    assert!(error("Model file[m.obj] scale[1 1 one]").contains("line 1"));
    // what is wrong in the model is said of the model
    let folder = Folder::new();
    folder.write("m.obj", "v 0 0 nan\n");
    let text = folder.load("a.brhan", "Model file[m.obj]").map(|_| ()).unwrap_err().to_string();
    assert!(text.contains("m.obj: line 1"), "{text}");
}

/// Eight digits are kept, whatever the text is encoded in and its lines end with.
#[test]
fn far_from_the_origin() {
    let folder = Folder::new();
    folder.write("m.obj", OBJ);
    let text = "Sphere center[448262.387 35.5 -5411932.75] radius[0.1]\rModel file[M.obj] translate[448262.387 35.5 -5411932.75]\r";
    let scene = folder.load("a.brhan", format!("\u{feff}{text}")).unwrap();
    let place = DVec3::new(448_262.387, 35.5, -5_411_932.75);
    for instance in &scene.instances {
        let centre = instance.object_to_world.transform_point3(DVec3::ZERO);
        assert!((centre - place).length() < 1e-9, "{centre}");
    }
    let Geometry::Spheres(spheres) = &scene.meshes[0].geometry else { panic!() };
    assert_eq!(spheres[0].center, Vec3::ZERO);
    assert!(scene.report.warnings.is_empty(), "{:?}", scene.report.warnings);
}
