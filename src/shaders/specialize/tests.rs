use std::collections::HashSet;

use rspirv::dr::{Block, Function};

use super::*;
use crate::interface::constants;
use crate::shaders;

/// Shaders of every kind: large and small, with loops, switches, calls, and of every stage.
fn shaders() -> Vec<shaders::Shader> {
    use shaders::*;
    let streams = [&AO_TRACE_ANY, &PATH_SHADOW_WALLS_CLOSEST, &PATH_CAMERA_CLOSEST, &RAYS_ANY, &RAYS_CLOSEST];
    let of_streams = streams.into_iter().flat_map(|s| s.variants());
    let compute = [&ANTIALIAS, &FILTER, &GTAO, &PATH_RESOLVE, &TEMPORAL, &RADIANCE_TEMPORAL].map(|c| c.variant(true));
    let stages = [MISS, TRIANGLE_CLOSEST, TRIANGLE_ANY, SPHERE_INTERSECTION, DRAW_TRIANGLES, DRAW_ALPHA, DRAW_SPHERE];
    let kernels = [kernel(Traversal::Wide, Mode::Any, true), kernel(Traversal::Wide, Mode::Closest, false)];
    of_streams.chain(compute).chain(stages).chain(kernels).collect()
}

/// All constants that a shader declares, set to the same value.
fn all(value: u32) -> Vec<(u32, u32)> {
    (0..64).map(|id| (id, value)).collect()
}

fn ids(i: &Instruction) -> impl Iterator<Item = u32> + '_ {
    i.operands.iter().filter_map(Operand::id_ref_any).chain(i.result_type)
}

fn blocks(module: &Module) -> impl Iterator<Item = (&Function, &Block)> {
    module.functions.iter().flat_map(|f| f.blocks.iter().map(move |b| (f, b)))
}

/// Asserts those rules of the specification that specialization could break.
fn assert_valid(words: &[u32], what: &str) {
    let module = rspirv::dr::load_words(words).unwrap_or_else(|e| panic!("{what}: {e}"));
    let bound = module.header.as_ref().unwrap().bound;
    let mut defined = HashSet::new();
    for id in module.all_inst_iter().filter_map(|i| i.result_id) {
        assert!(id < bound && defined.insert(id), "{what}: id {id} is defined twice or beyond the bound {bound}");
    }
    for i in module.all_inst_iter() {
        assert!(ids(i).all(|id| defined.contains(&id)), "{what}: {:?} names what is not there", i.class.opcode);
    }

    // blocks are in the order in which they dominate each other
    let inside: HashSet<u32> = blocks(&module).flat_map(|(_, b)| &b.instructions).filter_map(|i| i.result_id).collect();
    let mut computed = HashSet::new();
    for i in blocks(&module).flat_map(|(_, b)| &b.instructions) {
        let is_early = |id: u32| i.class.opcode == Op::Phi || !inside.contains(&id) || computed.contains(&id);
        assert!(ids(i).all(is_early), "{what}: {:?} uses what is computed later", i.class.opcode);
        computed.extend(i.result_id);
    }

    // constructs of control flow
    let mut merges = HashSet::new();
    for (function, block) in blocks(&module) {
        let label = flow::label(block);
        let before =
            function.blocks.iter().filter(|b| flow::targets(b.instructions.last().unwrap()).any(|t| t == label));
        let mut before: Vec<u32> = before.map(flow::label).collect();
        before.sort_unstable();
        for phi in block.instructions.iter().filter(|i| i.class.opcode == Op::Phi) {
            let mut from: Vec<u32> = flow::incoming(phi).map(|(_, from)| from).collect();
            from.sort_unstable();
            assert_eq!(from, before, "{what}: a phi has other blocks before it");
        }
        let n = block.instructions.len();
        let merge =
            block.instructions[..n - 1].last().filter(|i| matches!(i.class.opcode, Op::SelectionMerge | Op::LoopMerge));
        if let Some(merge) = merge {
            let target = merge.operands[0].id_ref_any().unwrap();
            assert!(merges.insert(target), "{what}: two constructs have one merge block");
            let branch = block.instructions[n - 1].class.opcode;
            assert!(
                merge.class.opcode == Op::LoopMerge || branch != Op::Branch,
                "{what}: a selection without a choice"
            );
        }
        assert!(
            block.instructions[..n - 1].iter().all(|i| !flow::is_selection(i) && i.class.opcode != Op::Branch),
            "{what}"
        );
    }
}

