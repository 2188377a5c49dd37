//! Memory that files may take. What is loaded together, a scene or the images of a comparison,
//! shares one [`Budget`], and asks it before memory is taken for what a header promises: a file of
//! 32 bytes can name an image of a gigabyte, and accessors without data or nodes that share a mesh
//! multiply what little a file holds.
//!
//! Unless the user says how much may be taken (`--memory-limit`), it is at most half of the
//! machine's memory, and at most [`FREE`] more than [`PER_BYTE`] times the bytes that were read:
//! images of one colour, which compress best of all that people use, stay far below.

#[cfg(target_os = "linux")]
use std::path::Path;
use std::sync::{Mutex, OnceLock, PoisonError};

use bytesize::ByteSize;

use crate::error::{Error, Result};

/// Bytes that may be taken whatever was read.
const FREE: u64 = 1 << 30;
/// Bytes that may be taken for each byte that was read.
const PER_BYTE: u64 = 256;
/// Bytes that are taken for the machine's memory where the system does not tell.
const UNKNOWN: u64 = 8 << 30;

static LIMIT: OnceLock<u64> = OnceLock::new();

/// Sets how much budgets that are made from now on may give, in bytes, in place of what follows
/// from the machine. The first call counts.
pub fn set_limit(bytes: u64) {
    let _ = LIMIT.set(bytes);
}

/// The memory that files which are loaded together may take.
#[derive(Debug)]
pub struct Budget {
    /// Bytes.
    limit: u64,
    /// Whether what was read limits it, too.
    follows_files: bool,
    account: Mutex<Account>,
}

#[derive(Debug, Default)]
struct Account {
    /// Bytes of files.
    read: u64,
    /// Bytes of memory.
    taken: u64,
    /// Why a request was refused: the first one.
    refused: Option<String>,
}

/// Bytes that files which are loaded together may take at most.
pub fn limit() -> u64 {
    LIMIT.get().copied().unwrap_or_else(|| machine_memory() / 2)
}

impl Default for Budget {
    fn default() -> Self {
        Self { follows_files: LIMIT.get().is_none(), ..Self::with_limit(limit()) }
    }
}

impl Budget {
    /// Creates a budget of `limit` bytes, whatever is read.
    pub fn with_limit(limit: u64) -> Self {
        Self { limit, follows_files: false, account: Mutex::default() }
    }

    /// Notes that bytes of a file were read.
    pub fn read(&self, bytes: usize) {
        let mut account = self.account.lock().unwrap_or_else(PoisonError::into_inner);
        account.read = account.read.saturating_add(bytes as u64);
    }

    /// Takes bytes for `what`, a noun phrase that begins the sentence of an error. What was taken
    /// is not given back: a budget is of one load.
    ///
    /// # Errors
    /// Why they are not to be had, as the end of a sentence. [`Budget::check`] says the same, also
    /// where this error has become a warning.
    pub fn take(&self, bytes: u64, what: impl Fn() -> String) -> Result<(), String> {
        self.take_for_now(bytes, 0, what)
    }

    /// As [`Budget::take`]; `besides`: bytes that are needed until what is kept is made.
    ///
    /// # Errors
    /// Those of [`Budget::take`].
    pub fn take_for_now(&self, bytes: u64, besides: u64, what: impl Fn() -> String) -> Result<(), String> {
        self.take_named(bytes, besides, &what)
    }

    fn take_named(&self, bytes: u64, besides: u64, what: &dyn Fn() -> String) -> Result<(), String> {
        let mut account = self.account.lock().unwrap_or_else(PoisonError::into_inner);
        if account.refused.is_some() {
            return Err("is left out: the memory that this load may take is used up".to_owned());
        }
        let kept = account.taken.saturating_add(bytes);
        let all = kept.saturating_add(besides);
        let of_files = FREE.saturating_add(account.read.saturating_mul(PER_BYTE));
        let reason = if all > self.limit {
            format!("more than the {} that files loaded together may take", size(self.limit))
        } else if self.follows_files && all > of_files {
            format!("more than {} of files make likely", size(account.read))
        } else {
            account.taken = kept;
            return Ok(());
        };
        let before = if account.taken > 0 { " with what was loaded before" } else { "" };
        let enough = (all / (1 << 30) + 1).saturating_mul(3 << 29);
        let remedy = if enough < machine_memory() {
            format!("if that is meant, allow it: --memory-limit {}", size(enough).replace(' ', ""))
        } else {
            format!("--memory-limit would allow it, but this machine has {}", size(machine_memory()))
        };
        let message = format!("takes {}{before}, {reason}; {remedy}", size(all));
        account.refused = Some(format!("{} {message}", what()));
        Err(message)
    }

    /// Fails if a request was refused.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] with what was asked for first and could not be had.
    pub fn check(&self) -> Result<()> {
        match &self.account.lock().unwrap_or_else(PoisonError::into_inner).refused {
            // names in files may have control characters
            Some(message) => Err(Error::OutOfMemory(message.replace(char::is_control, " "))),
            None => Ok(()),
        }
    }
}

fn size(bytes: u64) -> String {
    ByteSize(bytes).display().iec().to_string()
}

