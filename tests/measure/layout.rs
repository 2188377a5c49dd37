//! Records that lie elsewhere in SPIR-V than in Rust are named.

use skylit::interface::layout::{Field, Form, Record, Reflected, mismatches};

const RIGHT: Record = Record {
    name: "Sphere",
    form: Form::Array { buffer: "Spheres", access: "readonly", align: 16 },
    size: 16,
    fields: &[
        Field { name: "center", kind: "vec3", counts: &[], offset: 0, size: 12, doc: &[] },
        Field { name: "radius", kind: "float", counts: &[], offset: 12, size: 4, doc: &[] },
    ],
    doc: &[],
};

fn reflected() -> Reflected {
    Reflected {
        name: "Sphere".into(),
        members: vec![("center".into(), 0, 12), ("radius".into(), 12, 4)],
        stride: Some(16),
    }
}

#[test]
fn equal_layouts_are_accepted() {
    assert_eq!(mismatches([&RIGHT], &[reflected()]), [""; 0]);
}

#[test]
fn layout_mismatches_are_named() {
    let fields = &[
        Field { name: "radius", kind: "float", counts: &[], offset: 0, size: 4, doc: &[] },
        Field { name: "center", kind: "vec3", counts: &[], offset: 4, size: 12, doc: &[] },
    ];
    let swapped = mismatches([&Record { fields, ..RIGHT }], &[reflected()]);
    assert_eq!(
        swapped,
        ["record Sphere: field radius is 4 bytes at offset 0 in Rust, center is 12 bytes at offset 0 in SPIR-V"]
    );
    let larger = mismatches([&Record { size: 20, ..RIGHT }], &[reflected()]);
    assert_eq!(larger, ["record Sphere: 20 bytes in Rust, 16 bytes from one to the next in SPIR-V"]);
    let longer = mismatches([&RIGHT], &[Reflected { members: vec![], ..reflected() }]);
    assert_eq!(longer, ["record Sphere: 2 fields in Rust, 0 in SPIR-V"]);
    assert_eq!(mismatches([&RIGHT], &[]), ["record Sphere: the check shader has none"]);
}
