//! Declares records: memory that the CPU writes and shaders read, or vice versa. From one
//! declaration `records!` generates the `#[repr(C)]` struct, its documentation, and a table of its
//! fields; [`super::glsl`] generates the GLSL declaration from the table, and build.rs compares its
//! layout in SPIR-V with the table ([`mismatches`]).
//!
//! Types are GLSL's: `float`, `int`, `uint`, `vec2` to `vec4`, `uvec2` to `uvec4`, other records,
//! and arrays of these. Besides there are `address`, of device memory (`u64`; a `uvec2` in shaders,
//! which need no 64-bit integers then), and `bytes8` (`[u8; 8]`; a `uvec2`).

/// A file of records, which shaders include as `interface/NAME.glsl`.
#[derive(Debug)]
pub struct File {
    /// Name of the file, without its ending.
    pub name: &'static str,
    /// Other such files whose records it uses.
    pub includes: &'static [&'static str],
    /// Constants that Rust and GLSL share.
    pub values: &'static [Value],
    /// The records.
    pub records: &'static [Record],
}

/// A constant that Rust and GLSL share.
#[derive(Debug)]
pub struct Value {
    /// Name on both sides.
    pub name: &'static str,
    /// The number, in GLSL's type.
    pub number: Number,
    /// Documentation, in lines.
    pub doc: &'static [&'static str],
}

/// A number of one of GLSL's types.
#[derive(Clone, Copy, Debug)]
#[allow(non_camel_case_types, reason = "GLSL's names")]
pub enum Number {
    /// Unsigned, 32 bits.
    uint(u32),
    /// Single precision.
    float(f32),
}

/// A record.
#[derive(Debug)]
pub struct Record {
    /// Name on both sides.
    pub name: &'static str,
    /// How shaders access it.
    pub form: Form,
    /// Bytes on the CPU's side.
    pub size: usize,
    /// Fields, in order.
    pub fields: &'static [Field],
    /// Documentation, in lines.
    pub doc: &'static [&'static str],
}

/// A field of a record.
#[derive(Debug)]
pub struct Field {
    /// Name on both sides.
    pub name: &'static str,
    /// Type of the field, or of an array's elements.
    pub kind: &'static str,
    /// Lengths of an array's dimensions, the outer one first; empty: it is no array.
    pub counts: &'static [usize],
    /// Bytes from the beginning of the record on the CPU's side.
    pub offset: usize,
    /// Bytes on the CPU's side.
    pub size: usize,
    /// Documentation, in lines.
    pub doc: &'static [&'static str],
}

/// How shaders access a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A `struct`, part of other records or loaded by hand-written code.
    Structure,
    /// A `struct`, and a buffer of them by address.
    Array {
        /// Name of the buffer's type, whose member `v` is the array.
        buffer: &'static str,
        /// `readonly`, `writeonly`, or nothing.
        access: &'static str,
        /// Bytes that addresses of the buffer are a multiple of.
        align: usize,
    },
    /// A buffer by address that holds one record.
    Block {
        /// `readonly`, `writeonly`, or nothing.
        access: &'static str,
        /// Bytes that addresses of it are a multiple of.
        align: usize,
    },
    /// The push constants, as `push`.
    Push,
    /// Pairs of 32-bit words, loaded by hand-written code into `w0`, `w1`, ...: macros name the
    /// fields. For records of several kinds, or whose layout is not GLSL's.
    Words,
}

/// A record as the shader compiler laid it out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reflected {
    /// Name of the record.
    pub name: String,
    /// Name, offset and size of each member, bytes.
    pub members: Vec<(String, usize, usize)>,
    /// Bytes from one to the next in an array, where there is one.
    pub stride: Option<usize>,
}