/// Bytes that this process can have: the machine's memory, or what its control group or its limit
/// of address space leaves of it.
fn machine_memory() -> u64 {
    static MEMORY: OnceLock<u64> = OnceLock::new();
    *MEMORY
        .get_or_init(|| [physical(), control_group(), address_space()].into_iter().flatten().min().unwrap_or(UNKNOWN))
}

#[cfg(target_os = "linux")]
fn physical() -> Option<u64> {
    let system = rustix::system::sysinfo();
    #[allow(clippy::useless_conversion, reason = "the system's word, which has 32 bits on some machines")]
    Some(u64::from(system.totalram).saturating_mul(u64::from(system.mem_unit.max(1))))
}

#[cfg(target_os = "linux")]
fn control_group() -> Option<u64> {
    let groups = std::fs::read_to_string("/proc/self/cgroup").ok()?;
    group_limit(&groups, |file| std::fs::read_to_string(file).ok()?.trim().parse().ok())
}

/// The smallest limit of a process's control groups and those above them, bytes. `groups`: what
/// /proc/self/cgroup says, of either version (cgroups(7)); `limit` reads a file.
#[cfg(target_os = "linux")]
fn group_limit(groups: &str, limit: impl Fn(&Path) -> Option<u64>) -> Option<u64> {
    let smallest = |line: &str| {
        // number of the hierarchy, its controllers (none in version 2), the group
        let mut parts = line.splitn(3, ':').skip(1);
        let (controllers, group) = (parts.next()?, parts.next()?);
        let (mount, file) = match controllers {
            "" => ("/sys/fs/cgroup", "memory.max"),
            some if some.split(',').any(|c| c == "memory") => ("/sys/fs/cgroup/memory", "memory.limit_in_bytes"),
            _ => return None,
        };
        let group = Path::new(mount).join(group.trim_start_matches('/'));
        group
            .ancestors()
            .take_while(|folder| folder.starts_with(mount))
            .filter_map(|folder| limit(&folder.join(file)))
            .min()
    };
    groups.lines().filter_map(smallest).min()
}

#[cfg(not(target_os = "linux"))]
fn physical() -> Option<u64> {
    None
}

#[cfg(not(target_os = "linux"))]
fn control_group() -> Option<u64> {
    None
}

#[cfg(target_os = "linux")]
fn address_space() -> Option<u64> {
    rustix::process::getrlimit(rustix::process::Resource::As).current
}

#[cfg(not(target_os = "linux"))]
fn address_space() -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Control groups of both versions, and a container whose own group is the root of what it
    /// sees.
    #[test]
    #[cfg(target_os = "linux")]
    fn limits_of_control_groups() {
        let limit = |groups: &str, files: &[(&str, u64)]| {
            group_limit(groups, |file| files.iter().find(|(name, _)| Path::new(name) == file).map(|(_, bytes)| *bytes))
        };
        let second = "0::/user/job\n";
        let in_job = ("/sys/fs/cgroup/user/job/memory.max", 300);
        assert_eq!(limit(second, &[in_job]), Some(300));
        assert_eq!(limit(second, &[in_job, ("/sys/fs/cgroup/user/memory.max", 200)]), Some(200));
        assert_eq!(limit(second, &[("/sys/fs/cgroup/memory.max", 100)]), Some(100));
        let first = "5:devices:/a\n4:cpu,memory:/docker/3f\n0::/\n";
        let whole = ("/sys/fs/cgroup/memory/memory.limit_in_bytes", 900);
        assert_eq!(limit(first, &[whole]), Some(900));
        assert_eq!(limit(first, &[whole, ("/sys/fs/cgroup/memory/docker/3f/memory.limit_in_bytes", 400)]), Some(400));
        assert_eq!(limit(first, &[("/sys/fs/cgroup/devices/a/memory.limit_in_bytes", 1)]), None);
        assert_eq!(limit("nonsense\n", &[whole]), None);
    }

    #[test]
    fn memory_follows_what_was_read() {
        let budget = Budget { follows_files: true, ..Budget::with_limit(1 << 40) };
        assert!(budget.take_for_now(1 << 20, FREE - (1 << 20), || unreachable!()).is_ok());
        assert!(budget.take(FREE - (1 << 20), || unreachable!()).is_ok());
        budget.read(4);
        assert!(budget.take(4 * PER_BYTE, || unreachable!()).is_ok());
        assert!(budget.check().is_ok());
        let refused = budget.take(1, || "image `a`".to_owned()).unwrap_err();
        assert!(refused.contains("4 B of files make likely") && refused.contains("--memory-limit"), "{refused}");
        // once is enough: what failed is not forgotten
        budget.read(1 << 30);
        assert!(budget.take(0, || unreachable!()).is_err());
        let error = budget.check().unwrap_err();
        assert!(
            error.exit_code() == 5 && error.to_string().starts_with("out of memory: image `a` takes 1.0 GiB"),
            "{error}"
        );
    }

    #[test]
    fn a_limit_that_was_set_counts_alone() {
        let budget = Budget::with_limit(4 << 30);
        assert!(budget.take(4 << 30, || unreachable!()).is_ok());
        assert!(budget.take(u64::MAX, || "all".to_owned()).unwrap_err().contains("more than the 4.0 GiB"));
    }

    #[test]
    fn machines_have_memory() {
        assert!((64 << 20..1 << 50).contains(&machine_memory()));
    }
}
