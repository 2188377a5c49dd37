//! What the compute tracer's kernels walk: blocks of the wide hierarchy, each a node or a leaf of one of three kinds; nodes of the binary one, and its
//! primitives; and what the wide kernel's launches leave. Records are loaded as pairs of words.

records! {
    "hierarchy" values {
        /// Flag of a primitive's number in its group: its alpha is tested.
        ALPHA_TESTED: uint = 0x8000_0000;
        /// Flag of a primitive's number in its group: it is a sphere.
        SPHERE: uint = 0x4000_0000;
        /// The number below these flags.
        NUMBER: uint = 0x3fff_ffff;
        /// Of `Block.flags`: it is a leaf. Of a reference of the binary hierarchy: likewise.
        LEAF: uint = 0x8000_0000;
        /// Of a reference to an inner node of the binary hierarchy: bits from here on are the axis along which its children lie apart.
        AXIS_SHIFT: uint = 27;
        /// Of such a reference: the node; of one to a leaf: its first primitive.
        NODE_NUMBER: uint = 0x07ff_ffff;
        /// The reference to nothing: the traversal goes on with what is on its stack.
        NEXT: uint = 0x7fff_fffd;
        /// Entries of the wide kernels' stack that are kept in registers.
        STACK_IN_REGISTERS: uint = 6;
        /// Stands where a result will be. Some CPU drivers leave any loop after 65,535 iterations: a ray that this happens to keeps the mark, and is reported
        /// instead of delivering what an earlier launch left there.
        UNFINISHED: uint = 0x7fc0_dead;
    };

    /// A node or a leaf of the wide hierarchy, before its kind is known: a cache line.
    Block: words {
        /// By its kind.
        body: uint[15],
        /// `LEAF` says that it is a leaf; of a node, the last four upper planes along z.
        flags: uint,
    }

    /// A node of the wide hierarchy: boxes of up to seven children, quantized to 8 bits a plane. The eighth byte of each `bytes8` is no plane.
    WideNode: words {
        /// Lower corner of the node.
        corner: vec3,
        /// Block of the first child; the others follow, in the order of their slots.
        first_child: uint,
        /// Lower planes along x of children 0 to 6; then the exponent of the scale along x, biased as a float's.
        lower_x: bytes8,
        /// Upper planes along x; then 0.
        upper_x: bytes8,
        /// Lower planes along y; then the exponent along y.
        lower_y: bytes8,
        /// Upper planes along y; then the mask of slots that hold children.
        upper_y: bytes8,
        /// Lower planes along z; then the exponent along z.
        lower_z: bytes8,
        /// Upper planes along z; then 0: a leaf's flag lies there.
        upper_z: bytes8,
    }

    /// A leaf of the wide hierarchy: one triangle, or two with a common edge.
    TriangleLeaf: words {
        /// The triangles are (0, 1, 2) and (0, 2, 3) of these.
        corners: vec3[4],
        /// Their numbers in the group, with flags; the second may be all ones: there is none.
        primitives: uvec2,
        /// Of each triangle four bits: at which places of (0, 1, 2) and (0, 2, 3) its own second and third corner lie, two bits each.
        order: uint,
        /// `LEAF`.
        flags: uint,
    }

    /// A leaf of the wide hierarchy: a sphere.
    SphereLeaf: words {
        /// In the group's space.
        center: vec3,
        /// In the group's units.
        radius: float,
        /// Zero.
        unused0: uint[8],
        /// Its number in the group, with flags; then all ones.
        primitives: uvec2,
        /// Zero.
        unused1: uint,
        /// `LEAF`.
        flags: uint,
    }

    /// A leaf of the wide hierarchy's top level: an instance.
    InstanceLeaf: words {
        /// Rows.
        world_to_group: vec4[3],
        /// Block of its group's root.
        root: uint,
        /// Index of its `InstanceRecord`.
        instance: uint,
        /// Zero.
        unused: uint,
        /// `LEAF`.
        flags: uint,
    }

    /// An inner node of the binary hierarchy: boxes of both children, and references to them.
    BinaryNode: words {
        /// Lower and upper corner of both children.
        boxes: vec3[2][2],
        /// Bit 31 set: a leaf with count - 1 in bits 27-30 and the first primitive in bits 0-26; otherwise an inner node with the axis of its own children in
        /// bits 27-28 and its number in bits 0-26. Along that axis child 0 is the lower one. A leaf of the top level holds an `InstanceRecord`.
        children: uvec2,
        /// To 64 bytes: one cache line.
        reserved: uvec2,
    }

    /// A triangle of the readable kernels.
    TriangleRecord: words {
        /// In the group's space.
        corners: vec3[3],
        /// Its number in the group, with flags.
        number: uint,
    }

    /// A sphere of the readable kernels, where a `TriangleRecord` might be.
    SphereRecord: words {
        /// In the group's space.
        center: vec3,
        /// In the group's units.
        radius: float,
        /// Zero.
        unused: uint[5],
        /// Its number in the group, with flags.
        number: uint,
    }

    /// A nearest hit between the steps of a launch. Of a miss nothing but `t` is written.
    LaunchHit: words {
        /// Infinite for a miss.
        t: float,
        /// Entry of the top level.
        instance: uint,
        /// In the group.
        primitive: uint,
        /// Barycentric weights of the second and third corner.
        uv: vec2,
        /// To a multiple of 8 bytes.
        reserved: uint,
    }
}
