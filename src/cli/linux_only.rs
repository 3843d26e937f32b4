//! Stand-ins, on other systems, for the commands that need Linux: each reports that it does.

/// A command that takes any arguments and reports that it needs Linux.
macro_rules! needs_linux {
    ($($module:ident $name:ident $about:literal)*) => {$(
        pub(super) mod $module {
            use std::ffi::OsString;

            use clap::Args;

            use super::super::exit::Exit;
            use super::super::screen::Screen;

            #[doc = $about]
            #[derive(Debug, Args)]
            pub(in super::super) struct $name {
                #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
                arguments: Vec<OsString>,
            }

            impl $name {
                pub(in super::super) fn run(&self, screen: &Screen) -> Exit {
                    screen.error(concat!("`motionseq ", stringify!($module), "` needs Linux, for serial ports and exact timing"));
                    Exit::Usage
                }
            }
        }
    )*};
}

needs_linux! {
    play Play "Play a script on a robot or on a virtual board (Linux only)"
    board Board "Run a virtual board that other programs open as a serial port (Linux only)"
    record Record "Record what another program sends as a script (Linux only)"
    ports Ports "List the serial ports (Linux only)"
    latency Latency "Measure how well this machine keeps time (Linux only)"
}
