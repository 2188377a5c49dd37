//! Arithmetic on constants.

use rspirv::spirv::Op;

/// The knowledge of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Value {
    /// Nothing yet: the code that computes it has not been seen to run.
    Unseen,
    /// It is this in every run: an integer's bits, or 0 or 1 for a bool.
    Constant(u32),
    /// It varies, or is of a type that is not followed.
    Varying,
}

/// Folds an operation on booleans or 32-bit integers; [`Value::Varying`] for all others.
pub(super) fn fold(op: Op, operands: &[Value]) -> Value {
    use Value::{Constant, Unseen, Varying};
    if let Some(value) = decided(op, operands) {
        return Constant(value);
    }
    if !is_folded(op) || operands.contains(&Varying) {
        return Varying;
    }
    match *operands {
        _ if operands.contains(&Unseen) => Unseen,
        [Constant(a)] => unary(op, a).map_or(Varying, Constant),
        [Constant(a), Constant(b)] => binary(op, a, b).map_or(Varying, Constant),
        [Constant(condition), Constant(a), Constant(b)] if op == Op::Select => {
            Constant(if condition != 0 { a } else { b })
        }
        _ => Varying,
    }
}

/// The value if one operand alone decides.
fn decided(op: Op, operands: &[Value]) -> Option<u32> {
    let any = |value| operands.contains(&Value::Constant(value));
    match op {
        Op::LogicalAnd | Op::BitwiseAnd | Op::IMul if any(0) => Some(0),
        Op::LogicalOr if any(1) => Some(1),
        _ => None,
    }
}

/// Position of the operand that an operation returns unchanged, because the others are constants.
pub(super) fn unchanged(op: Op, operands: &[Value]) -> Option<usize> {
    let neutral = match op {
        Op::Select => {
            return match operands {
                [Value::Constant(condition), ..] => Some(if *condition != 0 { 1 } else { 2 }),
                _ => None,
            };
        }
        Op::CopyObject => return Some(0),
        Op::LogicalAnd => 1,
        Op::LogicalOr => 0,
        _ => return None,
    };
    match operands {
        [Value::Constant(c), _] if *c == neutral => Some(1),
        [_, Value::Constant(c)] if *c == neutral => Some(0),
        _ => None,
    }
}

fn is_folded(op: Op) -> bool {
    op == Op::Select || unary(op, 0).is_some() || binary(op, 1, 1).is_some()
}

fn unary(op: Op, a: u32) -> Option<u32> {
    Some(match op {
        Op::CopyObject | Op::Bitcast => a,
        Op::LogicalNot => u32::from(a == 0),
        Op::Not => !a,
        Op::SNegate => a.wrapping_neg(),
        Op::BitCount => a.count_ones(),
        _ => return None,
    })
}

