//! End of the program when the host's memory runs out: one line and the exit code of
//! [`Error::OutOfMemory`], where Rust's own allocator would abort.

use std::alloc::{GlobalAlloc, Layout, System};
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::Error;

/// The system's allocator for programs that are to end with a line when it has nothing left.
/// `src/main.rs` declares it as the global allocator of `skylit`.
///
/// Files are written without a name until they are complete ([`crate::files`]), so ending at once
/// leaves none behind.
pub struct HostAllocator;

// SAFETY: every call goes to the system's allocator unchanged; what it returns is returned unless
// it is null, which ends the process
unsafe impl GlobalAlloc for HostAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's promises are those of the system's allocator
        checked(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above
        checked(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as above
        checked(unsafe { System.realloc(memory, layout, size) }, size)
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: as above
        unsafe { System.dealloc(memory, layout) }
    }
}

fn checked(memory: *mut u8, size: usize) -> *mut u8 {
    if memory.is_null() { end(size) } else { memory }
}

unsafe extern "C" {
    /// Ends the process at once (C99; `_exit` of POSIX): without destructors of C++ libraries,
    /// which other threads still use.
    #[link_name = "_Exit"]
    safe fn exit_at_once(code: i32) -> !;
}

/// Bytes that threads and the C library take at the start of the program, and more.
const ROOM_TO_START: usize = 16 << 20;

/// Ends the process with the line and the exit code of [`Error::OutOfMemory`] if there is no room
/// for threads: where the C library has nothing left for what it keeps of each, it aborts. To be
/// called before any thread is started.
pub fn check_room_to_start() {
    drop(std::hint::black_box(Vec::<u8>::with_capacity(ROOM_TO_START)));
}

#[cold]
fn end(size: usize) -> ! {
    static ENDING: AtomicBool = AtomicBool::new(false);
    // several threads can run out at once: the first one speaks
    if ENDING.swap(true, Ordering::SeqCst) {
        loop {
            std::thread::park();
        }
    }
    // on the stack: there is no memory for a String
    let mut line = [0; 200];
    let mut rest = &mut line[..];
    let room = rest.len();
    let _ = writeln!(
        rest,
        "skylit: error: out of memory: the system has no {} MiB more for this process; use a smaller image or scene, or a larger limit",
        size.div_ceil(1 << 20)
    );
    let written = room - rest.len();
    let _ = std::io::stderr().write_all(&line[..written]);
    exit_at_once(i32::from(Error::OutOfMemory(String::new()).exit_code()))
}
