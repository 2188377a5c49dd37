//! The constants of a module, its own and those that folding adds, and the types that are followed.

use std::collections::HashMap;

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::Op;

use super::fold::{Value, fold};

/// A type of which constants are followed.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Bool,
    /// A 32-bit integer, signed or not.
    Int,
}

/// Constants by type and value.
pub(super) struct Constants {
    kinds: HashMap<u32, Kind>,
    /// By result id, of constants.
    values: HashMap<u32, u32>,
    /// By type and value.
    ids: HashMap<(u32, u32), u32>,
    undefined: HashMap<u32, u32>,
    unsigned: Option<u32>,
    added: Vec<Instruction>,
    bound: u32,
}

impl Constants {
    /// `bound`: ids are below it.
    pub(super) fn new(module: &Module, bound: u32) -> Self {
        let mut all = Self {
            kinds: HashMap::new(),
            values: HashMap::new(),
            ids: HashMap::new(),
            undefined: HashMap::new(),
            unsigned: None,
            added: Vec::new(),
            bound,
        };
        for instruction in &module.types_global_values {
            all.add(instruction);
        }
        all
    }

    /// Learns of a type or a constant.
    fn add(&mut self, instruction: &Instruction) {
        let Some(id) = instruction.result_id else { return };
        let value = match (instruction.class.opcode, &instruction.operands[..]) {
            (Op::TypeBool, _) => {
                self.kinds.insert(id, Kind::Bool);
                return;
            }
            (Op::TypeInt, [Operand::LiteralBit32(32), Operand::LiteralBit32(sign)]) => {
                self.kinds.insert(id, Kind::Int);
                if *sign == 0 {
                    self.unsigned = Some(id);
                }
                return;
            }
            (Op::ConstantTrue, _) => 1,
            (Op::ConstantFalse | Op::ConstantNull, _) => 0,
            (Op::Constant, [Operand::LiteralBit32(value)]) => *value,
            _ => return,
        };
        if let Some(ty) = instruction.result_type.filter(|ty| self.kinds.contains_key(ty)) {
            self.values.insert(id, value);
            self.ids.entry((ty, value)).or_insert(id);
        }
    }

    /// Replaces operations on constants outside of functions by what they are.
    pub(super) fn fold_globals(&mut self, module: &mut Module) {
        for instruction in &mut module.types_global_values {
            let (Op::SpecConstantOp, Some(ty)) = (instruction.class.opcode, instruction.result_type) else { continue };
            let [Operand::LiteralSpecConstantOpInteger(op), operands @ ..] = &instruction.operands[..] else {
                continue;
            };
            let values: Vec<_> =
                operands.iter().map(|o| o.id_ref_any().map_or(Value::Varying, |id| self.value(id))).collect();
            if let (Value::Constant(value), Some(kind)) = (fold(*op, &values), self.kinds.get(&ty)) {
                *instruction = constant(*kind, ty, instruction.result_id, value);
                self.add(instruction);
            }
        }
    }

    /// Whether constants of a type are followed.
    pub(super) fn follows(&self, ty: u32) -> bool {
        self.kinds.contains_key(&ty)
    }

    /// The value of an id from outside of functions; others vary.
    fn value(&self, id: u32) -> Value {
        self.values.get(&id).map_or(Value::Varying, |value| Value::Constant(*value))
    }

    /// The values of all ids.
    pub(super) fn by_id(&self) -> Vec<Value> {
        let mut all = vec![Value::Varying; self.bound as usize];
        for (id, value) in &self.values {
            all[*id as usize] = Value::Constant(*value);
        }
        all
    }

    fn new_id(&mut self) -> u32 {
        self.bound += 1;
        self.bound - 1
    }

    /// The constant of a type that is followed.
    pub(super) fn id(&mut self, ty: u32, value: u32) -> u32 {
        if let Some(id) = self.ids.get(&(ty, value)) {
            return *id;
        }
        let id = self.new_id();
        let added = constant(self.kinds.get(&ty).copied().unwrap_or(Kind::Int), ty, Some(id), value);
        self.add(&added);
        self.added.push(added);
        id
    }

    /// An unsigned zero.
    pub(super) fn zero(&mut self) -> u32 {
        let ty = self.unsigned.unwrap_or_else(|| {
            let id = self.new_id();
            let operands = vec![Operand::LiteralBit32(32), Operand::LiteralBit32(0)];
            let added = Instruction::new(Op::TypeInt, None, Some(id), operands);
            self.add(&added);
            self.added.push(added);
            id
        });
        self.id(ty, 0)
    }

    /// A value of a type that is anything.
    pub(super) fn undefined(&mut self, ty: u32) -> u32 {
        if let Some(id) = self.undefined.get(&ty) {
            return *id;
        }
        let id = self.new_id();
        self.undefined.insert(ty, id);
        self.added.push(Instruction::new(Op::Undef, Some(ty), Some(id), Vec::new()));
        id
    }

    /// Adds the new ones to the module; returns the bound of its ids.
    pub(super) fn append_to(self, module: &mut Module) -> u32 {
        module.types_global_values.extend(self.added);
        self.bound
    }
}

fn constant(kind: Kind, ty: u32, id: Option<u32>, value: u32) -> Instruction {
    let (op, operands) = match (kind, value) {
        (Kind::Bool, 0) => (Op::ConstantFalse, Vec::new()),
        (Kind::Bool, _) => (Op::ConstantTrue, Vec::new()),
        (Kind::Int, _) => (Op::Constant, vec![Operand::LiteralBit32(value)]),
    };
    Instruction::new(op, Some(ty), id, operands)
}
