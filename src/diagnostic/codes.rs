//! The one table of codes. A new one is one row here: its name, how bad it is, what it is, why, and an example of wrong and right.

use std::fmt;

use serde::Serialize;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Severity {
    /// The script runs, but probably not as meant.
    Warning,
    /// The script does not compile; nothing is sent.
    Error,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if *self == Severity::Error { "error" } else { "warning" })
    }
}

/// Variant, name, severity, title, why, wrong, right.
macro_rules! codes {
    ($($variant:ident $name:literal $severity:ident $title:literal $why:literal $wrong:literal $right:literal)*) => {
        /// What kind of mistake it is. The name of a code never changes its meaning.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[non_exhaustive]
        pub enum Code {
            $(#[doc = $title] $variant,)*
        }

        impl Code {
            /// Every code there is.
            pub const ALL: &[Code] = &[$(Code::$variant,)*];

            /// The stable name, such as `out-of-range`.
            pub fn name(self) -> &'static str {
                match self { $(Code::$variant => $name,)* }
            }

            /// Whether it stops the script from compiling.
            pub fn severity(self) -> Severity {
                match self { $(Code::$variant => Severity::$severity,)* }
            }

            /// What it is, in a few words.
            pub fn title(self) -> &'static str {
                match self { $(Code::$variant => $title,)* }
            }

            /// Why that is so, and what to do.
            pub fn explanation(self) -> &'static str {
                match self { $(Code::$variant => $why,)* }
            }

            /// A script that has it, and the same script put right. In the first, `…` stands for more than fits on a page, and
            /// `\xFC` for the byte with this number.
            pub fn example(self) -> (&'static str, &'static str) {
                match self { $(Code::$variant => ($wrong, $right),)* }
            }
        }
    };
}

