//! Templates: the text that a verb sends, with places for its values; written, read, and compared.

use std::io::Write as _;
use std::iter::Peekable;
use std::ops::Range;
use std::str::CharIndices;

use smallvec::{SmallVec, smallvec};

use super::search::Search;
use crate::board::Values;

/// The longest string of a template in bytes, not counting its values.
pub(super) const MAX_TEXT: usize = 256;
/// The most zeros that a value can be padded to.
const MAX_WIDTH: usize = 12;

/// What a template knows about an axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) range: (i32, i32),
    /// The number of decimal places; values are in units of the last one.
    pub(super) decimals: u32,
    /// All values, if there are few; empty for all of the range.
    pub(super) values: Vec<i32>,
}

/// The text of a command.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Template {
    parts: Vec<Part>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Part {
    Bytes(Vec<u8>),
    Number(Number),
}

/// The place of a value.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Number {
    /// The position of the value in the command.
    axis: usize,
    /// The number of decimal places, and how many values are 1.
    decimals: usize,
    per_one: u32,
    /// The least number of characters; zeros fill them up.
    width: usize,
    /// Whether the value may be negative, and the most digits before the decimal point.
    is_signed: bool,
    digits: usize,
    /// The strings of all values, sorted, if there are few.
    strings: Vec<Vec<u8>>,
}

/// What is wrong with a template.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct TemplateError {
    /// The bytes of the template that are wrong.
    pub(super) at: Range<usize>,
    pub(super) message: String,
    pub(super) help: String,
}

/// How bytes match a template.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Match {
    /// The first bytes do, this many, with these values.
    Whole(usize, Values),
    /// All bytes do, but more must follow.
    Begun,
    No,
}

/// How far bytes have matched a template.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct State {
    part: usize,
    /// In bytes: how many matched. In a number: how many characters.
    at: usize,
    /// In a number: whether it has a sign, the digits before the point, and those after it.
    is_negative: bool,
    whole: usize,
    after: Option<usize>,
    /// Whether the first digit is a zero, and whether all so far are.
    leads_with_zero: bool,
    is_zero: bool,
    /// If only few values are possible: the first of their strings that begins with these characters.
    first: usize,
}

impl State {
    fn of_part(part: usize) -> Self {
        State {
            part,
            at: 0,
            is_negative: false,
            whole: 0,
            after: None,
            leads_with_zero: false,
            is_zero: true,
            first: 0,
        }
    }
}

type States = SmallVec<[State; 2]>;

/// What is wrong with a part of a template.
fn wrong(at: Range<usize>, message: &str, help: &str) -> TemplateError {
    TemplateError { at, message: message.to_owned(), help: help.to_owned() }
}

/// Reads one byte, or the place of a value, from its first character and the rest of the text.
fn piece(
    text: &str,
    (at, c): (usize, char),
    rest: &mut Peekable<CharIndices<'_>>,
    fields: &[Field],
) -> Result<Part, TemplateError> {
    let next = rest.peek().map(|(_, next)| *next);
    let byte = match (c, next) {
        ('\\', Some('x')) => {
            let digits = text.get(at + 2..at + 4).unwrap_or_default();
            let byte =
                u8::from_str_radix(digits, 16).ok().filter(|_| digits.bytes().all(|digit| digit.is_ascii_hexdigit()));
            rest.nth(2);
            byte.ok_or_else(|| {
                wrong(at..text.len().min(at + 4), "`\\x` needs two digits", "write a byte such as `\\x0A`")
            })?
        }
        ('\\', Some(letter @ ('r' | 'n' | 't' | '\\'))) => {
            rest.next();
            match letter {
                'r' => b'\r',
                'n' => b'\n',
                't' => b'\t',
                _ => b'\\',
            }
        }
        ('\\', _) => {
            let end = at + 1 + next.map_or(0, char::len_utf8);
            return Err(wrong(at..end, "unknown escape", "write one of `\\r`, `\\n`, `\\t`, `\\\\`, `\\x0A`"));
        }
        ('{', Some('{')) | ('}', Some('}')) => {
            rest.next();
            u8::try_from(c).unwrap_or_default()
        }
        ('{', _) => {
            let end = text.get(at..).and_then(|rest| rest.find('}')).map(|length| at + length);
            let end = end.ok_or_else(|| wrong(at..text.len(), "this `{` has no `}`", "write `{{` for a brace"))?;
            let number = Number::read(text.get(at + 1..end).unwrap_or_default(), fields);
            let number = number.map_err(|(message, help)| TemplateError { at: at..end + 1, message, help })?;

            while rest.next_if(|(next, _)| *next <= end).is_some() {}
            return Ok(Part::Number(number));
        }
        ('}', _) => return Err(wrong(at..at + 1, "this `}` has no `{`", "write `}}` for a brace")),
        (c, _) if c.is_ascii() => u8::try_from(c).unwrap_or_default(),
        (c, _) => {
            let bytes = c.to_string().bytes().map(|byte| format!("\\x{byte:02X}")).collect::<Vec<_>>().concat();
            let help = format!("write its bytes, in the encoding of the firmware; in UTF-8 they are `{bytes}`");
            return Err(wrong(at..at + c.len_utf8(), &format!("`{c}` is not an ASCII character"), &help));
        }
    };
    Ok(Part::Bytes(vec![byte]))
}