fn binary(op: Op, a: u32, b: u32) -> Option<u32> {
    let [s, t] = [a, b].map(|x| x as i32);
    let bool = u32::from;
    Some(match op {
        Op::LogicalEqual | Op::IEqual => bool(a == b),
        Op::LogicalNotEqual | Op::INotEqual => bool(a != b),
        Op::LogicalAnd | Op::BitwiseAnd => a & b,
        Op::LogicalOr | Op::BitwiseOr => a | b,
        Op::BitwiseXor => a ^ b,
        Op::UGreaterThan => bool(a > b),
        Op::UGreaterThanEqual => bool(a >= b),
        Op::ULessThan => bool(a < b),
        Op::ULessThanEqual => bool(a <= b),
        Op::SGreaterThan => bool(s > t),
        Op::SGreaterThanEqual => bool(s >= t),
        Op::SLessThan => bool(s < t),
        Op::SLessThanEqual => bool(s <= t),
        Op::IAdd => a.wrapping_add(b),
        Op::ISub => a.wrapping_sub(b),
        Op::IMul => a.wrapping_mul(b),
        // undefined where the divisor is zero or the quotient overflows: the driver decides
        Op::UDiv => a.checked_div(b)?,
        Op::UMod => a.checked_rem(b)?,
        Op::SDiv => s.checked_div(t)? as u32,
        // and where as many bits are shifted as there are
        Op::ShiftLeftLogical => a.checked_shl(b)?,
        Op::ShiftRightLogical => a.checked_shr(b)?,
        Op::ShiftRightArithmetic => s.checked_shr(b)? as u32,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use Value::{Constant, Unseen, Varying};

    #[test]
    fn arithmetic_is_that_of_spirv() {
        let minus = |x: i32| Constant(x as u32);
        for (op, a, b, expected) in [
            (Op::IAdd, minus(-1), Constant(3), Constant(2)),
            (Op::ISub, Constant(1), Constant(3), minus(-2)),
            (Op::IMul, minus(-2), Constant(3), minus(-6)),
            (Op::UDiv, minus(-2), Constant(2), Constant(0x7fff_ffff)),
            (Op::SDiv, minus(-3), Constant(2), minus(-1)),
            (Op::UDiv, Constant(1), Constant(0), Varying),
            (Op::SDiv, minus(i32::MIN), minus(-1), Varying),
            (Op::UMod, Constant(7), Constant(4), Constant(3)),
            (Op::SLessThan, minus(-1), Constant(0), Constant(1)),
            (Op::ULessThan, minus(-1), Constant(0), Constant(0)),
            (Op::SGreaterThanEqual, minus(-1), minus(-1), Constant(1)),
            (Op::ULessThanEqual, Constant(2), Constant(2), Constant(1)),
            (Op::ShiftRightArithmetic, minus(-8), Constant(1), minus(-4)),
            (Op::ShiftRightLogical, minus(-8), Constant(31), Constant(1)),
            (Op::ShiftLeftLogical, Constant(1), Constant(32), Varying),
            (Op::BitwiseXor, Constant(5), Constant(1), Constant(4)),
            (Op::LogicalNotEqual, Constant(1), Constant(0), Constant(1)),
            (Op::FAdd, Constant(0), Constant(0), Varying),
        ] {
            assert_eq!(fold(op, &[a, b]), expected, "{op:?} {a:?} {b:?}");
        }
        assert_eq!(fold(Op::Not, &[Constant(0)]), Constant(u32::MAX));
        assert_eq!(fold(Op::LogicalNot, &[Constant(1)]), Constant(0));
        assert_eq!(fold(Op::SNegate, &[Constant(1)]), minus(-1));
        assert_eq!(fold(Op::BitCount, &[Constant(0xff)]), Constant(8));
        assert_eq!(fold(Op::Select, &[Constant(0), Constant(1), Constant(2)]), Constant(2));
    }

    #[test]
    fn one_operand_can_decide() {
        for other in [Unseen, Varying] {
            assert_eq!(fold(Op::LogicalAnd, &[other, Constant(0)]), Constant(0));
            assert_eq!(fold(Op::LogicalOr, &[Constant(1), other]), Constant(1));
            assert_eq!(fold(Op::LogicalAnd, &[other, Constant(1)]), other);
            assert_eq!(fold(Op::BitwiseAnd, &[Constant(0), other]), Constant(0));
            assert_eq!(fold(Op::IAdd, &[Constant(0), other]), other);
        }
        assert_eq!(unchanged(Op::LogicalAnd, &[Varying, Constant(1)]), Some(0));
        assert_eq!(unchanged(Op::LogicalOr, &[Constant(0), Varying]), Some(1));
        assert_eq!(unchanged(Op::LogicalOr, &[Varying, Varying]), None);
        assert_eq!(unchanged(Op::Select, &[Constant(1), Varying, Varying]), Some(1));
        assert_eq!(unchanged(Op::Select, &[Varying, Constant(1), Constant(0)]), None);
    }
}
