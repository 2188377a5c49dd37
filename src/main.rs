//! The `skylit` program: everything is in [`skylit::cli`].

fn main() -> std::process::ExitCode {
    skylit::cli::run()
}
