//! The `skylit` program: everything is in [`skylit::cli`].

fn main() -> std::process::ExitCode {
    skylit::gpu::environment::prefer_wide_vectors();
    skylit::cli::run()
}