impl Template {
    /// Reads a template. `\r`, `\n`, `\t`, `\\` and `\xNN` are bytes, `{NAME}` and `{NAME:03}` are
    /// values, and `{{` and `}}` are braces.
    pub(super) fn read(text: &str, fields: &[Field]) -> Result<Template, TemplateError> {
        let mut template = Template::default();
        let mut rest = text.char_indices().peekable();
        let mut length = 0;
        while let Some(first) = rest.next() {
            let byte = match piece(text, first, &mut rest, fields)? {
                Part::Number(number) => {
                    template.parts.push(Part::Number(number));
                    continue;
                }
                Part::Bytes(bytes) => bytes,
            };
            length += 1;
            match template.parts.last_mut() {
                Some(Part::Bytes(bytes)) => bytes.extend(byte),
                _ => template.parts.push(Part::Bytes(byte)),
            }
        }
        if length > MAX_TEXT {
            let message = format!("this string is longer than {MAX_TEXT} bytes");
            return Err(wrong(0..text.len(), &message, "shorten it, or split the command"));
        }
        if template.parts.is_empty() {
            return Err(wrong(
                0..text.len(),
                "this string is empty",
                "write what the command sends, such as `'L{state}\\n'`",
            ));
        }
        Ok(template)
    }

    /// The axes that it contains.
    pub(super) fn axes(&self) -> impl Iterator<Item = usize> {
        self.parts.iter().filter_map(|part| match part {
            Part::Number(number) => Some(number.axis),
            Part::Bytes(_) => None,
        })
    }

    /// Writes the text with these values. Does not allocate if `out` has room.
    pub(super) fn write(&self, values: &[i32], out: &mut Vec<u8>) {
        for part in &self.parts {
            match part {
                Part::Bytes(bytes) => out.extend_from_slice(bytes),
                Part::Number(number) => number.write(values.get(number.axis).copied().unwrap_or_default(), out),
            }
        }
    }

    /// The length of the longest text.
    pub(super) fn longest(&self) -> usize {
        let length = |part: &Part| match part {
            Part::Bytes(bytes) => bytes.len(),
            Part::Number(number) => number.longest(),
        };
        self.parts.iter().map(length).sum()
    }

    /// Matches the first bytes.
    pub(super) fn matches(&self, bytes: &[u8]) -> Match {
        let mut states: States = smallvec![State::of_part(0)];
        for (at, byte) in bytes.iter().enumerate() {
            states = states.into_iter().flat_map(|state| self.next(state, *byte)).collect();
            if states.is_empty() {
                return Match::No;
            }
            if states.iter().any(|state| self.is_end(*state)) {
                let length = at + 1;
                return bytes
                    .get(..length)
                    .and_then(|text| self.values(text))
                    .map_or(Match::No, |values| Match::Whole(length, values));
            }
        }
        Match::Begun
    }

    /// The values in a whole text. Each value is as long as it can be, and one shorter if the rest
    /// does not match then.
    fn values(&self, text: &[u8]) -> Option<Values> {
        let mut found: SmallVec<[(usize, i32); 4]> = SmallVec::new();
        let mut rest = text;
        for (place, part) in self.parts.iter().enumerate() {
            match part {
                Part::Bytes(bytes) => rest = rest.strip_prefix(bytes.as_slice())?,
                Part::Number(number) => {
                    let lengths = (1..=number.longest().min(rest.len())).rev();
                    let (length, value) = lengths.into_iter().find_map(|length| {
                        let value = number.value(rest.get(..length)?)?;
                        let follows = |state: State| self.reaches_end(state, rest.get(length..).unwrap_or_default());
                        follows(State::of_part(place + 1)).then_some((length, value))
                    })?;
                    found.push((number.axis, value));
                    rest = rest.get(length..)?;
                }
            }
        }
        found.sort_unstable_by_key(|(axis, _)| *axis);
        Some(found.into_iter().map(|(_, value)| value).collect())
    }

