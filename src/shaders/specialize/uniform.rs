//! Reads what is the same for all invocations at the start of a compute shader.
//!
//! Parameters of a pass and fields of the scene's root are at addresses in push constants. Mesa's
//! CPU driver reads such a value once for a vector of lanes before any branch that lanes may take
//! differently; behind one (a thread beyond the last pixel has returned) it gathers the same word
//! for each lane. So these reads move to the first block, each value once, where the address
//! follows from push constants alone. GPUs have scalar registers for such values.
//!
//! A read that moves may not have happened otherwise. Addresses in push constants are valid or
//! null, and nothing is read through one that the shader compares. Only members that the shader
//! declares `readonly` are read, at constant indices.

use std::collections::{HashMap, HashSet};

use rspirv::dr::{Block, Function, Instruction, Module, Operand};
use rspirv::spirv::{Decoration, ExecutionModel, MemoryAccess, Op, StorageClass};

/// Moves the reads of a compute shader's entry point; the optimizer has inlined the others.
pub(super) fn read_first(module: &mut Module) {
    let entry = module.entry_points.iter().find_map(|e| match e.operands[..] {
        [Operand::ExecutionModel(ExecutionModel::GLCompute), Operand::IdRef(id), ..] => Some(id),
        _ => None,
    });
    let facts = Facts::new(module);
    let is_entry = |f: &&mut Function| f.def.as_ref().and_then(|d| d.result_id) == entry;
    let Some(function) = module.functions.iter_mut().find(is_entry).filter(|_| entry.is_some()) else { return };
    // what the shader looks at is known once all that might move is: then less of it does
    let everything = Moves::new(&function.blocks, &facts, &HashSet::new());
    let examined = everything.examined(&function.blocks);
    let moves = Moves::new(&function.blocks, &facts, &examined);
    for block in &mut function.blocks {
        block.instructions.retain(|i| !i.result_id.is_some_and(|id| moves.same.contains_key(&id)));
        for id in block.instructions.iter_mut().flat_map(|i| &mut i.operands).filter_map(Operand::id_ref_any_mut) {
            *id = moves.same.get(id).copied().unwrap_or(*id);
        }
    }
    if let Some(first) = function.blocks.first_mut() {
        let variables = first.instructions.iter().take_while(|i| i.class.opcode == Op::Variable).count();
        first.instructions.splice(variables..variables, moves.instructions);
    }
}

/// The module's types, constants and variables.
struct Facts {
    /// Storage class and pointee, by the id of a pointer's type.
    pointers: HashMap<u32, (StorageClass, u32)>,
    /// Structures, and which of their members are only read.
    readonly: HashSet<(u32, u32)>,
    /// Values of integer constants.
    numbers: HashMap<u32, u32>,
    /// Types of variables and of constants.
    types: HashMap<u32, u32>,
}

impl Facts {
    fn new(module: &Module) -> Self {
        let mut facts =
            Self { pointers: HashMap::new(), readonly: HashSet::new(), numbers: HashMap::new(), types: HashMap::new() };
        for a in &module.annotations {
            if let [Operand::IdRef(ty), Operand::LiteralBit32(member), Operand::Decoration(Decoration::NonWritable)] =
                a.operands[..]
            {
                facts.readonly.insert((ty, member));
            }
        }
        for i in &module.types_global_values {
            let Some(id) = i.result_id else { continue };
            match (i.class.opcode, &i.operands[..]) {
                (Op::TypePointer, [Operand::StorageClass(class), Operand::IdRef(pointee)]) => {
                    facts.pointers.insert(id, (*class, *pointee));
                }
                (Op::Constant, [Operand::LiteralBit32(number)]) => {
                    facts.numbers.insert(id, *number);
                }
                _ => {}
            }
            facts.types.extend(i.result_type.map(|ty| (id, ty)));
        }
        facts
    }

    /// Whether a pointer of this type points at a structure whose member is read-only.
    fn is_readonly(&self, pointer: u32, member: u32) -> bool {
        matches!(self.pointers.get(&pointer), Some((StorageClass::PhysicalStorageBuffer, pointee)) if self.readonly.contains(&(*pointee, member)))
    }
}

/// Instructions that move to the start.
#[derive(Default)]
struct Moves {
    /// In order.
    instructions: Vec<Instruction>,
    /// By result: the first instruction that computes the same.
    same: HashMap<u32, u32>,
    /// Results that follow from push constants alone, and what each is made of.
    from_push: HashMap<u32, Vec<u32>>,
    /// The results that are pointers.
    pointers: HashSet<u32>,
}

