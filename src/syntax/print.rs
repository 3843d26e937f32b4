//! A script as it should look: the same words in the same lines, with the same comments, evenly set.
//!
//! It works on the text and not on the tree, so that nothing can be lost. Where a space has a meaning (`8 -8` is two
//! arguments, `8 - 8` is not), it stays as it is.

use super::parse;
use crate::diagnostic::Diagnostics;
use crate::source::Source;

/// Formats a script. `None` where it cannot be read; `diagnostics` says why.
///
/// Two spaces for each open bracket, one space between words, none inside `x=10`, one empty line at most, and comments of
/// neighbouring lines below each other, in their column where they have one already. Lines stay lines, comments and strings stay as they are, and what is sent stays the same.
/// A formatted script is left as it is.
pub fn format(source: &Source, diagnostics: &mut Diagnostics) -> Option<String> {
    parse(source, diagnostics)?;
    if diagnostics.has_errors() {
        return None;
    }
    let text = source.text();
    let mut printer = Printer::default();
    for line in text.strip_prefix('\u{FEFF}').unwrap_or(text).lines() {
        printer.line(line);
    }
    let formatted = printer.finish();
    // A formatted line can be longer than the limit, and formatting can split an unknown word in two. Then the text is kept.
    let mut torn = Diagnostics::default();
    parse(&Source::new(source.name(), formatted.as_str()), &mut torn);
    Some(if torn.has_errors() { text.to_owned() } else { formatted })
}

/// Code that is wider keeps its comment directly after it, so that one long line does not widen all others.
const WIDE: usize = 100;

/// A line that is set: its code, its comment, and the column that the comment had.
#[derive(Default)]
struct Line<'t> {
    code: String,
    comment: &'t str,
    column: usize,
}

impl Line<'_> {
    fn is_blank(&self) -> bool {
        self.code.is_empty() && self.comment.is_empty()
    }

    /// Whether it has a comment after its code, and is not too wide.
    fn is_trailed(&self) -> bool {
        !self.code.trim().is_empty() && !self.comment.is_empty() && self.width() <= WIDE
    }

    fn width(&self) -> usize {
        self.code.chars().count()
    }
}

/// One piece of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Token<'t> {
    text: &'t str,
    /// Whether a space precedes it.
    apart: bool,
}

/// What decides the spaces around a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
    /// A word, a number, a string.
    Operand,
    /// `and`, `or`, `not`, `if`: words before an operand.
    Keyword,
    Open,
    Close,
    OpenBrace,
    CloseBrace,
    Comma,
    Semicolon,
    Colon,
    Equals,
    Range,
    /// `->` and comparisons: always between spaces.
    Sign,
    /// `+ - * / %`.
    Operator,
}

fn class(text: &str) -> Class {
    match text {
        "(" => Class::Open,
        ")" => Class::Close,
        "{" => Class::OpenBrace,
        "}" => Class::CloseBrace,
        "," => Class::Comma,
        ";" => Class::Semicolon,
        ":" => Class::Colon,
        "=" => Class::Equals,
        ".." => Class::Range,
        "->" | "<=" | ">=" | "==" | "<" | ">" => Class::Sign,
        "+" | "-" | "*" | "/" | "%" => Class::Operator,
        "and" | "or" | "not" | "if" | "let" => Class::Keyword,
        _ => Class::Operand,
    }
}

/// Where a token is in its statement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct State {
    /// Open `(`.
    parens: usize,
    /// Whether an expression continues to the end of the statement, or to its block: after `let` and `if`.
    expression: bool,
    /// Whether it is the first in its statement.
    begins: bool,
    /// Whether no operand precedes it, so that an operator here is a sign of a number.
    prefix: bool,
    /// Whether it is a comma between names of robots.
    names: bool,
}

impl State {
    fn is_expression(self) -> bool {
        self.parens > 0 || self.expression
    }
}

