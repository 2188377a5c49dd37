//! Which blocks of a function can run, and which values are constants in every run.

use std::collections::{HashMap, HashSet};

use rspirv::dr::{Block, Function, Instruction, Operand};
use rspirv::spirv::Op;

use super::constants::Constants;
use super::fold::{Value, fold};

/// The result of constant propagation: values of ids, and branches that may be taken.
pub(super) struct Flow {
    /// By id.
    values: Vec<Value>,
    /// Whether a block can run, in the function's order.
    pub(super) runs: Vec<bool>,
    /// Branches that can be taken, from and to a label.
    taken: HashSet<(u32, u32)>,
    /// Position of each block by its label.
    positions: HashMap<u32, usize>,
}

impl Flow {
    pub(super) fn new(function: &Function, constants: &Constants) -> Self {
        let blocks = &function.blocks;
        let positions = (0..).zip(blocks).map(|(k, b)| (label(b), k)).collect();
        let mut values = constants.by_id();
        // what the function itself computes is yet to be seen; what it is given varies
        for id in blocks.iter().flat_map(|b| &b.instructions).filter_map(|i| i.result_id) {
            values[id as usize] = Value::Unseen;
        }
        let mut flow = Self { values, runs: vec![false; blocks.len()], taken: HashSet::new(), positions };
        if let Some(first) = flow.runs.first_mut() {
            *first = true;
        }
        // values only ever go from unseen to constant to varying, so this ends
        while flow.pass(blocks, constants) {}
        flow
    }

    /// Follows each block that can run once; whether anything was learnt.
    fn pass(&mut self, blocks: &[Block], constants: &Constants) -> bool {
        let mut is_new = false;
        for (k, block) in blocks.iter().enumerate() {
            if !self.runs[k] {
                continue;
            }
            for instruction in &block.instructions {
                let Some(id) = instruction.result_id else { continue };
                let known = self.values[id as usize];
                if known != Value::Varying {
                    let value = self.evaluate(label(block), instruction, constants);
                    self.values[id as usize] = value;
                    is_new |= value != known;
                }
            }
            for target in self.targets(block) {
                if self.taken.insert((label(block), target)) {
                    is_new = true;
                    if let Some(position) = self.positions.get(&target) {
                        self.runs[*position] = true;
                    }
                }
            }
        }
        is_new
    }

    fn evaluate(&self, block: u32, instruction: &Instruction, constants: &Constants) -> Value {
        if !instruction.result_type.is_some_and(|ty| constants.follows(ty)) {
            return Value::Varying;
        }
        if instruction.class.opcode != Op::Phi {
            return fold(instruction.class.opcode, &self.operands(instruction));
        }
        let met = incoming(instruction).filter(|(_, from)| self.is_taken(*from, block)).map(|(id, _)| self.value(id));
        met.filter(|value| *value != Value::Unseen)
            .reduce(|a, b| if a == b { a } else { Value::Varying })
            .unwrap_or(Value::Unseen)
    }

    /// The value of an id.
    pub(super) fn value(&self, id: u32) -> Value {
        self.values.get(id as usize).copied().unwrap_or(Value::Varying)
    }

    /// The values of an instruction's operands.
    pub(super) fn operands(&self, instruction: &Instruction) -> Vec<Value> {
        instruction.operands.iter().map(|o| o.id_ref_any().map_or(Value::Varying, |id| self.value(id))).collect()
    }

    /// Whether the branch from one label to another can be taken.
    pub(super) fn is_taken(&self, from: u32, to: u32) -> bool {
        self.taken.contains(&(from, to))
    }

    /// Whether the block with this label can run.
    pub(super) fn can_run(&self, label: u32) -> bool {
        self.positions.get(&label).is_some_and(|k| self.runs[*k])
    }

    /// The only target of a branch with several whose selector is a constant. A branch that repeats
    /// a loop has none: every loop must keep one.
    pub(super) fn only_target(&self, block: &Block) -> Option<u32> {
        let branch = block.instructions.last()?;
        let Value::Constant(selector) = self.value(branch.operands.first()?.id_ref_any()?) else { return None };
        let target = match (branch.class.opcode, &branch.operands[1..]) {
            (Op::BranchConditional, [Operand::IdRef(yes), Operand::IdRef(no), ..]) => {
                *if selector != 0 { yes } else { no }
            }
            (Op::Switch, [Operand::IdRef(default), cases @ ..]) => {
                let case = cases.chunks_exact(2).find(|case| case[0] == Operand::LiteralBit32(selector));
                case.and_then(|case| case[1].id_ref_any()).unwrap_or(*default)
            }
            _ => return None,
        };
        let here = self.positions.get(&label(block))?;
        let repeats = targets(branch).any(|target| self.positions.get(&target).is_some_and(|k| k <= here));
        (!repeats).then_some(target)
    }

    /// Blocks that a block may branch to; none by a selector that is unseen so far.
    fn targets(&self, block: &Block) -> Vec<u32> {
        let Some(branch) = block.instructions.last() else { return Vec::new() };
        if let Some(only) = self.only_target(block) {
            return vec![only];
        }
        match branch.operands.first().and_then(Operand::id_ref_any) {
            Some(selector) if is_selection(branch) && self.value(selector) == Value::Unseen => Vec::new(),
            _ => targets(branch).collect(),
        }
    }
}

/// The label of a block.
pub(super) fn label(block: &Block) -> u32 {
    block.label.as_ref().and_then(|l| l.result_id).unwrap_or(0)
}

/// Whether the last instruction of a block selects among blocks.
pub(super) fn is_selection(branch: &Instruction) -> bool {
    matches!(branch.class.opcode, Op::BranchConditional | Op::Switch)
}

/// The blocks to which the last instruction of a block may branch.
pub(super) fn targets(branch: &Instruction) -> impl Iterator<Item = u32> + '_ {
    let count = match branch.class.opcode {
        Op::Branch => 1,
        // what follows are weights
        Op::BranchConditional => 3,
        Op::Switch => usize::MAX,
        _ => 0,
    };
    let skipped = usize::from(is_selection(branch));
    branch.operands.iter().take(count).skip(skipped).filter_map(Operand::id_ref_any)
}

/// Values of a phi, and the blocks that they come from.
pub(super) fn incoming(phi: &Instruction) -> impl Iterator<Item = (u32, u32)> + '_ {
    phi.operands.chunks_exact(2).filter_map(|pair| Some((pair[0].id_ref_any()?, pair[1].id_ref_any()?)))
}
