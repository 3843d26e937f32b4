//! How diagnostics are written: the code, the place, what is wrong, and what to write instead, each text with values in braces.

/// A [`Diagnostic`](super::Diagnostic): `diagnostic!(OutOfRange, span, "{what} is out of range"; help: "write `{line}`")`.
///
/// After the help, `fix: SPAN => "TEXT"` adds a correction: it replaces the span by the text. `write: SPAN => "TEXT"` instead of the help
/// is a correction with the help "write `TEXT`".
macro_rules! diagnostic {
    ($code:ident, $span:expr, $message:literal $(, $value:expr)*; help: $help:literal $(, $of_help:expr)*
        $(; fix: $at:expr => $text:literal $(, $of_text:expr)*)?) => {
        $crate::diagnostic::Diagnostic::new(
            $crate::diagnostic::Code::$code,
            $span,
            format!($message $(, $value)*),
            format!($help $(, $of_help)*),
        )
        $(.fix($at, format!($text $(, $of_text)*)))?
    };
    ($code:ident, $span:expr, $message:literal $(, $value:expr)*; write: $at:expr => $text:literal $(, $of_text:expr)*) => {
        $crate::diagnostic::Diagnostic::new(
            $crate::diagnostic::Code::$code,
            $span,
            format!($message $(, $value)*),
            String::new(),
        )
        .write($at, format!($text $(, $of_text)*))
    };
}

/// Reports a [`diagnostic!`] to anything with a `push`, such as an evaluator.
macro_rules! report {
    ($to:expr, $($diagnostic:tt)*) => {{
        let diagnostic = $crate::diagnostic::diagnostic!($($diagnostic)*);
        $to.push(diagnostic);
    }};
}

/// Reports a [`diagnostic!`] and returns `None`.
macro_rules! bail {
    ($to:expr, $($diagnostic:tt)*) => {{
        let diagnostic = $crate::diagnostic::diagnostic!($($diagnostic)*);
        $to.push(diagnostic);
        return None;
    }};
}

pub(crate) use {bail, diagnostic, report};