#[derive(Default)]
struct Printer<'t> {
    lines: Vec<Line<'t>>,
    /// How many brackets are open, and how many of them are parentheses.
    depth: usize,
    parens: usize,
    /// Whether an expression continues from the line before, inside parentheses of a `let` or an `if`.
    expression: bool,
}

impl<'t> Printer<'t> {
    #[expect(clippy::too_many_lines, reason = "one kind of line after the other")]
    fn line(&mut self, line: &'t str) {
        let (tokens, comment) = tokens(line);
        let closes = tokens.iter().take_while(|token| matches!(class(token.text), Class::Close | Class::CloseBrace));
        let indent = self.depth.saturating_sub(closes.count());
        let mut code = String::new();
        if !tokens.is_empty() || !comment.is_empty() {
            code.push_str(&"  ".repeat(indent));
        }
        let going_on = self.parens > 0;
        let mut state = State {
            parens: self.parens,
            expression: going_on && self.expression,
            begins: !going_on,
            prefix: true,
            names: false,
        };
        let mut before: Option<(&str, State)> = None;
        for (at, token) in tokens.iter().enumerate() {
            state.names = separates_names(&tokens, at);
            if let Some((last, was)) = before
                && is_apart(last, was, *token, state)
            {
                code.push(' ');
            }
            code.push_str(token.text);
            let begins_expression = match token.text {
                "let" => state.begins && tokens.get(at + 2).is_some_and(|equals| equals.text == "="),
                // Without a block it is no condition, but a command that there is not.
                "if" => {
                    (state.begins || before.is_some_and(|(last, _)| last == "else"))
                        && tokens.get(at..).unwrap_or_default().iter().any(|token| matches!(token.text, "{" | "("))
                }
                _ => false,
            };
            before = Some((token.text, state));
            self.count(token.text);
            state = State {
                parens: self.parens,
                expression: match class(token.text) {
                    Class::Semicolon | Class::OpenBrace | Class::CloseBrace if self.parens == 0 => false,
                    _ => state.expression || begins_expression,
                },
                begins: self.parens == 0
                    && matches!(
                        class(token.text),
                        Class::Semicolon | Class::OpenBrace | Class::CloseBrace | Class::Colon
                    ),
                prefix: !matches!(class(token.text), Class::Operand | Class::Close),
                names: false,
            };
        }
        self.expression = state.expression;
        let column = line.trim_end().strip_suffix(comment).unwrap_or(line).chars().count();
        let line = Line { code, comment, column };
        let after_blank = self.lines.last().is_none_or(Line::is_blank);
        let after_open = self.lines.last().is_some_and(|last| last.code.ends_with('{'));
        if line.is_blank() && (after_blank || after_open) {
            return;
        }
        if line.code.trim_start().starts_with('}') && after_blank {
            self.lines.pop();
        }
        self.lines.push(line);
    }

    fn count(&mut self, text: &str) {
        match class(text) {
            Class::Open => (self.depth, self.parens) = (self.depth + 1, self.parens + 1),
            Class::OpenBrace => self.depth += 1,
            Class::Close => (self.depth, self.parens) = (self.depth.saturating_sub(1), self.parens.saturating_sub(1)),
            Class::CloseBrace => self.depth = self.depth.saturating_sub(1),
            _ => {}
        }
    }

    /// The text, with the comments of neighbouring lines below each other.
    fn finish(mut self) -> String {
        while self.lines.last().is_some_and(Line::is_blank) {
            self.lines.pop();
        }
        let mut text = String::new();
        for group in self.lines.chunk_by(|left, right| left.is_trailed() && right.is_trailed()) {
            let least = group.iter().map(Line::width).max().unwrap_or(0) + 2;
            let kept = group.first().map(|line| line.column).filter(|column| (least..=2 * WIDE).contains(column));
            let column = kept.filter(|column| group.iter().all(|line| line.column == *column)).unwrap_or(least);
            for line in group {
                text.push_str(&line.code);
                if line.is_trailed() {
                    text.push_str(&" ".repeat(column - line.width()));
                } else if !line.code.trim().is_empty() && !line.comment.is_empty() {
                    text.push_str("  ");
                }
                text.push_str(line.comment);
                text.truncate(text.trim_end_matches([' ', '\t']).len());
                text.push('\n');
            }
        }
        text
    }
}

