//! The options of paths that shaders read, a record made of the list in src/interface/path_options.rs.

use super::super::path_options::path_options;

macro_rules! option_record {
    ($(
        $(#[doc = $doc:literal])+
        $field:ident: $type:ident as $kind:ident = $default:expr, setting($($setting:tt)*)
        $(, feature($feature:ident = $constant:literal, $label:literal))? $(, remark($remark:literal))?;
    )*) => {
        /// Words that fill up the record to a multiple of 16 bytes, one at least.
        const PADDING: usize = 4 - [$(stringify!($field)),*].len() % 4;

        records! {
            "path_options";

            /// Options of paths, each of which the list in src/interface/path_options.rs declares.
            PathOptionsRecord: structure {
                $(
                    $(#[doc = $doc])+
                    $field: $kind,
                )*
                /// Padding to a multiple of 16 bytes.
                reserved: uint[PADDING],
            }
        }
    };
}
path_options!(option_record);
