//! `motionseq explain`: explains an error or a warning.

use std::io::{self, Write};

use clap::Args;
use motionseq::diagnostic::{Code, Severity};
use motionseq::report;

use super::exit::Exit;
use super::output::{self, Format};
use super::screen::Screen;

/// Explain an error or a warning, with a wrong and a right example
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  motionseq explain clash\n  motionseq explain                  # list all codes\n  motionseq explain --format json    # everything about all codes"
)]
pub(super) struct Explain {
    /// Code of the message, such as `clash`; without it, list all codes
    code: Option<String>,
    /// Output format
    #[arg(long, value_enum, default_value_t = Format::Human)]
    format: Format,
}

impl Explain {
    /// Prints the explanation; fails if the code is unknown.
    pub(super) fn run(&self, screen: &Screen) -> Exit {
        let named = self.code.as_deref().map(|name| (name, Code::all_named(name.trim_matches(['[', ']', '`']))));
        let text = match (&named, self.format) {
            (Some((name, codes)), _) if codes.is_empty() => {
                let near = motionseq::program::suggest(name, Code::ALL.iter().map(|code| code.name()));
                let help = match near {
                    Some(near) => format!("did you mean `motionseq explain {near}`?"),
                    None => "list the codes with `motionseq explain`".to_owned(),
                };
                screen.error(&format!("unknown code `{name}`; {help}"));
                return Exit::Usage;
            }
            (named, Format::Json) => report::json::codes(named.as_ref().map_or(Code::ALL, |(_, codes)| codes)),
            (Some((_, codes)), Format::Human) => {
                codes.iter().map(|code| explained(*code)).collect::<Vec<_>>().join("\n")
            }
            (None, Format::Human) => {
                let rows = Code::ALL.iter().map(|code| format!("{:<20} {}", code.name(), code.title()));
                rows.collect::<Vec<_>>().join("\n") + "\n"
            }
        };
        output::exit(io::stdout().lock().write_all(text.as_bytes()), None, screen)
    }
}

fn explained(code: Code) -> String {
    let severity = code.severity();
    let (wrong, right) = code.example();
    let indented = |text: &str| text.lines().fold(String::new(), |out, line| out + "    " + line + "\n");
    let allowed = if severity == Severity::Warning {
        format!("\nTo suppress it on one line, end the line with: # allow: {code}\n")
    } else {
        String::new()
    };
    format!(
        "{severity} {code}: {}\n\n{}\n\nWrong:\n{}\nRight:\n{}{allowed}",
        code.title(),
        wrapped(code.explanation()),
        indented(wrong),
        indented(right)
    )
}

/// Text in lines of at most 80 characters.
fn wrapped(text: &str) -> String {
    const WIDTH: usize = 80;
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let full = lines.last().is_some_and(|line| line.chars().count() + 1 + word.chars().count() > WIDTH);
        if full {
            lines.push(String::new());
        }
        if let Some(line) = lines.last_mut() {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines.join("\n")
}