impl Moves {
    /// `examined`: addresses through which nothing is read.
    fn new(blocks: &[Block], facts: &Facts, examined: &HashSet<u32>) -> Self {
        let mut moves = Self::default();
        let mut types = facts.types.clone();
        let mut known: HashMap<String, u32> = HashMap::new();
        for i in blocks.iter().flat_map(|b| &b.instructions) {
            let (Some(id), Some(ty)) = (i.result_id, i.result_type) else { continue };
            types.insert(id, ty);
            let mut moved = i.clone();
            for operand in moved.operands.iter_mut().filter_map(Operand::id_ref_any_mut) {
                *operand = moves.same.get(operand).copied().unwrap_or(*operand);
            }
            let Some(is_from_push) = moves.place(&moved, facts, &types, examined) else { continue };
            let key = format!("{:?} {ty} {:?}", moved.class.opcode, moved.operands);
            let first = *known.entry(key).or_insert(id);
            moves.same.insert(id, first);
            if first == id {
                if facts.pointers.contains_key(&ty) {
                    moves.pointers.insert(id);
                }
                if is_from_push {
                    moves.from_push.insert(id, moved.operands.iter().filter_map(Operand::id_ref_any).collect());
                }
                moves.instructions.push(moved);
            }
        }
        moves
    }

    /// Whether an instruction moves, and if so whether its result depends on push constants alone.
    fn place(
        &self,
        i: &Instruction,
        facts: &Facts,
        types: &HashMap<u32, u32>,
        examined: &HashSet<u32>,
    ) -> Option<bool> {
        let is_from_push = |id: &u32| self.from_push.contains_key(id);
        let is_known =
            |o: &Operand| o.id_ref_any().is_none_or(|id| is_from_push(&id) || facts.numbers.contains_key(&id));
        let class = |id: &u32| types.get(id).and_then(|ty| facts.pointers.get(ty)).map(|p| p.0);

        // by kind of instruction
        match (i.class.opcode, &i.operands[..]) {
            (Op::AccessChain | Op::InBoundsAccessChain, [Operand::IdRef(base), indices @ ..]) => {
                let numbers = indices.iter().map(|o| facts.numbers.get(&o.id_ref_any()?).copied());
                let numbers = numbers.collect::<Option<Vec<u32>>>()?;
                let is_readonly = |member: &u32| facts.is_readonly(*types.get(base)?, *member).then_some(true);
                match class(base)? {
                    StorageClass::PushConstant => Some(true),
                    _ if is_from_push(base) => numbers.first().and_then(is_readonly),
                    _ => None,
                }
            }
            (Op::Load, [Operand::IdRef(pointer), rest @ ..]) => {
                let is_plain = rest
                    .iter()
                    .all(|o| matches!(o, Operand::MemoryAccess(MemoryAccess::ALIGNED) | Operand::LiteralBit32(_)));
                (is_plain && is_from_push(pointer)).then(|| class(pointer) == Some(StorageClass::PushConstant))
            }
            (Op::Bitcast | Op::ConvertUToPtr, [Operand::IdRef(address)]) => {
                (is_from_push(address) && !examined.contains(address)).then_some(true)
            }
            (Op::CompositeExtract, [Operand::IdRef(from), ..]) => {
                self.same.contains_key(from).then(|| is_from_push(from))
            }
            // the address of what lies behind something
            (Op::IAdd | Op::IAddCarry | Op::CompositeConstruct, operands) => {
                operands.iter().all(is_known).then_some(true)
            }
            _ => None,
        }
    }

    /// Addresses with which the shader does other things than reading through them.
    fn examined(&self, blocks: &[Block]) -> HashSet<u32> {
        let stay = blocks
            .iter()
            .flat_map(|b| &b.instructions)
            .filter(|i| !i.result_id.is_some_and(|id| self.same.contains_key(&id)));
        let used = stay.flat_map(|i| i.operands.iter().filter_map(Operand::id_ref_any));
        let mut waiting: Vec<u32> = used.filter_map(|id| self.same.get(&id).copied()).collect();
        let mut examined = HashSet::new();
        while let Some(id) = waiting.pop() {
            // a pointer is followed, not looked at, and what is read through it is no address
            let made_of = self.from_push.get(&id).filter(|_| !self.pointers.contains(&id));
            if let Some(made_of) = made_of
                && examined.insert(id)
            {
                waiting.extend(made_of);
            }
        }
        examined
    }
}
