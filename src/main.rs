//! The `skylit` program: everything is in [`skylit::cli`].

/// Ends with one line where memory runs out.
#[global_allocator]
static ALLOCATOR: skylit::gpu::host_memory::HostAllocator = skylit::gpu::host_memory::HostAllocator;

fn main() -> std::process::ExitCode {
    skylit::cli::run()
}
