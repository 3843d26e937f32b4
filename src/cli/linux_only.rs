//! The commands that need a port, on systems other than Linux: they say that they need it.

/// A command that reports that it needs Linux, whatever its arguments are.
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
                    screen.error(concat!("`motionseq ", stringify!($module), "` needs Linux, for its serial ports and clocks"));
                    Exit::Usage
                }
            }
        }
    )*};
}

needs_linux! {
    play Play "Play a script on a robot, or on a virtual board (Linux only)"
    board Board "Be a virtual board that any program opens as its serial port (Linux only)"
    record Record "Record what another program sends (Linux only)"
    ports Ports "List the serial ports (Linux only)"
    latency Latency "Measure how well this computer keeps time (Linux only)"
}
