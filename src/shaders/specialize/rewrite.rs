//! A function without what never runs, in structured control flow.
//!
//! - A selection whose condition is a constant becomes a branch, or a switch with one case if
//!   another branch, which has no merge block of its own, leaves it through its merge block.
//! - A switch keeps its merge block, to which its cases break.
//! - A loop keeps its merge block and its continue target. If they never run, they stay without
//!   their contents.

use std::collections::{HashMap, HashSet};

use rspirv::dr::{Block, Function, Instruction, Operand};
use rspirv::spirv::Op;

use super::constants::Constants;
use super::flow::{Flow, incoming, is_selection, label, targets};
use super::fold::{Value, unchanged};

/// Rewrites a function.
pub(super) fn rewrite(function: &mut Function, flow: &Flow, constants: &mut Constants) {
    let left = left_by_others(&function.blocks, flow);
    let stubs = stubs(&function.blocks, flow, &left);
    let aliases = aliases(&function.blocks, flow, constants);
    let blocks = std::mem::take(&mut function.blocks);
    for (k, mut block) in blocks.into_iter().enumerate() {
        let label = label(&block);
        if flow.runs[k] {
            shorten_branch(&mut block, flow, &left, constants);
            let stub = stubs.repeats.get(&label).copied();
            block.instructions.retain(|i| !i.result_id.is_some_and(|id| aliases.contains_key(&id)));
            for instruction in &mut block.instructions {
                if instruction.class.opcode == Op::Phi {
                    keep_taken(instruction, label, stub, flow, constants);
                }
                for id in instruction.operands.iter_mut().filter_map(Operand::id_ref_any_mut) {
                    *id = resolve(&aliases, *id);
                }
            }
        } else if let Some(branch) = stubs.contents.get(&label) {
            block.instructions = vec![branch.clone()];
        } else {
            continue;
        }
        function.blocks.push(block);
    }
}

/// Blocks without contents that merge instructions name.
struct Stubs {
    /// By label: the one instruction that is left.
    contents: HashMap<u32, Instruction>,
    /// By the label of a loop: its continue target.
    repeats: HashMap<u32, u32>,
}

fn stubs(blocks: &[Block], flow: &Flow, left: &HashSet<u32>) -> Stubs {
    let mut stubs = Stubs { contents: HashMap::new(), repeats: HashMap::new() };
    for block in blocks.iter().zip(&flow.runs).filter(|(_, runs)| **runs).map(|(block, _)| block) {
        let Some(merge) = merge_instruction(block).filter(|merge| is_kept(block, merge, flow, left)) else { continue };
        let mut named = merge.operands.iter().map_while(Operand::id_ref_any);
        if let Some(target) = named.next().filter(|target| !flow.can_run(*target)) {
            let unreachable = Instruction::new(Op::Unreachable, None, None, Vec::new());
            stubs.contents.entry(target).or_insert(unreachable);
        }
        if let Some(target) = named.next().filter(|target| !flow.can_run(*target)) {
            stubs.contents.insert(target, branch(label(block)));
            stubs.repeats.insert(label(block), target);
        }
    }
    stubs
}

fn branch(target: u32) -> Instruction {
    Instruction::new(Op::Branch, None, None, vec![Operand::IdRef(target)])
}

/// The merge instruction of a block; its operands begin with merge block and continue target.
fn merge_instruction(block: &Block) -> Option<&Instruction> {
    let (_, before) = block.instructions.split_last()?;
    before.last().filter(|i| matches!(i.class.opcode, Op::SelectionMerge | Op::LoopMerge))
}

/// Whether a block keeps its merge instruction.
fn is_kept(block: &Block, merge: &Instruction, flow: &Flow, left: &HashSet<u32>) -> bool {
    let is_if = block.instructions.last().is_some_and(|i| i.class.opcode == Op::BranchConditional);
    let is_selection = merge.class.opcode == Op::SelectionMerge;
    let is_left = merge.operands.first().and_then(Operand::id_ref_any).is_some_and(|target| left.contains(&target));
    !(is_selection && is_if && flow.only_target(block).is_some()) || is_left
}

