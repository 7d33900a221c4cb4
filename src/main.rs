//! The `commram` command.

fn main() -> std::process::ExitCode {
    commram::cli::main()
}
