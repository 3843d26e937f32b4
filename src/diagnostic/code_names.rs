//! The names of codes, and those that older versions used.

use std::fmt;

use super::Code;

/// Codes of older versions, and those that they were divided into.
const DIVIDED: &[(&str, &[Code])] = &[(
    "arguments",
    &[
        Code::MissingArgument,
        Code::UnexpectedArgument,
        Code::DuplicateArgument,
        Code::InvalidArgument,
        Code::Block,
        Code::Comparison,
        Code::UnknownEasing,
    ],
)];

impl Code {
    /// The code with this name. [`Code::all_named`] also knows older names.
    pub fn named(name: &str) -> Option<Code> {
        Code::ALL.iter().copied().find(|code| code.name() == name)
    }

    /// The code with this name; for the name of a code that was divided, those that replace it. Empty for an unknown name.
    pub fn all_named(name: &str) -> Vec<Code> {
        let divided = DIVIDED.iter().find(|(old, _)| *old == name).map(|(_, codes)| codes.to_vec());
        divided.unwrap_or_else(|| Code::named(name).into_iter().collect())
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