#[test]
fn every_value_of_the_constants_leaves_valid_modules() {
    for shader in shaders() {
        let spirv = shader.spirv().unwrap();
        for value in [0, 1, 8, u32::MAX] {
            let what = format!("{:?} with {value}", shader.source());
            assert_valid(&specialize(&spirv, &all(value), true).unwrap(), &what);
            let specialized = specialize(&spirv, &all(value), false).unwrap();
            assert_valid(&specialized, &what);
            let module = rspirv::dr::load_words(&specialized).unwrap();
            let is_open = |i: &&Instruction| {
                matches!(i.class.opcode, Op::SpecConstant | Op::SpecConstantTrue | Op::SpecConstantFalse)
            };
            assert_eq!(module.all_inst_iter().filter(is_open).count(), 0, "{what}");
            // there is nothing left to do
            let again = specialize(bytemuck::cast_slice(&specialized), &[], false).unwrap();
            assert!(again.len() <= specialized.len(), "{what}");
        }
    }
}

/// Numbers of reads in the first block, and in all others.
fn reads(spirv: &[u8], reads_first: bool) -> [usize; 2] {
    let module = rspirv::dr::load_words(specialize(spirv, &[], reads_first).unwrap()).unwrap();
    let entry = module.entry_points[0].operands[1].id_ref_any().unwrap();
    let function = module.functions.iter().find(|f| f.def.as_ref().unwrap().result_id == Some(entry)).unwrap();
    let count = |b: &Block| b.instructions.iter().filter(|i| i.class.opcode == Op::Load).count();
    [count(&function.blocks[0]), function.blocks[1..].iter().map(count).sum()]
}

#[test]
fn parameters_are_read_once_before_the_first_branch() {
    let deliver = |stream: &'static shaders::StreamShaders| stream.variant(shaders::Variant::Deliver64).unwrap();
    for shader in [
        shaders::RESOLVE.variant(true),
        shaders::TEMPORAL.variant(true),
        shaders::GATHER.variant(false),
        deliver(&shaders::PATH_BOUNCE_CLOSEST),
        deliver(&shaders::AO_TRACE_ANY),
    ] {
        let spirv = shader.spirv().unwrap();
        let ([first, others], [first_hoisted, others_hoisted]) = (reads(&spirv, false), reads(&spirv, true));
        let what = format!("{:?}: {first} + {others} reads, then {first_hoisted} + {others_hoisted}", shader.source());
        assert!(first_hoisted > first && others_hoisted < others, "{what}");
        assert!(first_hoisted + others_hoisted <= first + others, "{what}");
        // moved once, they stay where they are
        let hoisted = specialize(&spirv, &[], true).unwrap();
        let again = specialize(bytemuck::cast_slice(&hoisted), &[], true).unwrap();
        assert_eq!(hoisted.len(), again.len(), "{what}");
        // what the pass writes is not read early
        assert!(others_hoisted > 0, "{what}");
    }
}

#[test]
fn features_that_are_off_are_gone() {
    let shader = shaders::PATH_CAMERA_CLOSEST.variant(shaders::Variant::Deliver64).unwrap();
    let spirv = shader.spirv().unwrap();
    let off = 4 * specialize(&spirv, &all(0), false).unwrap().len();
    assert!(5 * off < spirv.len(), "{off} bytes of {}", spirv.len());
}

#[test]
fn a_constant_that_is_not_set_has_its_default() {
    let shader = shaders::kernel(shaders::Traversal::Wide, shaders::Mode::Any, true);
    let spirv = shader.spirv().unwrap();
    let default = specialize(&spirv, &[], false).unwrap();
    let set = specialize(&spirv, &[(constants::WATERTIGHT.id, 1), (constants::SINGLE_LEVEL.id, 0)], false).unwrap();
    assert_eq!(default, set);
    let other = specialize(&spirv, &[(constants::WATERTIGHT.id, 0)], false).unwrap();
    assert!(other.len() < default.len());
    // what is set last holds
    let twice = specialize(&spirv, &[(constants::WATERTIGHT.id, 1), (constants::WATERTIGHT.id, 0)], false).unwrap();
    assert_eq!(twice, other);
}

#[test]
fn what_is_no_spirv_is_refused() {
    let damaged: [&[u32]; 3] = [&[], &[0], &[0x0723_0203, 0x0001_0600, 0, 8, 0, 0xffff_ffff]];
    for words in damaged {
        assert!(specialize(bytemuck::cast_slice(words), &[], false).is_err(), "{words:x?}");
    }
}