    /// Whether the rest of a text matches from a state to the end.
    fn reaches_end(&self, from: State, rest: &[u8]) -> bool {
        if rest.is_empty() {
            return from.part >= self.parts.len();
        }
        let mut states: States = smallvec![from];
        for byte in rest {
            states = states.into_iter().flat_map(|state| self.next(state, *byte)).collect();
        }
        states.iter().any(|state| self.is_end(*state))
    }

    /// The states after another byte.
    fn next(&self, state: State, byte: u8) -> States {
        let mut found = States::new();
        let mut from = state;
        loop {
            match self.parts.get(from.part) {
                None => return found,
                Some(Part::Bytes(bytes)) => {
                    if bytes.get(from.at) == Some(&byte) {
                        let is_last = from.at + 1 == bytes.len();
                        let next = State { at: from.at + 1, ..from };
                        found.push(if is_last { State::of_part(from.part + 1) } else { next });
                    }
                    return found;
                }
                Some(Part::Number(number)) => {
                    found.extend(number.next(from, byte));
                    if !number.is_complete(from) {
                        return found;
                    }
                    from = State::of_part(from.part + 1);
                }
            }
        }
    }

    /// Whether the text may end here.
    fn is_end(&self, state: State) -> bool {
        match self.parts.get(state.part) {
            None => true,
            Some(Part::Number(number)) => state.part + 1 == self.parts.len() && number.is_complete(state),
            Some(Part::Bytes(_)) => false,
        }
    }

    /// Whether another byte may follow after the end.
    fn may_continue(&self, state: State) -> bool {
        bytes_of_numbers().any(|byte| !self.next(state, byte).is_empty())
    }

    /// The bytes that may come next.
    fn following(&self, state: State) -> SmallVec<[u8; 12]> {
        let literal = |part: usize, at: usize| match self.parts.get(part) {
            Some(Part::Bytes(bytes)) => bytes.get(at).copied(),
            _ => None,
        };
        let mut bytes: SmallVec<[u8; 12]> = SmallVec::new();
        match self.parts.get(state.part) {
            Some(Part::Bytes(_)) => bytes.extend(literal(state.part, state.at)),
            Some(Part::Number(_)) => bytes.extend(bytes_of_numbers().chain(literal(state.part + 1, 0))),
            None => {}
        }
        bytes
    }

    /// A string that has a value which may end at two places, if there is one.
    pub(super) fn ambiguous_string(&self) -> Option<Vec<u8>> {
        // Two readings of one string, and whether they have differed so far.
        let mut search = Search::new((State::of_part(0), State::of_part(0), false));
        while let Some((one, other, differ)) = search.next() {
            let is_end = self.is_end(one) && self.is_end(other);
            if is_end && differ || self.is_end(one) && self.may_continue(one) || search.is_full() {
                return Some(search.string());
            }
            for byte in self.following(one) {
                for next in self.next(one, byte) {
                    for also in self.next(other, byte) {
                        search.add((next, also, differ || next != also), byte);
                    }
                }
            }
        }
        None
    }

    /// A string of one of them that is also a string of the other, or its beginning, if there is one.
    pub(super) fn common_string(&self, other: &Template) -> Option<Vec<u8>> {
        let mut search = Search::new((State::of_part(0), State::of_part(0)));
        while let Some((of_self, of_other)) = search.next() {
            if search.has_moved() && (self.is_end(of_self) || other.is_end(of_other)) || search.is_full() {
                return Some(search.string());
            }
            for byte in self.following(of_self) {
                for next in self.next(of_self, byte) {
                    other.next(of_other, byte).into_iter().for_each(|also| search.add((next, also), byte));
                }
            }
        }
        None
    }
}

fn bytes_of_numbers() -> impl Iterator<Item = u8> {
    (b'0'..=b'9').chain([b'-', b'.'])
}

impl Number {
    /// Reads what is between braces.
    fn read(text: &str, fields: &[Field]) -> Result<Number, (String, String)> {
        let (name, width) = text.split_once(':').map_or((text, None), |(name, width)| (name, Some(width)));
        let Some((axis, field)) = fields.iter().enumerate().find(|(_, field)| field.name == name) else {
            let names: Vec<&str> = fields.iter().map(|field| field.name.as_str()).collect();
            let help = match names.as_slice() {
                [] => "no value can be written here: add it to the `axes` of the verb (a `rest` takes only the index), or write `{{` for a brace".to_owned(),
                names => format!("the axes of the verb are {}; write `{{{{` for a brace", names.join(", ")),
            };
            return Err((format!("there is no axis `{name}`"), help));
        };
        let width = match width {
            None => 0,
            Some(digits) => digits
                .strip_prefix('0')
                .and_then(|digits| digits.parse().ok())
                .filter(|width| (1..=MAX_WIDTH).contains(width))
                .ok_or_else(|| {
                    (format!("`{digits}` is not a width"), format!("write `{{{name}:03}}` for three digits with zeros"))
                })?,
        };
        let (least, most) = field.range;
        let per_one = 10_u32.pow(field.decimals.min(9));
        let digits = (least.unsigned_abs().max(most.unsigned_abs()) / per_one).checked_ilog10().unwrap_or(0);
        let digits = usize::try_from(digits).unwrap_or(0) + 1;
        let decimals = usize::try_from(field.decimals).unwrap_or(0);
        let mut number = Number { axis, decimals, per_one, width, is_signed: least < 0, digits, strings: Vec::new() };
        let string = |value: &i32| {
            let mut string = Vec::new();
            number.write(*value, &mut string);
            string
        };
        let mut strings: Vec<Vec<u8>> = field.values.iter().map(string).collect();
        strings.sort_unstable();
        number.strings = strings;
        Ok(number)
    }

