//! What the program is made of, held against deny.toml without cargo-deny and without a network: where packages come from, their licences, and packages of several versions.
//! Known vulnerabilities are what cargo-deny alone knows.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use toml::{Table, Value};

const REGISTRY: &str = "registry+https://github.com/rust-lang/crates.io-index";

fn read(name: &str) -> Table {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
    toml::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap_or_else(|e| panic!("{name}: {e}"))
}

fn deny(section: &str) -> Table {
    read("deny.toml")[section].as_table().unwrap().clone()
}

fn text<'a>(table: &'a Table, key: &str) -> &'a str {
    table.get(key).and_then(Value::as_str).unwrap_or_default()
}

fn texts(value: &Value) -> BTreeSet<String> {
    value.as_array().unwrap().iter().map(|v| v.as_str().unwrap().to_owned()).collect()
}

/// The tables of an array of deny.toml, each with a reason of more than a word.
fn reasoned(section: &str, key: &str) -> Vec<Table> {
    let entries: Vec<Table> =
        deny(section)[key].as_array().unwrap().iter().map(|e| e.as_table().unwrap().clone()).collect();
    for entry in &entries {
        assert!(!text(entry, "reason").is_empty(), "{entry:?}: without a reason");
    }
    entries
}

/// Packages of a lock file.
fn locked(name: &str) -> Vec<Table> {
    read(name)["package"].as_array().unwrap().iter().map(|p| p.as_table().unwrap().clone()).collect()
}

/// `scripts/fuzz.sh` builds with `--locked`: its lock file has every package that the program needs whatever its features.
#[test]
fn fuzz_targets_are_locked() {
    let manifest = read("Cargo.toml");
    let needed = |table: &Table| -> Vec<String> {
        let kinds =
            ["dependencies", "build-dependencies"].iter().filter_map(|kind| table.get(*kind)?.as_table().cloned());
        let is_optional = |value: &Value| value.get("optional").and_then(Value::as_bool) == Some(true);
        kinds.flatten().filter(|(_, value)| !is_optional(value)).map(|(name, _)| name).collect()
    };
    let of_targets =
        manifest["target"].as_table().unwrap().values().flat_map(|table| needed(table.as_table().unwrap()));
    let packages = locked("fuzz/Cargo.lock");
    let own = packages.iter().find(|package| text(package, "name") == "skylit").unwrap();
    // a name, with the version where there are several
    let listed: Vec<String> =
        texts(&own["dependencies"]).iter().map(|entry| entry.split(' ').next().unwrap().to_owned()).collect();
    for name in needed(&manifest).into_iter().chain(of_targets) {
        assert!(listed.contains(&name), "{name}: run `cargo update --workspace --manifest-path fuzz/Cargo.toml`");
    }
}

/// Packages come from the registry, with a checksum, or lie in this repository.
#[test]
fn sources() {
    assert_eq!(deny("sources")["unknown-registry"].as_str(), Some("deny"));
    assert_eq!(deny("sources")["unknown-git"].as_str(), Some("deny"));
    let allowed: BTreeSet<String> =
        texts(&deny("sources")["allow-registry"]).into_iter().map(|url| format!("registry+{url}")).collect();
    assert!(allowed.contains(REGISTRY));
    let own = ["skylit", "skylit-fuzz", "shaderc-libraries"];
    for lock in ["Cargo.lock", "fuzz/Cargo.lock"] {
        for package in locked(lock) {
            let (name, source) = (text(&package, "name"), text(&package, "source"));
            match source {
                "" => assert!(own.contains(&name), "{lock}: {name} has no source"),
                _ => assert!(
                    allowed.contains(source) && text(&package, "checksum").len() == 64,
                    "{lock}: {name}: {source}"
                ),
            }
        }
    }
}

/// Each package has one version, or deny.toml says who still asks for the older ones; and what it says is so.
#[test]
fn versions() {
    let mut versions: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for package in locked("Cargo.lock") {
        versions.entry(text(&package, "name").to_owned()).or_default().push(text(&package, "version").to_owned());
    }
    let skipped: BTreeSet<String> = reasoned("bans", "skip").iter().map(|e| text(e, "crate").to_owned()).collect();
    for (name, versions) in &versions {
        let left: Vec<_> = versions.iter().filter(|v| !skipped.contains(&format!("{name}@{v}"))).collect();
        assert!(left.len() == 1, "{name} has the versions {versions:?}, of which deny.toml skips all but {left:?}");
    }
    for entry in &skipped {
        let (name, version) = entry.split_once('@').unwrap();
        assert!(
            versions.get(name).is_some_and(|v| v.len() > 1 && v.iter().any(|v| v == version)),
            "{entry} is not needed"
        );
    }
}

