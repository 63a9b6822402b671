//! The command line: reads arguments, calls the library, prints. `cutis --help` says the rest.

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
