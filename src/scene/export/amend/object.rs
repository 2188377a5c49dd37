//! A JSON object whose members keep their order and their text until they are changed.

use std::fmt;

use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use serde::ser::{Serialize, SerializeMap, Serializer};
use serde_json::value::RawValue;

/// Names and texts of an object's members.
#[derive(Debug, Default)]
pub(super) struct Object(Vec<(String, Box<RawValue>)>);

/// A value as JSON text.
pub(super) fn raw(value: &impl Serialize) -> Box<RawValue> {
    // what this module is given has no keys but strings
    serde_json::value::to_raw_value(value).unwrap_or_default()
}

impl Object {
    /// Reads an object.
    pub(super) fn parse(text: &[u8]) -> serde_json::Result<Self> {
        serde_json::from_slice(text)
    }

    /// Text of a member.
    pub(super) fn get(&self, key: &str) -> Option<&RawValue> {
        self.0.iter().find(|(name, _)| name == key).map(|(_, value)| &**value)
    }

    /// Texts of the elements of a member that is a list; none where there is no such list.
    pub(super) fn list(&self, key: &str) -> Vec<Box<RawValue>> {
        self.get(key).and_then(|text| serde_json::from_str(text.get()).ok()).unwrap_or_default()
    }

    /// Sets a member, in its place if the object has it.
    pub(super) fn set(&mut self, key: &str, value: &impl Serialize) {
        let value = raw(value);
        match self.0.iter_mut().find(|(name, _)| name == key) {
            Some((_, old)) => *old = value,
            None => self.0.push((key.to_owned(), value)),
        }
    }

    /// Removes a member.
    pub(super) fn remove(&mut self, key: &str) {
        self.0.retain(|(name, _)| name != key);
    }

    /// Changes a member that is an object, if there is one.
    pub(super) fn change(&mut self, key: &str, change: impl FnOnce(&mut Object)) {
        let parsed = self.get(key).and_then(|text| Self::parse(text.get().as_bytes()).ok());
        if let Some(mut member) = parsed {
            change(&mut member);
            self.set(key, &member);
        }
    }
}

impl Serialize for Object {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        self.0.iter().try_for_each(|(key, value)| map.serialize_entry(key, value))?;
        map.end()
    }
}

impl<'de> Deserialize<'de> for Object {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Members;

        impl<'de> Visitor<'de> for Members {
            type Value = Object;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Object, A::Error> {
                let mut members = Vec::new();
                while let Some(member) = map.next_entry()? {
                    members.push(member);
                }
                Ok(Object(members))
            }
        }
        deserializer.deserialize_map(Members)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_changed_keeps_its_text() {
        let text = r#"{"z":[1.50, 2e+1 ],"a":{ "k" : "\u00e4" },"m":0.1000}"#;
        let mut object = Object::parse(text.as_bytes()).unwrap();
        assert_eq!(raw(&object).get(), text);
        object.set("m", &7);
        object.change("a", |a| a.set("n", &true));
        object.remove("none");
        object.set("new", &[1]);
        assert_eq!(raw(&object).get(), r#"{"z":[1.50, 2e+1 ],"a":{"k":"\u00e4","n":true},"m":7,"new":[1]}"#);
        assert_eq!(object.list("z").len(), 2);
        assert!(object.list("m").is_empty());
    }
}
