//! Text of the shaders that records are declared by.

use skylit::interface::glsl::files;

/// A file by its name.
fn text(name: &str) -> String {
    files().into_iter().find(|f| f.0 == format!("interface/{name}.glsl")).unwrap().1
}

#[test]
fn records_are_structs_and_buffers() {
    let queue = text("queue");
    assert!(queue.contains("struct QueueRecord {\n    uvec2 rays;  // "), "{queue}");
    assert!(queue.contains("const uint QUEUE_RECORD_BYTES = 24u;"), "{queue}");
    let scene = text("scene");
    assert!(scene.contains("readonly buffer InstanceRecords { InstanceRecord v[]; };"), "{scene}");
    assert!(scene.contains("    vec4 group_to_world[3];"), "{scene}");
    assert!(scene.contains("uvec2 w11 = LOAD_PAIR(base, 12u * k + 11u);"), "{scene}");
    assert!(scene.contains("    return SubmeshRecord(uvec2(w0.x, w0.y), "), "{scene}");
    assert!(
        text("lights")
            .contains("LightRecord(vec3(uintBitsToFloat(w0.x), uintBitsToFloat(w0.y), uintBitsToFloat(w1.x)), float(")
    );
    // a record with others in it
    assert!(!text("shading").contains("load_"));
    assert!(text("ao").starts_with("// Generated from") && text("ao").contains("#include \"interface/queue.glsl\"\n"));
    assert!(text("ray").contains("layout(push_constant) uniform Push {"));
}

#[test]
fn words_are_named() {
    let hierarchy = text("hierarchy");
    for line in [
        "#define WIDE_NODE_CORNER(T) T(w0, w1.x)",
        "#define WIDE_NODE_FIRST_CHILD w1.y",
        "#define WIDE_NODE_UPPER_Z w7",
        "#define TRIANGLE_LEAF_CORNERS_1(T) T(w1.y, w2)",
        "#define TRIANGLE_LEAF_PRIMITIVES w6",
        "#define INSTANCE_LEAF_WORLD_TO_GROUP_2(T) T(w4, w5)",
        "#define BLOCK_FLAGS w7.y",
        "#define LAUNCH_HIT_UV(T) T(w1.y, w2.x)",
        "const uint LAUNCH_HIT_PAIRS = 3u;",
    ] {
        assert!(hierarchy.contains(line), "{line}\n{hierarchy}");
    }
}