/// Targets of branches that select without a merge block of their own.
fn left_by_others(blocks: &[Block], flow: &Flow) -> HashSet<u32> {
    let selecting = |block: &&Block| block.instructions.last().is_some_and(is_selection);
    let running = blocks.iter().zip(&flow.runs).filter(|(_, runs)| **runs).map(|(block, _)| block);
    let without_merge =
        running.filter(selecting).filter(|b| merge_instruction(b).is_none() && flow.only_target(b).is_none());
    without_merge.filter_map(|b| b.instructions.last()).flat_map(targets).collect()
}

/// Makes the branch at the end of a block one to its only target, if it has one.
fn shorten_branch(block: &mut Block, flow: &Flow, left: &HashSet<u32>, constants: &mut Constants) {
    let Some(target) = flow.only_target(block) else { return };
    let is_selection = |merge: &Instruction| merge.class.opcode == Op::SelectionMerge;
    let is_kept = merge_instruction(block).map(|merge| is_selection(merge) && is_kept(block, merge, flow, left));
    let is_dropped = is_kept == Some(false) && merge_instruction(block).is_some_and(is_selection);
    block.instructions.truncate(block.instructions.len() - 1 - usize::from(is_dropped));
    let shortened = if is_kept == Some(true) {
        let operands = vec![Operand::IdRef(constants.zero()), Operand::IdRef(target)];
        Instruction::new(Op::Switch, None, None, operands)
    } else {
        branch(target)
    };
    block.instructions.push(shortened);
}

/// Replacements of values: constants, and operands that an instruction returns unchanged.
fn aliases(blocks: &[Block], flow: &Flow, constants: &mut Constants) -> HashMap<u32, u32> {
    let mut aliases = HashMap::new();
    for block in blocks.iter().zip(&flow.runs).filter(|(_, runs)| **runs).map(|(block, _)| block) {
        for instruction in &block.instructions {
            let (Some(id), Some(ty)) = (instruction.result_id, instruction.result_type) else { continue };
            let alias = match (flow.value(id), instruction.class.opcode) {
                (Value::Constant(value), _) => Some(constants.id(ty, value)),
                (_, Op::Phi) => only_incoming(instruction, label(block), flow, &aliases),
                (_, op) => {
                    unchanged(op, &flow.operands(instruction)).and_then(|k| instruction.operands[k].id_ref_any())
                }
            };
            // a value that is made of itself only is never computed
            if let Some(alias) = alias.map(|a| resolve(&aliases, a)).filter(|a| *a != id) {
                aliases.insert(id, alias);
            }
        }
    }
    aliases
}

/// The value of a phi that every branch that is taken brings.
fn only_incoming(phi: &Instruction, block: u32, flow: &Flow, aliases: &HashMap<u32, u32>) -> Option<u32> {
    let mut taken = incoming(phi).filter(|(_, from)| flow.is_taken(*from, block)).map(|(id, _)| resolve(aliases, id));
    let first = taken.next()?;
    taken.all(|id| id == first).then_some(first)
}

/// Follows aliases of aliases.
fn resolve(aliases: &HashMap<u32, u32>, mut id: u32) -> u32 {
    while let Some(next) = aliases.get(&id) {
        id = *next;
    }
    id
}

/// Leaves a phi the values of branches that are taken; an emptied continue target brings any.
fn keep_taken(phi: &mut Instruction, block: u32, stub: Option<u32>, flow: &Flow, constants: &mut Constants) {
    let mut kept: Vec<_> = incoming(phi).filter(|(_, from)| flow.is_taken(*from, block)).collect();
    if let (Some(stub), Some(ty)) = (stub, phi.result_type) {
        kept.push((constants.undefined(ty), stub));
    }
    phi.operands = kept.into_iter().flat_map(|(id, from)| [Operand::IdRef(id), Operand::IdRef(from)]).collect();
}
