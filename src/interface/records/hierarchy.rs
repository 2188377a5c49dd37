//! The compute tracer's acceleration structures: blocks of the wide BVH, each a node or a leaf of
//! one of three kinds; nodes and primitives of the binary BVH; and the hits of a launch. Records
//! are loaded as pairs of words. A primitive's group is its BLAS.

records! {
    "hierarchy" values {
        /// Flag of a primitive's index in its BLAS: it is alpha tested.
        ALPHA_TESTED: uint = 0x8000_0000;
        /// Flag of a primitive's index in its BLAS: it is a sphere.
        SPHERE: uint = 0x4000_0000;
        /// Mask of the index below these flags.
        NUMBER: uint = 0x3fff_ffff;
        /// Flag of `Block.flags` and of references in the binary BVH: a leaf.
        LEAF: uint = 0x8000_0000;
        /// Binary BVH: first bit of the split axis in a reference to an inner node.
        AXIS_SHIFT: uint = 27;
        /// Binary BVH: mask of an inner node's index or a leaf's first primitive in a reference.
        NODE_NUMBER: uint = 0x07ff_ffff;
        /// The null reference: traversal pops the next one from its stack.
        NEXT: uint = 0x7fff_fffd;
        /// Entries of the wide kernels' traversal stack that are kept in registers.
        STACK_IN_REGISTERS: uint = 6;
        /// Initial value of `LaunchHit.t`. Some CPU drivers leave any loop after 65,535 iterations:
        /// a ray keeps this value then, and is reported instead of returning an earlier result.
        UNFINISHED: uint = 0x7fc0_dead;
        /// Maximum number of suspended rays of a launch (trace/suspend.glsl).
        SUSPENDED_RAYS: uint = 0x4000;
        /// First word of the first suspended ray, after their number and the numbers of work-groups
        /// along x, y and z that resume them.
        SUSPENDED_START: uint = 4;
        /// Words of a suspended ray before its traversal stack.
        SUSPENDED_WORDS: uint = 20;
        /// `Push.first` of a launch that resumes suspended rays.
        RESUMED: uint = 0xffff_ffff;
        /// Flag of the first word of a cell of influence areas: it has eight parts.
        DIVIDED: uint = 0x8000_0000;
    };

    /// A node or a leaf of the wide BVH before its kind is known: one cache line, 64 bytes.
    Block: Words {
        /// Data of the node or leaf.
        body: uint[15],
        /// `LEAF` for a leaf; for a node the last four upper planes along z.
        flags: uint,
    }

    /// A node of the wide BVH: boxes of up to seven children, quantized to 8 bits per plane. The
    /// eighth byte of each `bytes8` holds other data.
    WideNode: Words {
        /// Lower corner of the node.
        corner: vec3,
        /// Index of the first child's block; the others follow in slot order.
        first_child: uint,
        /// Lower planes along x of children 0 to 6; then the scale's biased exponent along x.
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

    /// A leaf of the wide BVH: one triangle, or two with a common edge.
    TriangleLeaf: Words {
        /// Vertices, BLAS space: the triangles are (0, 1, 2) and (0, 2, 3).
        corners: vec3[4],
        /// Indices of the triangles in the BLAS, with flags; all ones: there is no second triangle.
        primitives: uvec2,
        /// Four bits per triangle: its second and third vertex in (0, 1, 2) or (0, 2, 3).
        order: uint,
        /// `LEAF`.
        flags: uint,
    }

    /// A leaf of the wide BVH: a sphere.
    SphereLeaf: Words {
        /// Centre, BLAS space.
        center: vec3,
        /// Radius, BLAS space.
        radius: float,
        /// Zero.
        unused0: uint[8],
        /// Index of the sphere in the BLAS, with flags; then all ones.
        primitives: uvec2,
        /// Zero.
        unused1: uint,
        /// `LEAF`.
        flags: uint,
    }

    /// A leaf of the wide TLAS: an instance.
    InstanceLeaf: Words {
        /// World to BLAS space, three rows.
        world_to_group: vec4[3],
        /// Block of the root node of its BLAS.
        root: uint,
        /// Index of its `InstanceRecord`.
        instance: uint,
        /// Zero.
        unused: uint,
        /// `LEAF`.
        flags: uint,
    }

    /// An inner node of the binary BVH: boxes of both children, and references to them.
    BinaryNode: Words {
        /// Lower and upper corner of both children.
        boxes: vec3[2][2],
        /// Bit 31 set: a leaf with count - 1 in bits 27-30 and the first primitive in bits 0-26;
        /// otherwise an inner node with its number in bits 0-26 and the axis of its children in
        /// bits 27-28, along which child 0 is lower. A TLAS leaf is an `InstanceRecord`.
        children: uvec2,
        /// Padding to 64 bytes, one cache line.
        reserved: uvec2,
    }

    /// A triangle of the binary BVH and `brute` kernels.
    TriangleRecord: Words {
        /// Vertices, BLAS space.
        corners: vec3[3],
        /// Index in the BLAS, with flags.
        number: uint,
    }

    /// A sphere of the binary BVH and `brute` kernels, of the size of a `TriangleRecord`.
    SphereRecord: Words {
        /// Centre, BLAS space.
        center: vec3,
        /// Radius, BLAS space.
        radius: float,
        /// Zero.
        unused: uint[5],
        /// Index in the BLAS, with flags.
        number: uint,
    }

    /// Influence areas that have trees of their own, for the binary kernels.
    AreasRecord: Block(access: "readonly", align: 16) {
        /// Lower corner of the octree's root.
        bounds_min: vec4,
        /// Upper corner of the octree's root.
        bounds_max: vec4,
        /// An `AreaRecord` per area.
        areas: address,
        /// Two `uint`s per cell of an octree, the root first: the first of its eight parts, by
        /// upper halves along x, y and z in bits 0 to 2, with the flag `DIVIDED`; or its first area
        /// in `members`, and their number. 0: all areas are asked in turn.
        cells: address,
        /// A `uint` per area of a cell.
        members: address,
        /// A `uint` per primitive of the local trees: the index of its TLAS instance.
        instances: address,
        /// Number of areas.
        count: uint,
        /// Index of the first primitive of the local trees in `SceneRoot.primitives`.
        first_primitive: uint,
        /// Padding to a multiple of 16 bytes.
        reserved: uvec2,
    }

    /// An influence area: a convex region, and the rays that start in it and agree with its own.
    AreaRecord: Array(buffer: "AreaRecords", access: "readonly", align: 16) {
        /// Faces: outward normal of unit length, and distance from the origin.
        planes: vec4[6],
        /// Direction of its rays and 0, or the point that they pass through and 1.
        rays: vec4,
        /// Lower corner of the box around it, and the squared cosine of the angle up to which the
        /// direction of a ray agrees.
        bounds_min: vec4,
        /// Upper corner of the box, and the squared distance from the point of its rays within
        /// which rays of all directions agree.
        bounds_max: vec4,
        /// Root of its tree, as in `SceneRoot.root`.
        root: uint,
        /// Padding to a multiple of 16 bytes.
        reserved: uint[3],
    }

    /// A closest hit between the steps of a launch. For a miss only `t` is written.
    LaunchHit: Words {
        /// Ray parameter; infinite for a miss.
        t: float,
        /// Index of the TLAS instance.
        instance: uint,
        /// Index of the primitive in the BLAS.
        primitive: uint,
        /// Barycentric coordinates: weights of the second and third vertex.
        uv: vec2,
        /// Padding to a multiple of 8 bytes.
        reserved: uint,
    }
}
