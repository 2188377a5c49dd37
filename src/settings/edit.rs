//! Settings as an editor sees them: names, help and values, from which a panel is made.

use std::path::PathBuf;

use glam::DVec3;

use super::{AppliesTo, Length, Level};

/// A setting and its current value.
pub struct Setting<'a> {
    /// Name in files: `max_depth`.
    pub name: &'static str,
    /// Help text of the command line.
    pub help: &'static str,
    /// Integrators and images on which the setting has an effect.
    pub applies: AppliesTo,
    /// Who needs it.
    pub level: Level,
    /// The value, to be changed in place.
    pub value: Value<'a>,
}

/// The value of a setting, to be read or changed. `None`: the setting was not given.
pub enum Value<'a> {
    /// On or off.
    Flag(&'a mut bool),
    /// A whole number.
    Count(&'a mut Option<u32>),
    /// A number.
    Number(&'a mut Option<f64>),
    /// A length of the scene.
    Length(&'a mut Option<Length>),
    /// One of several named values.
    Choice(&'a mut dyn ChoiceValue),
    /// A value that has an editor of its own, or none.
    Other,
}

impl Setting<'_> {
    /// Returns true if the setting was given.
    pub fn is_given(&self) -> bool {
        match &self.value {
            Value::Flag(flag) => **flag,
            Value::Count(count) => count.is_some(),
            Value::Number(number) => number.is_some(),
            Value::Length(length) => length.is_some(),
            Value::Choice(choice) => choice.selected().is_some(),
            Value::Other => false,
        }
    }

    /// Removes the value, so that the default holds.
    pub fn clear(&mut self) {
        match &mut self.value {
            Value::Flag(flag) => **flag = false,
            Value::Count(count) => **count = None,
            Value::Number(number) => **number = None,
            Value::Length(length) => **length = None,
            Value::Choice(choice) => choice.select(None),
            Value::Other => {}
        }
    }
}

/// An enumeration of named values, as the macro `choices!` declares them.
pub trait Choice: Copy + PartialEq + 'static {
    /// All values, in the order in which they are listed.
    const ALL: &'static [Self];

    /// Name on the command line and in files.
    fn name(self) -> &'static str;

    /// Description in one line.
    fn help(self) -> &'static str;
}

/// A named value among several, or none.
pub trait ChoiceValue {
    /// Names and descriptions of all values.
    fn alternatives(&self) -> Vec<(&'static str, &'static str)>;

    /// Index of the value.
    fn selected(&self) -> Option<usize>;

    /// Sets the value by its index; an index out of range clears it.
    fn select(&mut self, index: Option<usize>);
}

impl<T: Choice> ChoiceValue for Option<T> {
    fn alternatives(&self) -> Vec<(&'static str, &'static str)> {
        T::ALL.iter().map(|v| (v.name(), v.help())).collect()
    }

    fn selected(&self) -> Option<usize> {
        self.and_then(|value| T::ALL.iter().position(|v| *v == value))
    }

    fn select(&mut self, index: Option<usize>) {
        *self = index.and_then(|k| T::ALL.get(k).copied());
    }
}

/// A type of settings.
pub trait Editable {
    /// The value, as editors see it.
    fn value(&mut self) -> Value<'_>;
}

impl Editable for bool {
    fn value(&mut self) -> Value<'_> {
        Value::Flag(self)
    }
}

impl Editable for Option<u32> {
    fn value(&mut self) -> Value<'_> {
        Value::Count(self)
    }
}

impl Editable for Option<f64> {
    fn value(&mut self) -> Value<'_> {
        Value::Number(self)
    }
}

impl Editable for Option<Length> {
    fn value(&mut self) -> Value<'_> {
        Value::Length(self)
    }
}

impl<T: Choice> Editable for Option<T> {
    fn value(&mut self) -> Value<'_> {
        Value::Choice(self)
    }
}

// types without an editor of their own
impl Editable for Option<String> {
    fn value(&mut self) -> Value<'_> {
        Value::Other
    }
}

impl Editable for Option<PathBuf> {
    fn value(&mut self) -> Value<'_> {
        Value::Other
    }
}

impl Editable for Option<DVec3> {
    fn value(&mut self) -> Value<'_> {
        Value::Other
    }
}

impl Editable for Option<[u32; 2]> {
    fn value(&mut self) -> Value<'_> {
        Value::Other
    }
}

impl<T> Editable for Vec<T> {
    fn value(&mut self) -> Value<'_> {
        Value::Other
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{AppliesTo, choices, settings};

    choices! {
        /// A colour.
        enum Colour {
            /// Like blood
            Red = "red",
            /// Like grass
            Green = "green",
        }
    }

    settings! {
        /// For this test.
        "Test"
        struct Some {
            /// Colour [default: red]
            colour: Option<Colour>, option(), applies(AppliesTo::ALL);
            /// Number of things
            /// in two lines
            many: Option<u32>, option(), applies(AppliesTo::ALL);
            /// Whether
            on: bool, option(), applies(AppliesTo::ALL);
            /// Name
            name: Option<String>, option(), applies(AppliesTo::ALL);
        }
    }

    #[test]
    fn settings_are_edited_by_name() {
        let mut some = Some::default();
        for setting in some.editable() {
            assert!(!setting.is_given());
            match (setting.name, setting.value) {
                ("colour", Value::Choice(choice)) => {
                    assert_eq!(choice.alternatives(), [("red", "Like blood"), ("green", "Like grass")]);
                    choice.select(Option::Some(1));
                }
                ("many", Value::Count(count)) => {
                    assert_eq!(setting.help, "Number of things in two lines");
                    *count = Option::Some(3);
                }
                ("on", Value::Flag(flag)) => *flag = true,
                ("name", Value::Other) => {}
                (other, _) => panic!("{other}"),
            }
        }
        assert_eq!(some, Some { colour: Option::Some(Colour::Green), many: Option::Some(3), on: true, name: None });
        assert_eq!(some.given().len(), 3);
        let mut one = Some::default();
        one.override_with(&some);
        one.retain(&|name, _| name == "on");
        assert_eq!(one, Some { on: true, ..Default::default() });
        some.editable().iter_mut().for_each(Setting::clear);
        assert_eq!(some, Some::default());
    }
}
