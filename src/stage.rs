//! Stages of long work that no caller hears of: a file that is read, a hierarchy that is built,
//! kernels that are compiled. Whoever shows progress, a terminal or a window, looks here several
//! times a second, from another thread.
//!
//! A stage is a guard: it is under way until it is dropped, also by an error or a panic. Stages of
//! several threads may overlap. Nothing here decides what is computed.

use std::borrow::Cow;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Stages under way, the newest last.
static STAGES: Mutex<Vec<Arc<State>>> = Mutex::new(Vec::new());

struct State {
    name: Cow<'static, str>,
    done: AtomicU64,
    /// 0: not known.
    total: u64,
}

/// A stage that is under way as long as this lives.
#[must_use]
pub struct Stage(Arc<State>);

/// A stage that is under way, and how much of it is done.
#[derive(Clone, Debug, PartialEq)]
pub struct StageProgress {
    /// Name of the stage, a phrase such as `building the BVH`.
    pub name: Cow<'static, str>,
    /// Share that is done, in [0, 1]; `None` where that is not known.
    pub share: Option<f64>,
}

/// Begins a stage whose length is not known. `name`: a phrase such as `compiling kernels`.
pub fn begin(name: impl Into<Cow<'static, str>>) -> Stage {
    begin_counted(name, 0)
}

/// Begins a stage of `total` units, of which [`advance`] says how many are done.
pub fn begin_counted(name: impl Into<Cow<'static, str>>, total: u64) -> Stage {
    let state = Arc::new(State { name: name.into(), done: AtomicU64::new(0), total });
    STAGES.lock().unwrap_or_else(PoisonError::into_inner).push(state.clone());
    Stage(state)
}

/// Notes that so many more units of the newest counted stage are done; without one it does nothing.
pub fn advance(units: u64) {
    let stages = STAGES.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(stage) = stages.iter().rev().find(|s| s.total > 0) {
        stage.done.fetch_add(units, Ordering::Relaxed);
    }
}

/// The stage under way: the newest with a known share of less than all, or else the newest.
pub fn current() -> Option<StageProgress> {
    let stages = STAGES.lock().unwrap_or_else(PoisonError::into_inner);
    let is_measured = |s: &&Arc<State>| s.done.load(Ordering::Relaxed) < s.total;
    let stage = stages.iter().rev().find(is_measured).or(stages.last())?;
    let share = stage.done.load(Ordering::Relaxed) as f64 / stage.total.max(1) as f64;
    Some(StageProgress { name: stage.name.clone(), share: (stage.total > 0).then_some(share.min(1.0)) })
}

impl Drop for Stage {
    fn drop(&mut self) {
        STAGES.lock().unwrap_or_else(PoisonError::into_inner).retain(|s| !Arc::ptr_eq(s, &self.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Other tests have stages of their own at the same time, so that only those of this test are
    /// looked at.
    #[test]
    fn stages_end_where_they_are_dropped() {
        let names = || {
            let stages = STAGES.lock().unwrap_or_else(PoisonError::into_inner);
            stages.iter().map(|s| s.name.clone()).filter(|n| n.starts_with("test ")).collect::<Vec<_>>()
        };
        let outer = begin("test outer");
        let caught = std::panic::catch_unwind(|| {
            let inner = begin_counted("test inner", 8);
            assert_eq!((names().len(), inner.0.total), (2, 8));
            advance(0);
            std::panic::resume_unwind(Box::new(()));
        });
        assert!(caught.is_err() && names() == ["test outer"]);
        assert!(current().is_some());
        drop(outer);
        assert!(names().is_empty());
    }
}
