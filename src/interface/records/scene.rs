//! The scene in device memory, reached from one root by device address. Matrices are the three rows
//! of an affine map. A group is a bottom-level acceleration structure (BLAS), and consists of
//! submeshes; BLAS space is the space of its vertices.

use super::super::enumerations::Texels;

records! {
    "scene" values {
        /// Levels of a texture at most, beside level 0: enough for 65535 texels.
        MAX_LEVELS: uint = 15;
    };

    /// The root of the scene: all other data is reached from here.
    SceneRoot: Block(access: "readonly", align: 16) {
        /// `InstanceRecord` of each TLAS instance.
        instances: address,
        /// `SubmeshRecord` of each submesh of a BLAS.
        submeshes: address,
        /// A `uvec2` per instance of the scene: its `InstanceRecord` and its `SubmeshRecord`.
        scene_instances: address,
        /// `MaterialRecord`s.
        materials: address,
        /// `TextureRecord`s.
        textures: address,
        /// Compute tracer: nodes of the BVH.
        nodes: address,
        /// Compute tracer, binary BVH and `brute` kernels: the primitives.
        primitives: address,
        /// Hardware tracers: the top-level acceleration structure.
        top_level: address,
        /// Number of records in `submeshes`.
        submesh_count: uint,
        /// Padding to a multiple of 8 bytes.
        reserved0: uint,
        /// Compute tracer: the hits of a launch.
        launch_hits: address,
        /// Compute tracer: reference to the root node.
        root: uint,
        /// Padding to a multiple of 8 bytes.
        reserved1: uint,
        /// Compute tracer: a `uint` that counts rays whose traversal the driver ended early.
        unfinished: address,
        /// Compute tracer: rays processed by each work-group.
        launch_counters: address,
        /// `MotionRecord` of each TLAS instance; 0: nothing moves.
        motion: address,
        /// `ShadingRecord` of each material; 0: unused.
        shading: address,
        /// Tables of directional albedos (bsdf/albedo.glsl); 0: required by no material.
        albedo: address,
        /// Compute tracer: lower corner of the scene's bounds, padded as BVH boxes are.
        bounds_min: vec4,
        /// Compute tracer: upper corner of the scene's bounds.
        bounds_max: vec4,
        /// `MipRecord` of each texture; 0: unused.
        mips: address,
        /// Compute tracer: suspended rays where the driver ends loops early; 0: it does not.
        suspended: address,
        /// Compute tracer, binary BVH kernel: the `AreasRecord`; 0: no influence area has a tree.
        areas: address,
        /// Padding to a multiple of 16 bytes.
        reserved2: address,
    }

    /// A TLAS instance.
    InstanceRecord: Array(buffer: "InstanceRecords", access: "readonly", align: 16) {
        /// BLAS space to world, three rows.
        group_to_world: vec4[3],
        /// World to BLAS space, three rows.
        world_to_group: vec4[3],
        /// A `uint` per primitive of the BLAS: submesh, counted from `first_submesh`; or 0 for one.
        submesh_of: address,
        /// Index into `SceneRoot.submeshes`.
        first_submesh: uint,
        /// Index of the instance in the scene; `INVALID`: each submesh of the BLAS has its own.
        scene_instance: uint,
        /// Compute tracer, binary BVH kernel: root node of the BLAS.
        root: uint,
        /// Hardware tracers: first primitive of the second BLAS geometry, which is alpha tested.
        opaque_count: uint,
        /// Padding to a multiple of 16 bytes.
        reserved0: uint,
        /// Padding to a multiple of 16 bytes.
        reserved1: uint,
    }

    /// A submesh of a BLAS.
    SubmeshRecord: Array(buffer: "SubmeshRecords", access: "readonly", align: 16) {
        /// 3 uints per triangle of the BLAS; 0 for spheres.
        indices: address,
        /// 3 floats per vertex of the BLAS; 4 per sphere: centre and radius.
        positions: address,
        /// 3 floats per vertex of the submesh; 0: flat shading.
        normals: address,
        /// 2 floats per vertex of the submesh: texture coordinate set 0; 0: none.
        texcoords0: address,
        /// 2 floats per vertex of the submesh and set: texture coordinates from set 1 on, those of
        /// a vertex side by side; 0: none.
        texcoords1: address,
        /// 4 floats per vertex of the submesh: vertex colours; 0: none.
        colors: address,
        /// Index of its first primitive in the BLAS.
        first_primitive: uint,
        /// Index of its first vertex in the BLAS.
        first_vertex: uint,
        /// Index of the material.
        material: uint,
        /// Index of the instance in the scene, if it was baked into the BLAS; else `INVALID`.
        scene_instance: uint,
        /// 1: the vertices were baked through a mirroring transform, which reversed their winding.
        mirrored: uint,
        /// Triangles: number of sets in `texcoords1`. Spheres: 1 if their material has textures, so
        /// that their points have texture coordinates.
        texcoord_sets: uint,
        /// 4 floats per vertex of the submesh: tangents; 0: required by no material.
        tangents: address,
        /// Tangents of the clearcoat's normal map, likewise; 0: `tangents`.
        clearcoat_tangents: address,
        /// Tangents of the anisotropy texture, likewise; 0: `tangents`.
        anisotropy_tangents: address,
    }

    /// The properties of a material that traversal needs: base colour and alpha.
    MaterialRecord: Array(buffer: "MaterialRecords", access: "readonly", align: 16) {
        /// Base colour, linear RGB, and alpha.
        base_color: vec4,
        /// Transform of texture coordinates, 2x2, column by column.
        texcoord_transform: vec4,
        /// Added to the transformed texture coordinates.
        texcoord_offset: vec2,
        /// Index of the base colour texture, or `INVALID`.
        base_color_texture: uint,
        /// Texture coordinate set.
        texcoord_set: uint,
        /// Alpha cutoff: hits with less alpha are ignored; negative: opaque.
        alpha_cutoff: float,
        /// 1: stochastic alpha, a hit counts with a probability of alpha, whatever the cutoff.
        coverage: uint,
        /// Padding to a multiple of 16 bytes.
        reserved0: uint,
        /// Padding to a multiple of 16 bytes.
        reserved1: uint,
    }

    /// A material's reference to a texture, with its transform (KHR_texture_transform).
    TextureUse: Structure {
        /// Transform of texture coordinates, 2x2, column by column.
        transform: vec4,
        /// Added to the transformed texture coordinates.
        offset: vec2,
        /// Index of the texture, or `INVALID`.
        texture: uint,
        /// Texture coordinate set, 0 or 1.
        set: uint,
    }

    /// A texture.
    TextureRecord: Array(buffer: "TextureRecords", access: "readonly", align: 16) {
        /// RGBA texels, rows from the top.
        texels: address,
        /// Width in texels.
        width: uint,
        /// Height in texels.
        height: uint,
        /// One of `WRAP_*`: wrap mode along u.
        wrap_u: uint,
        /// One of `WRAP_*`: wrap mode along v.
        wrap_v: uint,
        /// 1: nearest filtering, 0: bilinear.
        nearest: uint,
        /// One of `FORMAT_*`: texel format.
        format: uint,
    }

    /// The mip levels of a texture above level 0.
    MipRecord: Array(buffer: "MipRecords", access: "readonly", align: 8) {
        /// Texels of level 1, for each of `TEXELS_*`: a `uvec2` or a `vec4` per texel; 0: unused.
        texels: address[Texels::ALL.len()],
        /// Index of the smallest level.
        last: uint,
        /// Number of texels before each level, from level 1 on.
        first: uint[MAX_LEVELS as usize],
    }

    /// A TLAS instance in the previous frame.
    MotionRecord: Array(buffer: "MotionRecords", access: "readonly", align: 16) {
        /// BLAS space to world in the previous frame, three rows.
        previous_group_to_world: vec4[3],
        /// 3 floats per vertex of the BLAS: positions in the previous frame; 0: unchanged.
        previous_positions: address,
        /// Padding to a multiple of 16 bytes.
        reserved: address,
    }
}
