//! `gonia`: see `gonia --help`.

fn main() -> std::process::ExitCode {
    gonia::cli::run()
}
