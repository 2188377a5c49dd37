//! The scene in device memory, reached from one root by device address. Matrices are three rows of an affine map. Group space is the space of the bottom
//! level's vertices.

use super::super::enumerations::Texels;

records! {
    "scene" values {
        /// Levels of a texture at most, beside level 0: enough for 65535 texels.
        MAX_LEVELS: uint = 15;
    };

    /// Where shaders begin.
    SceneRoot: block readonly 16 {
        /// `InstanceRecord` of each entry of the top level.
        instances: address,
        /// `PartRecord` of each mesh within a group.
        parts: address,
        /// A `uvec2` per instance of the scene: its `InstanceRecord` and its `PartRecord`.
        placements: address,
        /// `MaterialRecord`s.
        materials: address,
        /// `TextureRecord`s.
        textures: address,
        /// Compute tracer: nodes of its hierarchy.
        nodes: address,
        /// Compute tracer, readable kernels: `PrimitiveRecord`s.
        primitives: address,
        /// Hardware tracers: the top-level acceleration structure.
        top_level: address,
        /// Records in `parts`.
        part_count: uint,
        /// To a multiple of 8 bytes.
        reserved0: uint,
        /// Compute tracer: what a launch's rays met.
        launch_hits: address,
        /// Compute tracer: where traversal begins.
        root: uint,
        /// To a multiple of 8 bytes.
        reserved1: uint,
        /// Compute tracer: a `uint` that counts rays whose traversal the driver cut short.
        unfinished: address,
        /// Compute tracer: rays processed by each work-group.
        launch_counters: address,
        /// `MotionRecord` of each entry of the top level; 0: nothing moves.
        motion: address,
        /// `ShadingRecord` of each material; 0: unused.
        shading: address,
        /// Tables of directional albedos (bsdf/albedo.glsl); 0: required by no material.
        albedo: address,
        /// Compute tracer: lower corner of everything, padded as the hierarchy's boxes are.
        bounds_min: vec4,
        /// The upper one.
        bounds_max: vec4,
        /// `MipRecord` of each texture; 0: unused.
        mips: address,
        /// To a multiple of 16 bytes.
        reserved2: address,
    }

    /// An entry of the top level.
    InstanceRecord: array InstanceRecords readonly 16 {
        /// Rows.
        group_to_world: vec4[3],
        /// Rows of the inverse.
        world_to_group: vec4[3],
        /// A `uint` per primitive of the group: its part, counted from `first_part`; 0 when there is one part.
        part_of: address,
        /// Index into `SceneRoot.parts`.
        first_part: uint,
        /// Index of the instance in the scene; `INVALID`: the part knows it.
        scene_instance: uint,
        /// Compute tracer, readable kernels: node of this group.
        root: uint,
        /// Hardware tracers: primitives from here on are in the second geometry (alpha tested).
        opaque_count: uint,
        /// To a multiple of 16 bytes.
        reserved0: uint,
        /// To a multiple of 16 bytes.
        reserved1: uint,
    }

    /// A mesh within a group.
    PartRecord: array PartRecords readonly 16 {
        /// 3 uints per triangle of the group; 0 for spheres.
        indices: address,
        /// 3 floats per vertex of the group; 4 per sphere: centre and radius.
        positions: address,
        /// 3 floats per vertex of the part; 0: flat.
        normals: address,
        /// 2 floats per vertex of the part: the first set; 0: none.
        texcoords0: address,
        /// The second set.
        texcoords1: address,
        /// 4 floats per vertex of the part; 0: none.
        colors: address,
        /// Of the group's primitives.
        first_primitive: uint,
        /// Of the group's vertices.
        first_vertex: uint,
        /// Index of the material.
        material: uint,
        /// Index of the instance in the scene, where the group was baked; else `INVALID`.
        scene_instance: uint,
        /// 1: the vertices were baked through a transform that turned their winding.
        mirrored: uint,
        /// To a multiple of 8 bytes.
        reserved: uint,
        /// 4 floats per vertex of the part; 0: required by no material.
        tangents: address,
    }

    /// What rays ask of a material: colour and alpha.
    MaterialRecord: array MaterialRecords readonly 16 {
        /// Linear, with alpha.
        base_color: vec4,
        /// 2x2, column by column.
        texcoord_transform: vec4,
        /// Added to the transformed texture coordinates.
        texcoord_offset: vec2,
        /// Index of the texture; `INVALID`: none.
        base_color_texture: uint,
        /// Of texture coordinates, 0 or 1.
        texcoord_set: uint,
        /// Present where alpha is at least this; negative: always.
        alpha_cutoff: float,
        /// 1: present with a probability of alpha, whatever the cutoff.
        coverage: uint,
        /// To a multiple of 16 bytes.
        reserved0: uint,
        /// To a multiple of 16 bytes.
        reserved1: uint,
    }

    /// A texture and which point of it a surface shows.
    TextureUse: structure {
        /// 2x2, column by column.
        transform: vec4,
        /// Added to the transformed texture coordinates.
        offset: vec2,
        /// Index of the texture; `INVALID`: none.
        texture: uint,
        /// Of texture coordinates, 0 or 1.
        set: uint,
    }

    /// A texture.
    TextureRecord: array TextureRecords readonly 16 {
        /// RGBA, rows from the top.
        texels: address,
        /// Texels in x.
        width: uint,
        /// Texels in y.
        height: uint,
        /// One of `WRAP_*`, along u.
        wrap_u: uint,
        /// Along v.
        wrap_v: uint,
        /// 1: nearest texel, 0: bilinear.
        nearest: uint,
        /// One of `FORMAT_*`.
        format: uint,
    }

    /// Levels of a texture.
    MipRecord: array MipRecords readonly 8 {
        /// Of level 1, for each `TEXELS_*`: a `uvec2` each, or a `vec4`; 0: unused.
        texels: address[Texels::ALL.len()],
        /// The smallest level.
        last: uint,
        /// Texels before each level, from level 1 on.
        first: uint[MAX_LEVELS as usize],
    }

    /// Where an entry of the top level was in the previous frame.
    MotionRecord: array MotionRecords readonly 16 {
        /// Rows.
        previous_group_to_world: vec4[3],
        /// 3 floats per vertex of the group; 0: as they are.
        previous_positions: address,
        /// To a multiple of 16 bytes.
        reserved: address,
    }
}
