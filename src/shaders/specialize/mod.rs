//! Specialization of SPIR-V before a driver sees it: constants take their values, branches that are
//! never taken go, and so does what only they used.
//!
//! A kernel of ours contains every feature, and a scene's specialization constants switch off most.
//! Drivers remove what is off, but Mesa's first parses all of it and runs its passes over it: most
//! of the time in which a pipeline is created whose machine code is in the cache. Here sparse
//! conditional constant propagation (Wegman and Zadeck, "Constant propagation with conditional
//! branches", TOPLAS 1991) follows booleans and 32-bit integers, without floating-point arithmetic:
//! results stay the same bit for bit.
//!
//! The control flow stays structured (SPIR-V specification, section 2.11): `rewrite.rs` says how.

mod constants;
mod flow;
mod fold;
mod rewrite;
mod sweep;
mod uniform;

use rspirv::binary::Assemble;
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Decoration, Op};

use constants::Constants;
use flow::Flow;

/// Specializes a module and returns its words.
///
/// `values`: ids of specialization constants and what they are set to, a bool as 0 or 1; others
/// take their defaults. `reads_first`: what is the same for all invocations is read at the start,
/// for drivers of CPUs (`uniform.rs`).
///
/// # Errors
/// A message, if it is no SPIR-V.
pub fn specialize(spirv: &[u8], values: &[(u32, u32)], reads_first: bool) -> Result<Vec<u32>, String> {
    let mut module = rspirv::dr::load_bytes(spirv).map_err(|e| e.to_string())?;
    let bound = module.header.as_ref().ok_or("it has no header")?.bound;
    freeze(&mut module, values);
    let mut constants = Constants::new(&module, bound);
    constants.fold_globals(&mut module);
    let mut functions = std::mem::take(&mut module.functions);
    for function in &mut functions {
        let flow = Flow::new(function, &constants);
        rewrite::rewrite(function, &flow, &mut constants);
    }
    module.functions = functions;
    let bound = constants.append_to(&mut module);
    if reads_first {
        uniform::read_first(&mut module);
    }
    sweep::sweep(&mut module);
    if let Some(header) = &mut module.header {
        header.bound = bound;
    }
    Ok(module.assemble())
}

/// Specialization constants become constants.
fn freeze(module: &mut Module, values: &[(u32, u32)]) {
    let mut ids = std::collections::HashMap::new();
    module.annotations.retain(|a| match a.operands[..] {
        [Operand::IdRef(id), Operand::Decoration(Decoration::SpecId), Operand::LiteralBit32(constant)] => {
            ids.insert(id, constant);
            false
        }
        _ => true,
    });
    for instruction in &mut module.types_global_values {
        let id = instruction.result_id.and_then(|id| ids.get(&id));
        // what is set last holds
        let value = id.and_then(|id| values.iter().rev().find(|v| v.0 == *id)).map(|v| v.1);
        let boolean = |is_true| if is_true { Op::ConstantTrue } else { Op::ConstantFalse };
        let op = match instruction.class.opcode {
            Op::SpecConstantTrue => boolean(value != Some(0)),
            Op::SpecConstantFalse => boolean(value.is_some_and(|v| v != 0)),
            Op::SpecConstant => {
                if let (Some(value), [Operand::LiteralBit32(literal)]) = (value, &mut instruction.operands[..]) {
                    *literal = value;
                }
                Op::Constant
            }
            Op::SpecConstantComposite => Op::ConstantComposite,
            _ => continue,
        };
        let operands = std::mem::take(&mut instruction.operands);
        *instruction = Instruction::new(op, instruction.result_type, instruction.result_id, operands);
    }
}

#[cfg(test)]
mod tests;
