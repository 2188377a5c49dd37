//! Removes what nothing uses: values, functions that are not called, and what is said about them.

use std::collections::{HashMap, HashSet};

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{GlslStd450Op, MemoryAccess, Op};

/// Removes what nothing uses. Variables, types and constants outside of functions stay.
pub(super) fn sweep(module: &mut Module) {
    remove_uncalled(module);
    let math = math_instructions(module);
    let used = used(module, math);
    for block in module.functions.iter_mut().flat_map(|f| &mut f.blocks) {
        block.instructions.retain(|i| !is_pure(i, math) || i.result_id.is_some_and(|id| used.contains(&id)));
    }
    let defined: HashSet<u32> = module.all_inst_iter().filter_map(|i| i.result_id).collect();
    let is_about_something = |i: &Instruction| match i.operands.first() {
        Some(Operand::IdRef(id)) => defined.contains(id),
        _ => true,
    };
    module.annotations.retain(is_about_something);
    module.debug_names.retain(is_about_something);
}

/// Removes functions that no entry point reaches.
fn remove_uncalled(module: &mut Module) {
    let entry = |i: &Instruction| i.operands.iter().find_map(Operand::id_ref_any);
    let mut called: HashSet<u32> = module.entry_points.iter().filter_map(entry).collect();
    let function_id = |f: &rspirv::dr::Function| f.def.as_ref().and_then(|d| d.result_id);
    let mut waiting: Vec<u32> = called.iter().copied().collect();
    while let Some(id) = waiting.pop() {
        let Some(function) = module.functions.iter().find(|f| function_id(f) == Some(id)) else { continue };
        for call in function.all_inst_iter().filter(|i| i.class.opcode == Op::FunctionCall) {
            waiting.extend(entry(call).filter(|callee| called.insert(*callee)));
        }
    }
    module.functions.retain(|f| function_id(f).is_some_and(|id| called.contains(&id)));
}

/// Values that something with an effect uses, directly or not.
fn used(module: &Module, math: Option<u32>) -> HashSet<u32> {
    let instructions = || module.functions.iter().flat_map(|f| &f.blocks).flat_map(|b| &b.instructions);
    let definitions: HashMap<u32, &Instruction> = instructions().filter_map(|i| Some((i.result_id?, i))).collect();
    let operands = |i: &Instruction| i.operands.iter().filter_map(Operand::id_ref_any).collect::<Vec<_>>();
    let mut used = HashSet::new();
    let mut waiting: Vec<u32> = instructions().filter(|i| !is_pure(i, math)).flat_map(operands).collect();
    while let Some(id) = waiting.pop() {
        if used.insert(id)
            && let Some(definition) = definitions.get(&id)
        {
            waiting.extend(operands(definition));
        }
    }
    used
}

/// The id of the set of extended instructions GLSL.std.450.
fn math_instructions(module: &Module) -> Option<u32> {
    let is_math = |i: &&Instruction| i.operands == [Operand::LiteralString("GLSL.std.450".into())];
    module.ext_inst_imports.iter().find(is_math).and_then(|i| i.result_id)
}

/// Whether an instruction only computes its result; `math`: [`math_instructions`].
fn is_pure(instruction: &Instruction, math: Option<u32>) -> bool {
    let op = instruction.class.opcode;
    match op {
        Op::Phi | Op::Undef | Op::AccessChain | Op::InBoundsAccessChain | Op::CopyLogical => true,
        Op::Load => !instruction
            .operands
            .iter()
            .any(|o| matches!(o, Operand::MemoryAccess(a) if a.contains(MemoryAccess::VOLATILE))),
        Op::ExtInst => match instruction.operands[..] {
            // these two write through a pointer
            [Operand::IdRef(set), Operand::LiteralExtInstInteger(number), ..] => {
                Some(set) == math && ![GlslStd450Op::Modf as u32, GlslStd450Op::Frexp as u32].contains(&number)
            }
            _ => false,
        },
        // composites; then conversions, arithmetic, logic and bits, numbered in a row
        _ => {
            (Op::VectorExtractDynamic as u32..=Op::Transpose as u32).contains(&(op as u32))
                || (Op::ConvertFToU as u32..=Op::BitCount as u32).contains(&(op as u32))
        }
    }
}