/// Whether a token is a comma between names: of `robots left, right`, or before a `:`.
fn separates_names(tokens: &[Token<'_>], at: usize) -> bool {
    let mut classes = tokens.get(at..).unwrap_or_default().iter().map(|token| class(token.text));
    if classes.next() != Some(Class::Comma) {
        return false;
    }
    if tokens.first().is_some_and(|first| first.text == "robots") {
        return true;
    }
    // At most 8 robots have names.
    for _ in 0..8 {
        match (classes.next(), classes.next()) {
            (Some(Class::Operand), Some(Class::Comma)) => {}
            (Some(Class::Operand), last) => return last == Some(Class::Colon),
            _ => return false,
        }
    }
    false
}

/// Whether a space belongs between two tokens of a line.
fn is_apart(last: &str, was: State, token: Token<'_>, state: State) -> bool {
    let (left, right) = (class(last), class(token.text));
    match (left, right) {
        (Class::OpenBrace, Class::CloseBrace)
        | (_, Class::Comma | Class::Semicolon | Class::Close | Class::Colon | Class::Range)
        | (Class::Open | Class::Range, _) => false,
        (_, Class::OpenBrace | Class::CloseBrace | Class::Sign)
        | (Class::OpenBrace | Class::CloseBrace | Class::Semicolon | Class::Colon | Class::Sign, _) => true,
        // `let a = 1`, `nod(depth = 5)`, and `x=10` for a command.
        (Class::Equals, _) => was.is_expression(),
        (_, Class::Equals) => state.is_expression(),
        (Class::Comma, _) => state.parens > 0 || was.names,
        // `+0.5s` at the start of a line.
        (Class::Operator, _) if was.begins => last == "-" && token.apart,
        (Class::Operator, _) if was.is_expression() => !was.prefix,
        (_, Class::Operator) if state.is_expression() => true,
        // `at bow + 0.5s`.
        (Class::Operator, _) if last == "+" => true,
        (_, Class::Operator) if token.text == "+" => true,
        // What directly precedes a bracket may be the name of a call.
        (Class::Keyword, Class::Open) => token.apart,
        // Elsewhere it may be a part of a word, such as `if-only`.
        (Class::Keyword, _) | (_, Class::Keyword) => token.apart || was.is_expression() || state.is_expression(),
        _ => token.apart,
    }
}

/// Splits a line into its tokens and its comment.
fn tokens(line: &str) -> (Vec<Token<'_>>, &str) {
    let mut tokens = Vec::new();
    let mut rest = line;
    loop {
        let trimmed = rest.trim_start();
        let apart = trimmed.len() < rest.len();
        if trimmed.is_empty() || trimmed.starts_with('#') {
            return (tokens, trimmed.trim_end());
        }
        let (text, tail) = trimmed.split_at(length(trimmed));
        tokens.push(Token { text, apart });
        rest = tail;
    }
}

/// How long the first token is.
fn length(text: &str) -> usize {
    if text.starts_with('"') {
        let mut escaped = true;
        let end = text.char_indices().find(|&(at, c)| {
            let ends = c == '"' && !escaped && at > 0;
            escaped = at == 0 || (c == '\\' && !escaped);
            ends
        });
        return end.map_or(text.len(), |(at, _)| at + 1);
    }
    if ["->", "<=", ">=", "==", ".."].iter().any(|sign| text.starts_with(sign)) {
        return 2;
    }
    let mut end = 0;
    for (at, c) in text.char_indices() {
        let point = c == '.' && !text.get(at..).unwrap_or_default().starts_with("..");
        if !(c.is_alphanumeric() || c == '_' || point || !c.is_ascii() && !c.is_whitespace()) {
            break;
        }
        end = at + c.len_utf8();
    }
    if end == 0 { text.chars().next().map_or(1, char::len_utf8) } else { end }
}