impl Code {
    /// The code with this name.
    pub fn named(name: &str) -> Option<Code> {
        Code::ALL.iter().copied().find(|code| code.name() == name)
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

codes! {
    // text
    NotUtf8 "not-utf8" Error "The file is not UTF-8 text."
        "A script is plain text in UTF-8, the encoding that editors use unless they are told otherwise. This file has a byte \
        that no such text has: it was saved in another encoding, or is no text at all. Save it as UTF-8."
        r#"say "gr\xFCezi"
"#
        r#"say "grüezi"
"#

    SourceTooLarge "source-too-large" Error "The script is larger than 64 MiB."
        "A script, with all files that it uses, is at most 64 MiB long; nothing of a larger one is read. What repeats is \
        shorter as a `repeat` or a `def`."
        "# …\n"
        "repeat 100 { buzzer on for 50ms }\n"

    ControlCharacter "control-character" Error "A character that cannot be seen stands in the script."
        "A character that nobody sees, such as the bell with the number 7, could make a script look other than it is, and move \
        the cursor of a terminal. It mostly comes with text that was copied from elsewhere. Delete it."
        r"servo 1\x07 1500
"
        "servo 1 1500\n"

    // syntax
    EmptyScript "empty-script" Error "The script does nothing."
        "A script without any command, setting, `def` or `let` is most likely a file that was never saved or lost its content."
        "# to be done\n"
        "servo 1 1500\n"

    Unclosed "unclosed" Error "A bracket or a quotation mark is opened and never closed."
        r#"Each `(`, `{` and `"` needs its partner. The place shown is where it opens; where it should close only the author knows."#
        r#"say "hello
"#
        r#"say "hello"
"#

    Unopened "unopened" Error "A bracket is closed that was never opened."
        "A `)` or `}` stands where no bracket of its kind is open. One too many, or the opening one was deleted."
        "servo 1 1500\n}\n"
        "servo 1 1500\n"

    LineTooLong "line-too-long" Error "A line is longer than 64 KiB."
        "A line of a script is at most 64 KiB long. Such a line was most likely written by a program that forgot the line ends."
        r#"say "…"
"#
        r#"say "short"
"#

    Nesting "nesting" Error "Brackets are nested too deep."
        "Brackets are nested at most 64 deep, and calls and blocks run at most 200 deep inside each other. Give a part a name \
        with `def` or `let`."
        "let a = (((((((((((((((((((((((((((((((((((((((((((((((((((((((((((((((((1)))))))))))))))))))))))))))))))))))))))))))))))))))))))))))))))))\nservo 1 (1500 + a)\n"
        "let a = 1\nservo 1 (1500 + a)\n"

    Syntax "syntax" Error "This cannot be read."
        "The words, numbers and signs of this line do not make a statement. The help says what was expected at this place. \
        Often a sum lacks its parentheses, or a blank stands in the wrong place."
        "let a 5\nservo 1 (1500 + a)\n"
        "let a = 5\nservo 1 (1500 + a)\n"

    EmptyPlace "empty-place" Error "Nothing stands before or behind a `;`."
        "`;` joins commands that start together, so one stands on each side of it. At the end of a line it is not needed: a \
        line ends by itself."
        "servo 1 1500;\n"
        "servo 1 1500\n"

    Number "number" Error "A number or its unit cannot be read."
        "A number has digits on both sides of its point, no exponent, at most 15 digits on each side, and its unit follows \
        without a blank: `0.5s`, `250ms`, `90deg`, `1m30s`."
        "wait 1e3s\n"
        "wait 1000s\n"

    // program
    UnknownWord "unknown-word" Error "No command or setting has this name."
        "A line begins with a command, a setting, or a word of the language such as `repeat`; `motionseq` knows no other. A \
        phrase of your own is called with parentheses: `nod()`."
        "sevro 1 1500\n"
        "servo 1 1500\n"

    NotYet "not-yet" Error "The language has this, but this version of motionseq does not."
        "The word is part of the language, and a later version of motionseq will know it."
        "robots left, right\nservo 1 1500\n"
        "servo 1 1500\n"

    Arguments "arguments" Error "A command has too few, too many or the wrong arguments."
        "Each command takes certain arguments in a certain order; the help shows its form. Values with a name, such as `x=10`, \
        may stand in any order."
        "servo 1\n"
        "servo 1 1500\n"

    Unit "unit" Error "A value has the wrong unit, or none."
        "A time needs its unit, because 5 could be seconds or milliseconds. Values of different kinds, such as a time and an \
        angle, cannot be added or compared."
        "wait 5\n"
        "wait 5s\n"

    OutOfRange "out-of-range" Error "A value is outside the range that the robot takes."
        "The board gets only values that it takes; nothing is cut off to fit, because a robot that does something else than its \
        script is worse than one that stands. Angles need their unit: `90deg` is a pulse width of 1500."
        "servo 1 90\n"
        "servo 1 90deg\n"

    NotWhole "not-whole" Error "A value must be a whole number."
        "Numbers of servos, counts, bytes and indices are whole. Round it, if a calculation gives something else: `round`, \
        `floor` or `ceil`."
        "repeat 2.5 { buzzer on for 50ms }\n"
        "repeat 2 { buzzer on for 50ms }\n"

    LanguageVersion "language-version" Error "The script is written for another version of the language."
        "`language 1` says which version of the language a script is written for. This motionseq knows only version 1; for \
        another one, update motionseq."
        "language 2\nservo 1 1500\n"
        "language 1\nservo 1 1500\n"

    SettingPlace "setting-place" Error "A setting stands behind a command, or twice."
        "A setting holds for the whole script, so it stands before everything else, once. `tempo` and `meter` may also stand \
        first in a block."
        "servo 1 1500\nrefresh 20ms\n"
        "refresh 20ms\nservo 1 1500\n"

    Joined "joined" Error "This cannot be joined to other commands with `;`."
        "`;` joins what starts together. `wait`, `let`, `mark`, `at` and `+` are about what comes next, so each has a line of \
        its own."
        "servo 1 1500; wait 1s\n"
        "servo 1 1500\nwait 1s\n"

    StartTime "start-time" Error "A start time is missing, doubled or out of place."
        "`at T` or `+D` stands first in a line, once, and covers the whole line. Nothing starts before its own block does."
        "at 1s at 2s servo 1 1500\n"
        "at 2s servo 1 1500\n"

    TooLong "too-long" Error "The script is longer than 24 hours."
        "A script is at most 24 hours long. A longer time is most likely a slip in a unit."
        "wait 25h\n"
        "wait 25min\n"

    TooManySteps "too-many-steps" Error "The script takes too many steps to unroll."
        "Every line and every pass of a `repeat` is a step, and a script takes at most 100,000,000 of them."
        "repeat 1000000 { repeat 1000 { buzzer off } }\n"
        "repeat 1000 { buzzer on for 50ms }\n"

    UnknownName "unknown-name" Error "Nothing has this name here."
        "A name is known below its `let`, `def` or `mark`, inside the block where it stands. A phrase sees its parameters and \
        the names above it, and not those of the line that calls it."
        "servo 1 centre\nlet centre = 1500us\n"
        "let centre = 1500us\nservo 1 centre\n"

    Name "name" Error "A name is given twice, or cannot be a name."
        "Names of values, phrases and marks share one space, and each is given once in its block. They are made of small \
        letters, digits and `_`, begin with no digit, and are no word of the language."
        "let wait = 5s\n"
        "let pause = 5s\nwait pause\n"

    Arithmetic "arithmetic" Error "A calculation has no result."
        "A division by zero, the root of a negative number, or a result that no number can hold."
        "servo 1 (1500 / 0)\n"
        "servo 1 (1500 / 1)\n"

    TopLevel "top-level" Error "A statement stands inside a block and may not."
        "`def`, `use` and `on abort` are about the whole script, so they stand outside of all blocks."
        "repeat 2 {\n  def beep() { buzzer on for 50ms }\n}\n"
        "def beep() { buzzer on for 50ms }\nrepeat 2 { beep() }\n"

    Recursion "recursion" Error "A phrase ends up calling itself."
        "A script always ends, so no phrase may call itself, nor by way of others. Use `repeat`."
        "def again() {\n  buzzer on for 50ms\n  again()\n}\nagain()\n"
        "repeat 3 { buzzer on for 50ms }\n"

    Use "use" Error "A file cannot be used."
        "`use` takes a file in the folder of the main script or below it, relative to the file that says it. It holds only \
        `use`, `let` and `def`, and files do not use each other in a circle."
        r#"use "no-such-file.motion"
servo 1 1500
"#
        r#"use "phrases.motion"
nod()
"#

    Abort "abort" Error "`on abort` holds what it cannot."
        "`on abort` is sent after the stop, when something ends a run early. It may not drive, lasts at most 2 s, and stands \
        once in the main script."
        "on abort { rocker x=5 }\nservo 1 1500\n"
        "on abort { servo 1 1500 }\nservo 1 1500\n"

    Limit "limit" Error "A command breaks a limit."
        "`limit` sets the range of a servo, an axis or the wheels, for example because the camera hits its frame. No command \
        may leave it, nor a move on its way. Servo 2 is limited to 500..1950 where a script says nothing else, because a higher \
        value damages a tilt servo; `limit servo 2 500..2500` widens that."
        "limit servo 1 900..1700\nservo 1 1800\nservo 2 2000\n"
        "limit servo 1 900..1800\nlimit servo 2 500..2500\nservo 1 1800\nservo 2 2000\n"

    Unused "unused" Warning "Nothing uses a name."
        "A `let` or a `def` of the main script that nothing uses is most likely a slip: another name was meant, or a call was \
        forgotten. A file that holds only phrases, for others to use, is not warned of."
        "let centre = 1500us\nservo 1 1500\n"
        "let centre = 1500us\nservo 1 centre\n"

    WaitInTogether "wait-in-together" Warning "A `wait` delays nothing inside `together`."
        "In `together` all statements start at once, so a bare `wait` delays none of them; it only makes the whole last as \
        long. `+D` before a statement delays it."
        "together {\n  servo 1 1500\n  wait 1s\n  servo 2 1500\n}\n"
        "together {\n  servo 1 1500\n  +1s servo 2 1500\n}\n"

    Allow "allow" Warning "A comment allows what is no warning."
        "`# allow: CODE` at the end of a line keeps the warnings of that code on this line back; several codes stand with \
        commas between them. Errors cannot be allowed."
        "servo 1 1500  # allow: raw-fram\n"
        "raw 0x04 0  # allow: raw-frame\n"

    SlowRefresh "slow-refresh" Warning "The drive is refreshed so seldom that the robot may stop."
        "What the board does when frames stop is unknown; docs/safety.md has a test for it. A drive command that holds is \
        therefore sent again every 50 ms; above 500 ms a robot may stop in between."
        "refresh 800ms\nrocker x=5 for 2s\n"
        "refresh 100ms\nrocker x=5 for 2s\n"

    // timeline
    UnknownStart "unknown-start" Error "A move starts from a value that nobody knows."
        "A move with `over` starts from the last value that was sent. Before the first one, after another kind of drive \
        command, and after `raw 3`, nobody knows where it starts. Write it: `1000 -> 1500`."
        "servo 1 1500 over 1s\n"
        "servo 1 1000 -> 1500 over 1s\n"

    Clash "clash" Error "Two commands want the same thing at the same time."
        "The drive, the buzzer and each servo do one thing at a time. `for` and `over` keep their thing busy as long as they \
        last; a plain command only for its moment. Lines run one after the other, so two commands mostly meet where `at`, \
        `together` or `;` put them."
        "together {\n  servo 1 1000 -> 1500 over 1s\n  +500ms servo 1 1200\n}\n"
        "servo 1 1000 -> 1500 over 1s\nservo 1 1200\n"

    MoveMode "move-mode" Error "`move` needs the board in position mode."
        "`move` is a displacement, which the board takes only in position mode. The last `pid` before it must be `pid \
        position`."
        "move x=100\n"
        "pid position speed=200,150 position=20,0,20 yaw=12,2,5\nmove x=100\n"

    TooManyEvents "too-many-events" Error "The script sends too many frames."
        "A robot gets at most 10,000,000 frames from one script, unless `--max-events` allows more. Refreshes and the steps of \
        moves that are sent count, too."
        "repeat 11000000 {\n  buzzer off\n  wait 5ms\n}\n"
        "repeat 1100 {\n  buzzer off\n  wait 5ms\n}\n"

    WireFull "wire-full" Error "The line carries less than the script sends: a frame begins to leave more than 50 ms late."
        "At 115200 baud the line carries 11,520 bytes a second, a frame of 13 bytes takes 1.128 ms, and frames that are due \
        together leave one after another. What comes faster piles up. Let time pass between commands, lower `rate`, or make \
        `refresh` longer."
        "repeat 100 {\n  pid speed speed=200,150 position=20,0,20 yaw=12,2,5\n}\n"
        "repeat 100 {\n  pid speed speed=200,150 position=20,0,20 yaw=12,2,5\n  wait 5ms\n}\n"

    WireLate "wire-late" Warning "A frame begins to leave more than 5 ms late, because the line is busy."
        "Frames that are due together leave one after another; at 115200 baud one of 13 bytes takes 1.128 ms. A few \
        milliseconds are seldom seen, but the script says something else than what happens. Let time pass between commands, \
        lower `rate`, or make `refresh` longer."
        "repeat 6 {\n  pid speed speed=200,150 position=20,0,20 yaw=12,2,5\n}\n"
        "repeat 6 {\n  pid speed speed=200,150 position=20,0,20 yaw=12,2,5\n  wait 5ms\n}\n"

    ServoSpeed "servo-speed" Warning "A servo is sent on before it can have arrived."
        "A servo takes time to turn: a usual one 0.12 s for 60°, which is 5500 µs of pulse width a second. It is told to go \
        somewhere, and somewhere else before it can be there, so it never gets there. Until it catches up, this is one warning, \
        at the command where it falls behind. Give it time, or, if it is faster or slower than that, say so with `limit servo N \
        speed …`; the help names a speed that is enough for the whole script."
        "servo 1 600\nwait 1s\nservo 1 2400\nwait 100ms\nservo 1 600\n"
        "servo 1 600\nwait 1s\nservo 1 2400\nwait 400ms\nservo 1 600\n"

    LongHold "long-hold" Warning "The drive holds for more than ten seconds without a `for`."
        "A drive command without `for` drives on until another one comes. Where that takes more than ten seconds, a `stop` was \
        most likely forgotten. If it is meant, `for` says so at the line that starts it."
        "rocker x=5\nwait 30s\nstop\n"
        "rocker x=5 for 30s\n"

    LeftRunning "left-running" Warning "The script ends with the drive running or the buzzer on."
        "When a script ends, what still holds ends with it: motionseq sends the `stop` or the `buzzer off` that is missing. Say \
        it, or how long it lasts, so that the script says what happens."
        "rocker x=5\nwait 2s\n"
        "rocker x=5 for 2s\n"

    RawFrame "raw-frame" Warning "Nothing checks what a raw frame does."
        "`raw` sends any function and any bytes. Neither ranges nor clashes are checked, and nobody knows what the robot does \
        behind it, so the script ends with a stop. Use the command that sends it, or allow it: `# allow: raw-frame`."
        "raw 0x04 1\n"
        "buzzer on for 100ms\n"
}
