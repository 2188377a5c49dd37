//! Reads of a pass's parameters and of the scene's root, moved to where a shader begins.
//!
//! Mesa's CPU driver reads a value that is the same for all lanes once, and hands it to all of them, where no lane can be switched off. After the first branch, and a shader
//! that returns early has all of its work in one, it does not know that any more: the same read is a gather of every lane there, thirteen cycles or more for each word. What lies at
//! an address in the push constants is valid in the whole shader and never changes, so it can be read before the first branch. Compilers of GPUs know what is uniform.

use std::collections::{HashMap, HashSet};

use rspirv::dr::{Function, Instruction, Module, Operand};
use rspirv::spirv::{Decoration, MemoryAccess, Op, StorageClass};

/// What an instruction results in, that is the same for all lanes.
#[derive(Clone, Copy, PartialEq)]
enum Uniform {
    /// A pointer to a push constant.
    PushConstant,
    /// A push constant.
    Pushed,
    /// A pointer to the record at a pushed address.
    Record,
    /// A pointer to a member of such a record.
    Member,
    /// The member.
    Value,
}

/// Moves such reads, and what they need, to the beginning of the entry points.
pub(super) fn hoist(module: &mut Module) {
    let types = Types::new(module);
    let entries: HashSet<u32> =
        module.entry_points.iter().filter_map(|e| e.operands.iter().find_map(Operand::id_ref_any)).collect();
    let is_entry = |f: &&mut Function| f.def.as_ref().and_then(|d| d.result_id).is_some_and(|id| entries.contains(&id));
    for function in module.functions.iter_mut().filter(is_entry) {
        hoist_in(function, &types);
    }
}

fn hoist_in(function: &mut Function, types: &Types) {
    // with their types
    let mut uniform: HashMap<u32, (Uniform, u32)> = HashMap::new();
    // of two instructions that do the same, the second is the first
    let mut same: HashMap<u32, u32> = HashMap::new();
    let mut moved: Vec<Instruction> = Vec::new();
    for block in &mut function.blocks {
        block.instructions.retain_mut(|i| {
            for id in i.operands.iter_mut().filter_map(Operand::id_ref_any_mut) {
                *id = same.get(id).copied().unwrap_or(*id);
            }
            let (Some(id), Some(ty), Some(kind)) = (i.result_id, i.result_type, types.uniform(i, &uniform)) else {
                return true;
            };
            let is_same = |m: &&Instruction| {
                m.class.opcode == i.class.opcode && m.result_type == i.result_type && m.operands == i.operands
            };
            match moved.iter().find(is_same).and_then(|m| m.result_id) {
                Some(first) => drop(same.insert(id, first)),
                None => {
                    uniform.insert(id, (kind, ty));
                    moved.push(i.clone());
                }
            }
            false
        });
    }
    for i in function.blocks.iter_mut().flat_map(|b| &mut b.instructions) {
        for id in i.operands.iter_mut().filter_map(Operand::id_ref_any_mut) {
            *id = same.get(id).copied().unwrap_or(*id);
        }
    }
    if let Some(first) = function.blocks.first_mut() {
        let variables = first.instructions.iter().take_while(|i| i.class.opcode == Op::Variable).count();
        first.instructions.splice(variables..variables, moved);
    }
}

/// What a module says of its types, constants and push constants.
struct Types {
    /// Members of structures, elements of arrays, vectors and matrices; those of arrays without a length are not here.
    parts: HashMap<u32, Vec<u32>>,
    structures: HashSet<u32>,
    /// What pointers to device memory point to.
    pointees: HashMap<u32, u32>,
    constants: HashMap<u32, u32>,
    push_constants: HashSet<u32>,
    /// Structures and numbers of members that shaders do not write to.
    read_only: HashSet<(u32, u32)>,
}

impl Types {
    fn new(module: &Module) -> Self {
        let mut types = Self {
            parts: HashMap::new(),
            structures: HashSet::new(),
            pointees: HashMap::new(),
            constants: HashMap::new(),
            push_constants: HashSet::new(),
            read_only: HashSet::new(),
        };
        for i in &module.types_global_values {
            let Some(id) = i.result_id else { continue };
            match (i.class.opcode, &i.operands[..]) {
                (Op::TypeStruct, members) => {
                    types.structures.insert(id);
                    types.parts.insert(id, members.iter().filter_map(Operand::id_ref_any).collect());
                }
                (Op::TypeVector | Op::TypeMatrix | Op::TypeArray, [Operand::IdRef(of), ..]) => {
                    types.parts.insert(id, vec![*of]);
                }
                (Op::TypePointer, [Operand::StorageClass(StorageClass::PhysicalStorageBuffer), Operand::IdRef(to)]) => {
                    types.pointees.insert(id, *to);
                }
                (Op::Constant, [Operand::LiteralBit32(value)]) => {
                    types.constants.insert(id, *value);
                }
                (Op::Variable, [Operand::StorageClass(StorageClass::PushConstant), ..]) => {
                    types.push_constants.insert(id);
                }
                _ => {}
            }
        }
        types.read_only.extend(module.annotations.iter().filter_map(|a| match a.operands[..] {
            [Operand::IdRef(id), Operand::LiteralBit32(member), Operand::Decoration(Decoration::NonWritable)] => {
                Some((id, member))
            }
            _ => None,
        }));
        types
    }

    /// What an instruction results in, if it can be moved; `known`: of those before it.
    fn uniform(&self, i: &Instruction, known: &HashMap<u32, (Uniform, u32)>) -> Option<Uniform> {
        let first = i.operands.first()?.id_ref_any()?;
        match i.class.opcode {
            Op::AccessChain | Op::InBoundsAccessChain => {
                let indices: Option<Vec<u32>> =
                    i.operands[1..].iter().map(|o| self.constants.get(&o.id_ref_any()?).copied()).collect();
                let indices = indices?;
                if self.push_constants.contains(&first) {
                    return Some(Uniform::PushConstant);
                }
                let (Uniform::Record, pointer) = *known.get(&first)? else { return None };
                self.is_within(*self.pointees.get(&pointer)?, &indices).then_some(Uniform::Member)
            }
            Op::Load => {
                let is_volatile = |o: &Operand| matches!(o, Operand::MemoryAccess(a) if a.contains(MemoryAccess::VOLATILE));
                match known.get(&first)?.0 {
                    _ if i.operands.iter().any(is_volatile) => None,
                    Uniform::PushConstant => Some(Uniform::Pushed),
                    Uniform::Member => Some(Uniform::Value),
                    _ => None,
                }
            }
            Op::Bitcast | Op::ConvertUToPtr => {
                let is_record = self.pointees.get(&i.result_type?).is_some_and(|to| self.structures.contains(to));
                (known.get(&first)?.0 == Uniform::Pushed && is_record).then_some(Uniform::Record)
            }
            _ => None,
        }
    }

    /// Whether indices lead to something in a structure that shaders do not write to, and that is not in an array without a length.
    fn is_within(&self, structure: u32, indices: &[u32]) -> bool {
        let Some(member) = indices.first().filter(|member| self.read_only.contains(&(structure, **member))) else {
            return false;
        };
        let mut ty = self.parts.get(&structure).and_then(|parts| parts.get(*member as usize)).copied();
        for index in &indices[1..] {
            let parts = ty.and_then(|ty| self.parts.get(&ty));
            ty = parts.and_then(|parts| if parts.len() == 1 { parts.first() } else { parts.get(*index as usize) }).copied();
        }
        // an array without a length has no parts, and scalars are no arrays
        ty.is_some()
    }
}
