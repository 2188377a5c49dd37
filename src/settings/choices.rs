//! The macro that declares named alternatives. build.rs includes this file, because some of them
//! are numbers in shaders (`src/interface`); it does without what `cfg(library)` adds.

/// Declares an enumeration of named values: `/// help` and `Variant = "name",` each.
///
/// The first is the default unless another is named. A variant's documentation is its help text.
macro_rules! choices {
    (
        $(#[$meta:meta])*
        $vis:vis enum $type:ident $((default $default:ident))? {
            $(
                $(#[doc = $doc:literal])+
                $variant:ident = $name:literal,
            )+
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[cfg_attr(library, derive(serde::Serialize, serde::Deserialize))]
        $vis enum $type {
            $(
                $(#[doc = $doc])+
                #[cfg_attr(library, serde(rename = $name))]
                $variant,
            )+
        }

        impl $type {
            /// All variants.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$variant),+];

            /// Name on the command line and in files.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)+
                }
            }

            /// Description in one line.
            pub fn help(self) -> &'static str {
                match self {
                    $(Self::$variant => concat!($($doc),+).trim(),)+
                }
            }
        }

        impl Default for $type {
            fn default() -> Self {
                [$(Self::$default,)? Self::ALL[0]][0]
            }
        }

        #[cfg(library)]
        impl $crate::settings::Choice for $type {
            const ALL: &'static [Self] = &Self::ALL;

            fn name(self) -> &'static str {
                self.name()
            }

            fn help(self) -> &'static str {
                self.help()
            }
        }

        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.pad(self.name())
            }
        }

        #[cfg(all(library, feature = "cli"))]
        impl clap::ValueEnum for $type {
            fn value_variants<'a>() -> &'a [Self] {
                &Self::ALL
            }

            fn to_possible_value(&self) -> Option<clap::builder::PossibleValue> {
                Some(clap::builder::PossibleValue::new(self.name()).help(self.help()))
            }
        }
    };
}
pub(crate) use choices;
