//! How many more threads this process may have. A driver that cannot start one of its threads waits
//! for it forever, so there has to be room before it is loaded.

/// Threads that a driver of the CPU starts besides those that its work is divided among: for its
/// shader cache, for its queue, and one more.
const DRIVER_BASE: usize = 3;
/// Most threads that Mesa divides its work among.
const MAX_WORKERS: usize = 32;
/// Threads of ours that may start after the driver has been loaded.
const SPARE: usize = 2;

/// Threads that the smallest driver takes, and our own beside the pool.
pub const RESERVED: usize = threads_of_driver(1) + SPARE + 2;

/// Threads of a driver of the CPU with `workers` in each of its two pools, for rasterization and
/// for compute shaders.
const fn threads_of_driver(workers: usize) -> usize {
    DRIVER_BASE + 2 * workers
}

/// Counts how many of `wanted` threads this process may have besides those that it has. It starts
/// them and ends them again: limits of the user (`ulimit -u`), of a container and of memory are
/// told by nothing else.
pub fn room(wanted: usize) -> usize {
    #[cfg(target_os = "linux")]
    return linux::room(wanted);
    #[cfg(not(target_os = "linux"))]
    wanted
}

/// Ends the process at once, without what the C library does at its end: that would take away what
/// threads of a driver, which may be compiling, still use.
pub fn end_process(code: u8) -> ! {
    #[cfg(target_os = "linux")]
    linux::end_process(code);
    #[cfg(not(target_os = "linux"))]
    std::process::exit(i32::from(code))
}

/// Workers that a driver of the CPU is to have in each pool in place of `wanted`, or of one for
/// each processor; `None` where there is no room for one.
pub(super) fn driver_workers(wanted: Option<usize>) -> Option<usize> {
    let wanted = workers(wanted);
    workers_within(wanted, room(threads_of_driver(wanted) + SPARE))
}

/// Workers that a driver of the CPU has in each pool if it is asked for these, or for one for each
/// processor.
pub(super) fn workers(wanted: Option<usize>) -> usize {
    wanted.unwrap_or_else(processors).min(MAX_WORKERS)
}

fn workers_within(wanted: usize, room: usize) -> Option<usize> {
    let left = room.checked_sub(threads_of_driver(0) + SPARE)?;
    (wanted == 0 || left >= 2).then(|| wanted.min(left / 2))
}

/// Processors that drivers see, or more.
fn processors() -> usize {
    #[cfg(target_os = "linux")]
    return linux::processors();
    #[cfg(not(target_os = "linux"))]
    std::thread::available_parallelism().map_or(1, usize::from)
}

#[cfg(target_os = "linux")]
mod linux {
    use std::ffi::c_void;
    use std::sync::Mutex;
    use std::time::{Duration, Instant};

    /// Stack of a thread that waits.
    const STACK: usize = 128 << 10;
    /// For how long a thread that has ended may still be counted.
    const PATIENCE: Duration = Duration::from_millis(100);

    pub fn room(wanted: usize) -> usize {
        let before = running();
        let gate = Mutex::new(());
        let closed = gate.lock();
        let mut threads = Vec::with_capacity(wanted);
        while threads.len() < wanted
            && let Some(thread) = start(&gate)
        {
            threads.push(thread);
        }
        drop(closed);
        for &thread in &threads {
            // SAFETY: the thread was created above, is not detached, and is joined once
            unsafe { libc::pthread_join(thread, std::ptr::null_mut()) };
        }
        // the kernel counts a thread for a moment after it was joined
        let start = Instant::now();
        while running() > before && start.elapsed() < PATIENCE {
            std::thread::sleep(Duration::from_micros(50));
        }
        threads.len()
    }

    /// Starts a thread that ends when the gate opens. Not by the standard library: its threads
    /// allocate, and the C library then reserves 64 MiB of addresses for each.
    fn start(gate: &Mutex<()>) -> Option<libc::pthread_t> {
        // SAFETY: all zeros is a value of both types, which the calls below fill; the gate outlives
        // the thread, which `room` joins
        unsafe {
            let (mut attributes, mut thread) = (std::mem::zeroed::<libc::pthread_attr_t>(), std::mem::zeroed());
            if libc::pthread_attr_init(&mut attributes) != 0 {
                return None;
            }
            libc::pthread_attr_setstacksize(&mut attributes, STACK);
            let gate = std::ptr::from_ref(gate).cast_mut().cast();
            let outcome = libc::pthread_create(&mut thread, &attributes, wait, gate);
            libc::pthread_attr_destroy(&mut attributes);
            (outcome == 0).then_some(thread)
        }
    }

    extern "C" fn wait(gate: *mut c_void) -> *mut c_void {
        // SAFETY: `start` passes a mutex, which outlives this thread
        let gate = unsafe { &*gate.cast::<Mutex<()>>() };
        drop(gate.lock());
        std::ptr::null_mut()
    }

    /// Threads of this process.
    fn running() -> usize {
        std::fs::read_dir("/proc/self/task").map_or(0, Iterator::count)
    }

    pub fn end_process(code: u8) -> ! {
        // a process lasts until its last thread has had some time, and Mesa's thread for its cache
        // is at nice 19: it would get none for seconds where all processors are busy
        for task in std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten() {
            let Some(thread) = task.file_name().to_str().and_then(|name| name.parse().ok()) else { continue };
            // SAFETY: it has no preconditions; an error, as for a user who may not, does not matter
            unsafe { libc::setpriority(libc::PRIO_PROCESS, thread, 0) };
        }
        // SAFETY: it has no preconditions, and nothing runs after it
        unsafe { libc::_exit(i32::from(code)) }
    }

    pub fn processors() -> usize {
        // SAFETY: no preconditions
        usize::try_from(unsafe { libc::sysconf(libc::_SC_NPROCESSORS_ONLN) }).unwrap_or(1).max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_is_room_for_threads() {
        assert_eq!(room(0), 0);
        // again and again: those before have ended
        assert!((0..50).all(|_| room(20) == 20));
    }

    #[test]
    fn a_driver_has_as_many_workers_as_fit() {
        let workers = |wanted| [0, 4, 6, 7, 8, 9, 12, 100].map(|room| workers_within(wanted, room));
        assert_eq!(workers(3), [None, None, None, Some(1), Some(1), Some(2), Some(3), Some(3)]);
        assert_eq!(workers(1), [None, None, None, Some(1), Some(1), Some(1), Some(1), Some(1)]);
        assert_eq!(workers_within(0, 5), Some(0));
        assert_eq!(workers_within(32, threads_of_driver(32) + SPARE), Some(32));
    }
}
