//! Which output is colored, and how.

use std::io::IsTerminal;

use clap::{ColorChoice, ValueEnum};
use motionseq::diagnostic::escaped;
use motionseq::diff::{Part, Words};

/// When output is colored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Color {
    Auto,
    Always,
    Never,
}

impl Color {
    /// Whether output to a stream is colored. `auto` follows the variables that other programs also follow.
    pub(super) fn is_for(self, stream: &impl IsTerminal) -> bool {
        match self {
            Color::Always => true,
            Color::Never => false,
            Color::Auto if anstyle_query::no_color() => false,
            Color::Auto if is_forced() => true,
            Color::Auto => match anstyle_query::clicolor() {
                Some(false) => false,
                asked => {
                    let is_able = asked.is_some() || anstyle_query::term_supports_color() || anstyle_query::is_ci();
                    stream.is_terminal() && is_able
                }
            },
        }
    }

    /// The value of `--color` before the arguments are read: for the help, and for messages about wrong arguments.
    pub(super) fn in_arguments() -> Self {
        let words = std::env::args_os().skip(1).take_while(|word| word != "--");
        let mut words = words.map(|word| word.to_string_lossy().into_owned());
        let mut color = Color::Auto;
        while let Some(word) = words.next() {
            let value = if word == "--color" { words.next() } else { word.strip_prefix("--color=").map(str::to_owned) };
            color = value.and_then(|value| Color::from_str(&value, false).ok()).unwrap_or(color);
        }
        color
    }

    /// What clap follows. It knows all variables but one.
    pub(super) fn choice(self) -> ColorChoice {
        match self {
            Color::Always => ColorChoice::Always,
            Color::Never => ColorChoice::Never,
            Color::Auto if is_forced() && !anstyle_query::no_color() => ColorChoice::Always,
            Color::Auto => ColorChoice::Auto,
        }
    }
}

/// Whether a variable asks for color without a terminal.
fn is_forced() -> bool {
    anstyle_query::clicolor_force() || std::env::var_os("FORCE_COLOR").is_some_and(|value| !value.is_empty())
}

/// How a part of a text looks, as in git.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Style {
    /// An error, and what is removed.
    Red,
    /// A success, and what is added.
    Green,
    Cyan,
    Bold,
}

impl Style {
    /// The text in this style, if `is_colored`.
    pub(super) fn paint(self, text: &str, is_colored: bool) -> String {
        let code = match self {
            Style::Red => "31",
            Style::Green => "32",
            Style::Cyan => "36",
            Style::Bold => "1",
        };
        if is_colored { format!("\u{1b}[{code}m{text}\u{1b}[0m") } else { text.to_owned() }
    }
}

/// The words of a change: what was there before is red, and what is there now is green.
pub(super) fn painted(words: &Words, is_colored: bool) -> String {
    let part = |part: &Part| match part {
        Part::Old(text) => Style::Red.paint(&escaped(text), is_colored),
        Part::New(text) => Style::Green.paint(&escaped(text), is_colored),
        other => escaped(other.text()),
    };
    words.parts().iter().map(part).collect()
}