/// Advisories that are ignored are about packages that are still there.
#[test]
fn ignored_advisories() {
    let names: BTreeSet<String> = locked("Cargo.lock").iter().map(|p| text(p, "name").to_owned()).collect();
    for entry in reasoned("advisories", "ignore") {
        let about = text(&entry, "reason").split(' ').next().unwrap();
        assert!(text(&entry, "id").starts_with("RUSTSEC-") && names.contains(about), "{entry:?}: {about} is gone");
    }
}

/// Words of a licence expression (SPDX); old packages write `/` for OR.
fn words(expression: &str) -> Vec<String> {
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    spaced.split_whitespace().map(str::to_owned).collect()
}

/// Whether an expression holds, from its words: OR of AND of licences and parentheses. Takes the words that it has read.
fn is_allowed(words: &mut &[String], allowed: &BTreeSet<String>) -> bool {
    let mut holds = false;
    loop {
        let mut all = true;
        loop {
            let (first, rest) = words.split_first().expect("a licence is missing");
            *words = rest;
            let one = if first == "(" {
                let inside = is_allowed(words, allowed);
                assert_eq!(words.first().map(String::as_str), Some(")"));
                *words = &words[1..];
                inside
            } else if words.first().is_some_and(|w| w == "WITH") {
                let name = format!("{first} WITH {}", words[1]);
                *words = &words[2..];
                allowed.contains(&name)
            } else {
                allowed.contains(first)
            };
            all &= one;
            match words.first().map(String::as_str) {
                Some("AND") => *words = &words[1..],
                _ => break,
            }
        }
        holds |= all;
        match words.first().map(String::as_str) {
            Some("OR") => *words = &words[1..],
            _ => return holds,
        }
    }
}

fn allows(expression: &str, allowed: &BTreeSet<String>) -> bool {
    let words = words(expression);
    let mut rest = words.as_slice();
    let holds = is_allowed(&mut rest, allowed);
    assert!(rest.is_empty(), "{expression}");
    holds
}

#[test]
fn expressions_of_licences() {
    let allowed = ["MIT", "Zlib"].map(str::to_owned).into();
    for good in [
        "MIT",
        "MIT/Apache-2.0",
        "GPL-3.0 OR MIT",
        "MIT AND Zlib",
        "(GPL-3.0 OR MIT) AND Zlib",
        "GPL-3.0 AND MIT OR Zlib",
    ] {
        assert!(allows(good, &allowed), "{good}");
    }
    for bad in
        ["GPL-3.0", "MIT AND GPL-3.0", "(MIT OR Zlib) AND GPL-3.0", "MIT WITH LLVM-exception", "GPL-3.0/LGPL-3.0"]
    {
        assert!(!allows(bad, &allowed), "{bad}");
    }
}

/// Every package that is compiled here has a licence that deny.toml allows.
#[test]
fn licences() {
    let run = |program: &str, args: &[&str]| {
        let out = Command::new(program).args(args).current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
        assert!(out.status.success(), "{program}: {}", String::from_utf8_lossy(&out.stderr));
        String::from_utf8(out.stdout).unwrap()
    };
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    let version = run("rustc", &["-vV"]);
    let host = version.lines().find_map(|l| l.strip_prefix("host: ")).unwrap();
    // what other systems need has not been downloaded; cargo-deny looks at it
    let args = ["metadata", "--locked", "--offline", "--format-version", "1", "--filter-platform", host];
    let metadata: serde_json::Value = serde_json::from_str(&run(&cargo, &args)).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    assert!(packages.len() > 100);

    let licences = deny("licenses");
    let allowed = texts(&licences["allow"]);
    let exceptions: BTreeMap<String, BTreeSet<String>> = licences["exceptions"]
        .as_array()
        .unwrap()
        .iter()
        .map(|e| e.as_table().unwrap())
        .map(|e| (text(e, "crate").to_owned(), texts(&e["allow"])))
        .collect();
    for package in packages {
        let name = package["name"].as_str().unwrap();
        let expression = package["license"].as_str().unwrap_or_else(|| panic!("{name} names no licence"));
        let mut allowed = allowed.clone();
        allowed.extend(exceptions.get(name).cloned().unwrap_or_default());
        assert!(allows(expression, &allowed), "{name} is under {expression}, which deny.toml does not allow");
    }
}
