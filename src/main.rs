//! The command line of motionseq. Everything but arguments and printing is in the library.

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