/// Describes for each record the first field whose layout in SPIR-V differs from that in Rust.
pub fn mismatches<'a>(records: impl IntoIterator<Item = &'a Record>, reflected: &[Reflected]) -> Vec<String> {
    let mut out = Vec::new();
    for record in records.into_iter().filter(|r| r.form != Form::Words) {
        let name = record.name;
        let Some(other) = reflected.iter().find(|r| r.name == name) else {
            out.push(format!("record {name}: the check shader has none"));
            continue;
        };
        if record.fields.len() != other.members.len() {
            out.push(format!(
                "record {name}: {} fields in Rust, {} in SPIR-V",
                record.fields.len(),
                other.members.len()
            ));
        }
        // the fields after a misplaced one are misplaced, too: report the first
        let mut pairs = record.fields.iter().zip(&other.members);
        if let Some((field, (member, offset, size))) = pairs
            .find(|(field, (member, offset, size))| (field.name, field.offset, field.size) != (member, *offset, *size))
        {
            out.push(format!(
                "record {name}: field {} is {} bytes at offset {} in Rust, {member} is {size} bytes at offset {offset} in SPIR-V",
                field.name, field.size, field.offset
            ));
        }
        let is_in_arrays = matches!(record.form, Form::Structure | Form::Array { .. });
        if is_in_arrays && other.stride != Some(record.size) {
            let stride = other.stride.map_or("no array".to_owned(), |s| format!("{s} bytes"));
            out.push(format!("record {name}: {} bytes in Rust, {stride} from one to the next in SPIR-V", record.size));
        }
    }
    out
}

/// The Rust types of GLSL's types, by their names there.
#[allow(non_camel_case_types, reason = "GLSL's names")]
pub mod types {
    /// Single precision.
    pub type float = f32;
    /// Signed, 32 bits.
    pub type int = i32;
    /// Unsigned, 32 bits.
    pub type uint = u32;
    /// Two floats.
    pub type vec2 = [f32; 2];
    /// Three floats.
    pub type vec3 = [f32; 3];
    /// Four floats.
    pub type vec4 = [f32; 4];
    /// Two unsigned numbers.
    pub type uvec2 = [u32; 2];
    /// Three unsigned numbers.
    pub type uvec3 = [u32; 3];
    /// Four unsigned numbers.
    pub type uvec4 = [u32; 4];
    /// An address of device memory; a `uvec2` in shaders.
    pub type address = u64;
    /// Eight bytes; a `uvec2` in shaders.
    pub type bytes8 = [u8; 8];
}

/// Declares the records of a file: its name, the files that it includes, constants, and for each
/// record its [`Form`] and its fields.
macro_rules! records {
    // the type of a field: no array, or one of one or two dimensions
    (@type $kind:ident) => {
        $kind
    };
    (@type $kind:ident [$count:expr]) => {
        [$kind; $count]
    };
    (@type $kind:ident [$outer:expr] [$inner:expr]) => {
        [[$kind; $inner]; $outer]
    };
    (
        $file:literal
        $(includes $($include:literal)+)?
        $(values {
            $($(#[doc = $value_doc:literal])* $value:ident: $value_kind:ident = $number:expr;)*
        })?;
        $(
            $(#[doc = $doc:literal])*
            $name:ident: $form:ident $(($($part:ident: $value_of_part:expr),*))? {
                $($(#[doc = $field_doc:literal])* $field:ident: $kind:ident $([$count:expr])*,)*
            }
        )*
    ) => {
        #[allow(unused_imports, reason = "a file may have values alone, or records alone")]
        use $crate::interface::layout::{Field, File, Form, Number, Record, Value, types::*};
        $($(
            $(#[doc = $value_doc])*
            pub const $value: $value_kind = $number;
        )*)?
        $(
            $(#[doc = $doc])*
            #[repr(C)]
            #[derive(Clone, Copy, Debug, Default, PartialEq)]
            #[cfg_attr(library, derive(bytemuck::Pod, bytemuck::Zeroable))]
            pub struct $name {
                $($(#[doc = $field_doc])* pub $field: records!(@type $kind $([$count])*),)*
            }
        )*
        /// The table from which the GLSL declarations are generated.
        pub const FILE: File = File {
            name: $file,
            includes: &[$($($include),+)?],
            values: &[$($(Value {
                name: stringify!($value),
                number: Number::$value_kind($value),
                doc: &[$($value_doc),*],
            },)*)?],
            records: &[$(Record {
                name: stringify!($name),
                form: Form::$form $({ $($part: $value_of_part),* })?,
                size: size_of::<$name>(),
                fields: &[$(Field {
                    name: stringify!($field),
                    kind: stringify!($kind),
                    counts: &[$($count),*],
                    offset: core::mem::offset_of!($name, $field),
                    size: size_of::<records!(@type $kind $([$count])*)>(),
                    doc: &[$($field_doc),*],
                },)*],
                doc: &[$($doc),*],
            },)*],
        };
    };
}