    /// The number of characters from the decimal point on.
    fn tail(&self) -> usize {
        if self.decimals == 0 { 0 } else { 1 + self.decimals }
    }

    /// The least number of digits before the point.
    fn least_digits(&self, is_negative: bool) -> usize {
        self.width.saturating_sub(self.tail() + usize::from(is_negative)).max(1)
    }

    fn longest(&self) -> usize {
        (usize::from(self.is_signed) + self.digits + self.tail()).max(self.width)
    }

    fn write(&self, value: i32, out: &mut Vec<u8>) {
        let (decimals, per_one) = (self.decimals, self.per_one);
        let magnitude = value.unsigned_abs();
        let (whole, part) = (magnitude / per_one, magnitude % per_one);
        if value < 0 {
            out.push(b'-');
        }
        let digits = self.least_digits(value < 0);
        // Writing to a vector does not fail.
        let _ = write!(out, "{whole:0digits$}");
        if decimals > 0 {
            let _ = write!(out, ".{part:0decimals$}");
        }
    }

    /// The value of a text that [`write`](Self::write) would write; `None` for any other.
    fn value(&self, text: &[u8]) -> Option<i32> {
        if !self.strings.is_empty() {
            self.strings.binary_search_by(|string| string.as_slice().cmp(text)).ok()?;
            return std::str::from_utf8(text).ok()?.parse().ok();
        }
        let mut state = State::of_part(0);
        let mut value: i64 = 0;
        for byte in text {
            state = self.next(state, *byte)?;
            if byte.is_ascii_digit() {
                value = value.checked_mul(10)?.checked_add(i64::from(byte - b'0'))?;
            }
        }
        let value = if state.is_negative { -value } else { value };
        i32::try_from(value).ok().filter(|_| self.is_complete(state))
    }

    /// The state after another character of the number.
    fn next(&self, state: State, byte: u8) -> Option<State> {
        if let Some(first) = self.strings.get(state.first) {
            let begun = first.get(..state.at)?;
            let same = self.strings.iter().enumerate().skip(state.first);
            let mut same = same.take_while(|(_, string)| string.starts_with(begun));
            let (first, _) = same.find(|(_, string)| string.get(state.at) == Some(&byte))?;
            return Some(State { at: state.at + 1, first, ..state });
        }
        let least = self.least_digits(state.is_negative);
        let digit = byte.wrapping_sub(b'0');
        let with_digit = State { at: state.at + 1, is_zero: state.is_zero && digit == 0, ..state };
        match (byte, state.after) {
            (b'-', None) if state.at == 0 && self.is_signed => Some(State { at: 1, is_negative: true, ..state }),
            (b'.', None) if self.decimals > 0 && state.whole >= least => {
                Some(State { at: state.at + 1, after: Some(0), ..state })
            }
            (b'0'..=b'9', None) => {
                // No zeros in front of what has enough digits.
                let is_long = state.whole + 1 > least;
                let fits = state.whole < self.digits.max(least) && !(is_long && state.leads_with_zero);
                let leads_with_zero = if state.whole == 0 { digit == 0 } else { state.leads_with_zero };
                fits.then_some(State { whole: state.whole + 1, leads_with_zero, ..with_digit })
            }
            (b'0'..=b'9', Some(after)) if after < self.decimals => Some(State { after: Some(after + 1), ..with_digit }),
            _ => None,
        }
    }

    /// Whether the number may end here.
    fn is_complete(&self, state: State) -> bool {
        if let Some(first) = self.strings.get(state.first) {
            return first.len() == state.at;
        }
        let has_all = match state.after {
            None => self.decimals == 0 && state.whole >= self.least_digits(state.is_negative),
            Some(after) => after == self.decimals,
        };
        has_all && !(state.is_negative && state.is_zero)
    }
}
