//! The one table of codes. A new code is one row: its name, severity, title, explanation, and a wrong and a right example.

use std::fmt;

use serde::Serialize;

/// The severity of a diagnostic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Severity {
    /// The script runs, but probably not as intended.
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
        /// What kind of mistake it is. The meaning of a name never changes.
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

            /// A script with the mistake, and the corrected script; a configuration file, for a code about that. In the first, `…` means more than fits on a page, and `\xFC`
            /// means the byte with this number.
            pub fn example(self) -> (&'static str, &'static str) {
                match self { $(Code::$variant => ($wrong, $right),)* }
            }
        }
    };
}

codes! {
    // text
    NotUtf8 "not-utf8" Error "The file is not UTF-8 text."
        "A script is plain text in UTF-8, the default encoding of most editors. This file contains a byte that is not valid UTF-8: \
        it was saved in another encoding, or it is not text. Save it as UTF-8."
        r#"say "gr\xFCezi"
"#
        r#"say "grüezi"
"#

    SourceTooLarge "source-too-large" Error "The script is larger than 64 MiB."
        "A script, together with all files that it uses, may be at most 64 MiB long. Write repeated lines as a `repeat` or a `def`."
        "# …\n"
        "repeat 100 { buzzer on for 50ms }\n"

    ControlCharacter "control-character" Error "The script contains an invisible character."
        "Invisible characters, such as the bell (U+0007), can make a script look different from what it does, and can move the cursor \
        of a terminal. They usually come with text that was copied from elsewhere. Delete them."
        r"servo 1\x07 1500
"
        "servo 1 1500\n"

    // syntax
    EmptyScript "empty-script" Warning "The script sends nothing."
        "A script that contains only comments and settings is most likely a file that was not saved or has lost its content. It is valid: a recording without any frames is such a script."
        "rate 50hz  # to be done\n"
        "rate 50hz\nservo 1 1500\n"

    Unclosed "unclosed" Error "A bracket or a quotation mark is opened and never closed."
        r#"Each `(`, `{` and `"` needs a closing partner. The error points at the opening one."#
        r#"say "hello
"#
        r#"say "hello"
"#

    Unopened "unopened" Error "A bracket is closed that was never opened."
        "A `)` or `}` closes a bracket that is not open. Remove it, or add the opening bracket."
        "servo 1 1500\n}\n"
        "servo 1 1500\n"

    LineTooLong "line-too-long" Error "A line is longer than 64 KiB."
        "A line of a script may be at most 64 KiB long. A longer line was most likely written by a program that leaves out line breaks."
        r#"say "…"
"#
        r#"say "short"
"#

    Nesting "nesting" Error "Brackets are nested too deep."
        "Brackets may be nested 64 deep, and calls and blocks may run 200 deep inside each other. Give a part a name with `def` or \
        `let`."
        "let a = (((((((((((((((((((((((((((((((((((((((((((((((((((((((((((((((((1)))))))))))))))))))))))))))))))))))))))))))))))))))))))))))))))))\nservo 1 (1500 + a)\n"
        "let a = 1\nservo 1 (1500 + a)\n"

    Syntax "syntax" Error "This cannot be read."
        "The words, numbers and operators of this line do not form a statement. The help shows what is expected. Some common mistakes \
        have codes of their own: `foreign-syntax`, `ambiguous-character`, `missing-parentheses`, `missing-space` and `call`."
        "let a 5\nservo 1 (1500 + a)\n"
        "let a = 5\nservo 1 (1500 + a)\n"

    ForeignSyntax "foreign-syntax" Error "This is the syntax of another language."
        "The line looks like Python, C, G-code or similar. The help shows the equivalent in motionseq."
        "for i in range(4):\n"
        "repeat 4 as i { servo (i + 1) 1500 }\n"

    AmbiguousCharacter "ambiguous-character" Error "A character looks like another one."
        "Text that was copied from a web page or a word processor often contains characters that only look like those of a keyboard: \
        no-break spaces, long dashes, curved quotation marks. The message gives the code of the character, and the help what to type \
        instead."
        "say “hello”\n"
        "say \"hello\"\n"

    MissingParentheses "missing-parentheses" Error "A calculation is written without parentheses."
        "Spaces separate arguments, so a calculation as an argument needs parentheses. A minus sign directly before a number, as in \
        `-8`, is part of the number."
        "servo 1 1500 + 100\n"
        "servo 1 (1500 + 100)\n"

    MissingSpace "missing-space" Error "There is no space between two arguments."
        "Arguments are separated by spaces. A range is written with two dots: `900..1700`."
        "wheels 8-8 8 -8\n"
        "wheels 8 -8 8 -8 for 1s\n"

    Call "call" Error "A command or a phrase is called in the wrong way."
        "A command is written without parentheses: `servo 1 1500`. A phrase of your own is called with parentheses directly after its \
        name, and alone: `nod(2)`. How long it takes is decided in its `def`."
        "servo(1, 1500)\n"
        "servo 1 1500\n"

    EmptyPlace "empty-place" Error "A command is missing before or after a `;`."
        "`;` joins commands that start together, so it needs a command on each side. A line does not need a `;` at its end."
        "servo 1 1500;\n"
        "servo 1 1500\n"

    Number "number" Error "A number or its unit cannot be read."
        "A number has digits on both sides of its decimal point, at most 15 on each, and no exponent. Its unit follows without a space: \
        `0.5s`, `250ms`, `90deg`, `1m30s`."
        "wait 1e3s\n"
        "wait 1000s\n"

    // program
    UnknownWord "unknown-word" Error "There is no command or setting with this name."
        "A line begins with a command, a setting, or a word of the language such as `repeat`. A phrase of your own is called with \
        parentheses: `nod()`."
        "sevro 1 1500\n"
        "servo 1 1500\n"

    Robots "robots" Error "A line names robots where it must not, or must name them and does not."
        "In a script with several robots, `left:` binds the command, call or block after it to the robot `left`; inside of it, no other robot \
        can be named. A `wait until` needs the names of the robots whose reports it waits for. What all robots share takes no name: \
        `let`, `def`, `use`, `tempo`, `meter`, `seed`."
        "robots left, right\nservo 1 1500\nwait until yaw > 90deg within 5s\n"
        "robots left, right\nservo 1 1500\nleft: wait until yaw > 90deg within 5s\n"

    MissingArgument "missing-argument" Error "An argument is missing."
        "Each command, function and phrase needs certain arguments; the help shows its form."
        "servo 1\n"
        "servo 1 1500\n"

    UnexpectedArgument "unexpected-argument" Error "There is an argument too many."
        "The command, function or phrase does not take this argument, or takes fewer of them. Only one command may be on a line, unless \
        a `;` starts several together."
        "stop 5\n"
        "stop\n"

    DuplicateArgument "duplicate-argument" Error "An argument is given twice."
        "A value with a name, such as `x=10`, and a word such as `for` may be given once. A command takes either `for` or `over`."
        "rocker x=5 x=6 for 1s\n"
        "rocker x=5 y=6 for 1s\n"

    InvalidArgument "invalid-argument" Error "An argument has the wrong form."
        "The command takes something else here: one of several words, a number, a range, a string, or a value with the name of its axis. \
        The help shows what."
        "buzzer loud\n"
        "buzzer on for 200ms\n"

    Block "block" Error "A block is missing, or is not expected here."
        "`repeat`, `together` and `on abort` need a block, which begins with `{` on the same line. Other commands take none. Nothing but \
        a comment, a `;` or an `else` may follow the `}` of a block on its line."
        "repeat 3\nservo 1 1500\n"
        "repeat 3 { buzzer on for 50ms }\n"

    Comparison "comparison" Error "An `expect` does not compare anything."
        "`expect` compares a value with `<`, `<=`, `>`, `>=` or `==`, or with a range: `in 9V..12V`."
        "wait 1s\nexpect voltage = 10V\n"
        "wait 1s\nexpect voltage > 10V\n"

    UnknownEasing "unknown-easing" Error "There is no easing with this name."
        "The easings are `linear`, and `in-`, `out-` or `in-out-` with the name of a curve, such as `in-out-sine`. docs/language lists \
        the curves."
        "servo 1 1000 -> 1500 over 1s ease ease-in\n"
        "servo 1 1000 -> 1500 over 1s ease in-sine\n"

    Unit "unit" Error "A unit is missing or wrong."
        "A time needs a unit, because 5 could be seconds or milliseconds. Values of different kinds, such as a time and an angle, \
        cannot be added or compared."
        "wait 5\n"
        "wait 5s\n"

    OutOfRange "out-of-range" Error "A value is out of range."
        "Values outside of the range of the board are errors. They are never clamped, because the robot would then do something other \
        than its script says. Angles need a unit: `90deg` is a pulse width of 1500 µs."
        "servo 1 90\n"
        "servo 1 90deg\n"

    NotWhole "not-whole" Error "A value must be a whole number."
        "Servo numbers, counts, bytes and indices are whole numbers. Use `round`, `floor` or `ceil` on the result of a calculation."
        "repeat 2.5 { buzzer on for 50ms }\n"
        "repeat 2 { buzzer on for 50ms }\n"

    LanguageVersion "language-version" Error "The script is written for another version of the language."
        "`language 1` names the version of the language that a script is written for. This motionseq supports version 1 only. Update \
        motionseq to use a later one."
        "language 2\nservo 1 1500\n"
        "language 1\nservo 1 1500\n"

    SettingPlace "setting-place" Error "A setting comes after a command, or is repeated."
        "A setting applies to the whole script, so it comes first, and only once. `tempo` and `meter` may also come first in a block."
        "servo 1 1500\nrefresh 20ms\n"
        "refresh 20ms\nservo 1 1500\n"

    Joined "joined" Error "This cannot be joined to other commands with `;`."
        "`;` joins commands that start together. `wait`, `let`, `mark`, `at` and `+` affect what follows, so each needs a line of its own."
        "servo 1 1500; wait 1s\n"
        "servo 1 1500\nwait 1s\n"

    StartTime "start-time" Error "A start time is missing, repeated or misplaced."
        "`at T` or `+D` comes first in a line, once, and applies to the whole line. Nothing can start before its block starts."
        "at 1s at 2s servo 1 1500\n"
        "at 2s servo 1 1500\n"

    TooLong "too-long" Error "The script is longer than 24 hours."
        "A script may last at most 24 hours. A longer time is most likely a mistake in a unit."
        "wait 25h\n"
        "wait 25min\n"

    TooManySteps "too-many-steps" Error "The script unrolls to too many steps."
        "Every line and every pass of a `repeat` is a step. A script may take at most 100,000,000 steps."
        "repeat 1000000 { repeat 1000 { buzzer off } }\n"
        "repeat 1000 { buzzer on for 50ms }\n"

    UnknownName "unknown-name" Error "This name is unknown here."
        "A name can be used below its `let`, `def` or `mark`, in the same block. A phrase can use its parameters and the names above its \
        `def`, but not the names of the code that calls it."
        "servo 1 centre\nlet centre = 1500us\n"
        "let centre = 1500us\nservo 1 centre\n"

    Name "name" Error "A name is taken, or is not a valid name."
        "Values, phrases and marks share one namespace, and each name is given once in a block. A name consists of lower-case letters, \
        digits and `_`, does not begin with a digit, and is not a word of the language."
        "let wait = 5s\n"
        "let pause = 5s\nwait pause\n"

    Arithmetic "arithmetic" Error "A calculation has no result."
        "The calculation divides by zero, takes the root of a negative number, or its result is too large."
        "servo 1 (1500 / 0)\n"
        "servo 1 (1500 / 1)\n"

    TopLevel "top-level" Error "A statement is not allowed inside a block."
        "`def`, `use` and `on abort` apply to the whole script, so they must be outside of all blocks."
        "repeat 2 {\n  def beep() { buzzer on for 50ms }\n}\n"
        "def beep() { buzzer on for 50ms }\nrepeat 2 { beep() }\n"

    Recursion "recursion" Error "A phrase ends up calling itself."
        "A script always ends, so a phrase must not call itself, directly or through other phrases. Use `repeat`."
        "def again() {\n  buzzer on for 50ms\n  again()\n}\nagain()\n"
        "repeat 3 { buzzer on for 50ms }\n"

    Use "use" Error "A file cannot be used."
        "`use` takes a file in the folder of the main script or in a folder inside it, relative to the file that contains the `use`. The file \
        may contain only `use`, `let` and `def`, and must not use itself, directly or through other files."
        r#"use "no-such-file.motion"
servo 1 1500
"#
        r#"use "phrases.motion"
nod()
"#

    Abort "abort" Error "`on abort` contains something that it must not."
        "`on abort` is sent after the stop, when a run ends early. It must not drive, may last at most 2 s, and is allowed once, in the \
        main script."
        "on abort { rocker x=5 }\nservo 1 1500\n"
        "on abort { servo 1 1500 }\nservo 1 1500\n"

    Limit "limit" Error "A value is outside of a limit."
        "`limit` restricts the range of a servo, an axis or the wheels, for example because the camera would hit its frame. Neither a \
        command nor a move may leave that range. Servo 2 is limited to 500..1950 by default, because higher values damage a tilt \
        servo; `limit servo 2 500..2500` widens the limit."
        "limit servo 1 900..1700\nservo 1 1800\nservo 2 2000\n"
        "limit servo 1 900..1800\nlimit servo 2 500..2500\nservo 1 1800\nservo 2 2000\n"

    Unused "unused" Warning "A name is never used."
        "A `let` or `def` of the main script that is never used is most likely a mistake: another name was meant, or a call is missing. \
        There is no warning for a file that contains only phrases for other scripts."
        "let centre = 1500us\nservo 1 1500\n"
        "let centre = 1500us\nservo 1 centre\n"

    WaitInTogether "wait-in-together" Warning "A `wait` inside `together` delays nothing."
        "In `together`, all statements start at once, so a `wait` delays none of them; it only sets how long the block lasts at least. \
        Write `+D` before a statement to delay it."
        "together {\n  servo 1 1500\n  wait 1s\n  servo 2 1500\n}\n"
        "together {\n  servo 1 1500\n  +1s servo 2 1500\n}\n"

    LetInRepeat "let-in-repeat" Warning "A `let` in a `repeat` does not count from pass to pass."
        "A name that is defined in a `repeat` is new in each pass, and forgotten at its end. So `let x = x + 1` gives `x` the same value \
        in each pass. To count, name the number of the pass with `as`, and calculate with it."
        "let x = 1\nrepeat 3 {\n  let x = x + 1\n  servo x 1500\n  wait 1s\n}\n"
        "repeat 3 as i {\n  servo (i + 2) 1500\n  wait 1s\n}\n"

    EarlyExpect "early-expect" Warning "An `expect` comes before the first report."
        "`expect` checks the newest report. The board sends reports from the start of the script on, ten times per second, so none has \
        arrived at the very start, and the run ends there. Wait first, or write `within`. A change such as `turned` would count from \
        the first report, so write a `wait` before the movement."
        "expect voltage > 10V\n"
        "expect voltage > 10V within 2s\n"

    BriefCondition "brief-condition" Warning "A condition may be true only between two reports."
        "A board reports a few times per second, and a value is compared only when a report arrives. An exact value or a narrow range can be \
        passed in between, so the gate stays closed, or the `expect` fails. Write one bound, or a wider range."
        "rocker z=20\nwait until yaw == 90deg within 5s\nstop\n"
        "rocker z=20\nwait until yaw >= 90deg within 5s\nstop\n"

    ImpossibleCondition "impossible-condition" Warning "A condition can never be true."
        "The board reports this quantity only within a range, and no value of that range meets the condition. Angles are reported from -180 to \
        180 degrees; the angle that the robot has turned since a moment is `turned`."
        "wait 0.5s\nrocker z=20\nwait until yaw > 300deg within 20s\nstop\n"
        "wait 0.5s\nrocker z=20\nwait until turned > 300deg within 20s\nstop\n"

    AmbiguousWord "ambiguous-word" Error "A word could be read in two ways."
        "`wait go` waits for the operator. If a name `go` is visible, the line could also wait for its value. Rename it, or write its value in \
        parentheses: `wait (go)`."
        "let go = 2s\nservo 1 1500\nwait go\n"
        "let go = 2s\nservo 1 1500\nwait (go)\n"

    GatePlace "gate-place" Error "A gate is where something else may run at the same time."
        "A gate stops the clock of the whole script, so nothing may run beside it. It is allowed at the top level, and in blocks, `repeat` and \
        `def` that run from there one after another; not in `together`, and not in a block or a call that is joined by `;`."
        "together {\n  servo 1 1500\n  wait go\n}\n"
        "together {\n  servo 1 1500\n  servo 2 1500\n}\nwait go\n"

    Allow "allow" Warning "An `# allow:` comment names an unknown warning."
        "`# allow: CODE` at the end of a line suppresses the warnings with that code on this line. Separate several codes with commas. \
        Errors cannot be allowed."
        "servo 1 1500  # allow: raw-fram\n"
        "raw 0x04 0  # allow: raw-frame\n"

    SlowRefresh "slow-refresh" Warning "The drive is refreshed too rarely."
        "What the board does when frames stop arriving is unknown; docs/safety.md has a test for it. A drive command that lasts is therefore sent \
        again every 50 ms. If it is sent less often than every 500 ms, the robot may stop in between."
        "refresh 800ms\nrocker x=5 for 2s\n"
        "refresh 100ms\nrocker x=5 for 2s\n"

    // timeline
    UnknownStart "unknown-start" Error "The start of a move is unknown."
        "A move with `over` starts at the last value that was sent. That value is unknown before the first command, after a drive \
        command of another kind, and after `raw 3`. Write the start: `1000 -> 1500`."
        "servo 1 1500 over 1s\n"
        "servo 1 1000 -> 1500 over 1s\n"

    Clash "clash" Error "Two commands overlap."
        "The drive, the buzzer and each servo do one thing at a time. A command with `for` or `over` occupies its device until it ends; \
        any other command occupies it for an instant. Lines run one after another, so commands overlap mostly where `at`, \
        `together` or `;` is used."
        "together {\n  servo 1 1000 -> 1500 over 1s\n  +500ms servo 1 1200\n}\n"
        "servo 1 1000 -> 1500 over 1s\nservo 1 1200\n"

    GateOverlap "gate-overlap" Error "Something starts before a gate and ends after it."
        "While a gate is closed, the clock of the script is stopped. A `for`, an `over` or an `expect … within` that starts before the gate must \
        have ended when the gate begins. A drive command without `for` may hold at a gate: it is refreshed while the gate is closed."
        "rocker y=5 for 2s\nat 1s wait go within 10s\n"
        "rocker y=5\nwait 1s\nwait go within 10s\nstop\n"

    GateTime "gate-time" Error "Something runs at a gate without a time limit, or for too long."
        "While the drive or the buzzer runs, a gate needs a time limit of at most 60 seconds, so that the robot does not run for ever if nothing \
        opens the gate. Write `within`, or bring the robot to rest before the gate."
        "rocker y=5\nwait go\nstop\n"
        "rocker y=5\nwait go within 10s\nstop\n"

    GateRefresh "gate-refresh" Error "The drive holds at a gate, but is not refreshed."
        "With `refresh off`, a drive command is sent once. A gate may wait for a long time, and what the board does when frames stop arriving is \
        unknown. Stop the drive before the gate, or remove `refresh off`."
        "refresh off\nrocker y=5\nwait go within 10s\nstop\n"
        "rocker y=5\nwait go within 10s\nstop\n"

    MoveMode "move-mode" Error "`move` needs position mode."
        "`move` is a displacement, which the board accepts only in position mode. The last `pid` command before it must be `pid \
        position`."
        "move x=100\n"
        "pid position speed=200,150 position=20,0,20 yaw=12,2,5\nmove x=100\n"

    TorqueOff "torque-off" Error "A servo without torque gets a position."
        "After `torque N off`, a servo is limp, and its target may differ from its position. `torque N on` makes it hold where it \
         is. Only then can it be moved."
        "board sts\nservo 1 2048\nwait 1s\ntorque 1 off\nwait 1s\nservo 1 2100\n"
        "board sts\nservo 1 2048\nwait 1s\ntorque 1 off\nwait 1s\ntorque 1 on\nservo 1 2048 -> 2100 over 1s\n"
    TooManyEvents "too-many-events" Error "The script sends too many frames."
        "A robot gets at most 10,000,000 frames from one script, unless `--max-events` allows more. Refreshes and the steps of \
        moves that are sent count, too."
        "repeat 11000000 {\n  buzzer off\n  wait 5ms\n}\n"
        "repeat 1100 {\n  buzzer off\n  wait 5ms\n}\n"

    WireFull "wire-full" Error "The script sends more than the serial line can carry: a frame leaves more than 50 ms late."
        "At 115200 baud the line carries 11,520 bytes per second. A frame of 13 bytes takes 1.128 ms, and frames that are due at the same \
        time are sent one after another, so each one waits for those before it. Add time between commands, lower `rate`, or make \
        `refresh` longer."
        "repeat 100 {\n  pid speed speed=200,150 position=20,0,20 yaw=12,2,5\n}\n"
        "repeat 100 {\n  pid speed speed=200,150 position=20,0,20 yaw=12,2,5\n  wait 5ms\n}\n"

    WireLate "wire-late" Warning "A frame leaves more than 5 ms late, because the serial line is busy."
        "Frames that are due at the same time are sent one after another; at 115200 baud a frame of 13 bytes takes 1.128 ms. A delay of a few \
        milliseconds is rarely visible, but the robot is not where the script says. Add time between commands, lower `rate`, or make \
        `refresh` longer."
        "repeat 6 {\n  pid speed speed=200,150 position=20,0,20 yaw=12,2,5\n}\n"
        "repeat 6 {\n  pid speed speed=200,150 position=20,0,20 yaw=12,2,5\n  wait 5ms\n}\n"

    ServoSpeed "servo-speed" Warning "A servo gets its next command before it can arrive."
        "A servo takes time to turn: a typical one takes 0.12 s for 60°, which is 5500 µs of pulse width per second. This servo gets its \
        next command before it can reach the position of this one. There is one warning per delay, at the command where it begins. \
        Allow more time, or set the real speed of the servo with `limit servo N speed …`; the help shows a speed that is \
        sufficient for the whole script."
        "servo 1 600\nwait 1s\nservo 1 2400\nwait 100ms\nservo 1 600\n"
        "servo 1 600\nwait 1s\nservo 1 2400\nwait 400ms\nservo 1 600\n"

    LongHold "long-hold" Warning "The drive runs for more than ten seconds without a `for`."
        "A drive command without `for` lasts until the next drive command. If that takes more than ten seconds, a `stop` was most likely \
        forgotten. If it is intended, write `for` in the line that starts it."
        "rocker x=5\nwait 30s\nstop\n"
        "rocker x=5 for 30s\n"

    LeftRunning "left-running" Warning "The script ends with the drive running or the buzzer on."
        "At the end of a script, motionseq sends the `stop` or `buzzer off` that is missing. Write it, or write how long the command \
        lasts, so that the script shows what happens."
        "rocker x=5\nwait 2s\n"
        "rocker x=5 for 2s\n"

    RawFrame "raw-frame" Warning "A raw frame is not checked."
        "`raw` sends any function with any bytes. Ranges and overlaps are not checked, and the state of the robot is unknown afterwards, \
        so the script ends with a stop. Use the command for this frame, or allow it: `# allow: raw-frame`."
        "raw 0x04 1\n"
        "buzzer on for 100ms\n"

    // boards
    WrongBoard "wrong-board" Error "The command belongs to another board."
        "Each family of boards has its own commands. A script is for one board: the Raspblock, unless it begins with a `board` line. Choose the \
        board that has the command, or write a command of the board that the script is for."
        "output 2 on\n"
        "board maestro 6\noutput 2 on\n"

    BoardFile "board-file" Error "The file of a text board cannot be read."
        "The path after `board` is relative to the script, uses `/`, and never leads out of the folder of the script. docs/boards.md describes the file."
        "board \"robot.toml\"\nservo 1 1500\n"
        "board raspblock\nservo 1 1500\n"

    BoardSyntax "board-syntax" Error "The file of a board is not valid TOML."
        "The file of a text board is written in TOML: `KEY = VALUE` on each line, text in quotation marks, a table in brackets for each verb. \
        docs/boards.md describes every key."
        "name = My robot\nbaud = 9600\n\n[verb.led]\nsend = 'L\\n'\n"
        "name = \"My robot\"\nbaud = 9600\n\n[verb.led]\nsend = 'L\\n'\n"

    BoardKey "board-key" Error "The file of a board has an unknown key, or lacks one."
        "A key that has no effect is most likely misspelled. A board needs `name`, `baud` and at least one verb with `send`. docs/boards.md \
        describes every key."
        "name = \"My robot\"\n\n[verb.led]\nsend = 'L\\n'\n"
        "name = \"My robot\"\nbaud = 9600\n\n[verb.led]\nsend = 'L\\n'\n"

    BoardValue "board-value" Error "The file of a board has an invalid value."
        "The value has the wrong type, or does not fit the other keys: a range is not empty, and a verb that holds needs the string that ends it, \
        which every stop sends. docs/boards.md describes every key."
        "name = \"My robot\"\nbaud = 9600\n\n[verb.drive]\naxes = [{ name = \"v\", range = \"-9..9\" }]\nholds = true\nsend = 'M{v}\\n'\n"
        "name = \"My robot\"\nbaud = 9600\n\n[verb.drive]\naxes = [{ name = \"v\", range = \"-9..9\" }]\nholds = true\nrest = 'M0\\n'\nsend = 'M{v}\\n'\n"

    BoardTemplate "board-template" Error "The string that a verb sends is wrong."
        "A template is an ASCII string with `{AXIS}` where a value goes, or `{AXIS:03}` with zeros in front. `\\r`, `\\n`, `\\t`, `\\\\` and `\\xNN` are \
        bytes, and `{{` and `}}` are braces. It contains each axis of its verb once."
        "name = \"My robot\"\nbaud = 9600\n\n[verb.led]\naxes = [{ name = \"n\", range = \"0..9\" }]\nsend = 'L{m}\\n'\n"
        "name = \"My robot\"\nbaud = 9600\n\n[verb.led]\naxes = [{ name = \"n\", range = \"0..9\" }]\nsend = 'L{n}\\n'\n"

    BoardText "board-text" Error "Two commands of a board cannot be distinguished."
        "The bytes of a stream must say which command they are and where it ends, or neither the virtual board nor a recording can read them; the \
        firmware most likely cannot, either. Let each string begin differently, separate two values, and end each string with something that is not \
        part of a number, such as `\\n`."
        "name = \"My robot\"\nbaud = 9600\n\n[verb.led]\naxes = [{ name = \"n\", range = \"0..99\" }]\nsend = 'L{n}'\n"
        "name = \"My robot\"\nbaud = 9600\n\n[verb.led]\naxes = [{ name = \"n\", range = \"0..99\" }]\nsend = 'L{n}\\n'\n"

    TwoUses "two-uses" Error "One output is used in two ways."
        "A channel of a Maestro drives either a servo, with pulses, or a digital output, as it is set up in the tool of its maker. One script uses \
        each channel in one way."
        "board maestro 6\nservo 2 1500\noutput 2 on\n"
        "board maestro 6\nservo 2 1500\noutput 3 on\n"

    // motionseq.toml
    ConfigSyntax "config-syntax" Error "motionseq.toml is not valid TOML."
        "The configuration file is written in TOML: `KEY = VALUE` on each line, text in quotation marks, lists in brackets. No script is \
        compiled until it can be read, because a limit of the project might be missing. docs/config.md describes every key."
        "port = /dev/serial0\n"
        "port = \"/dev/serial0\"\n"

    ConfigKey "config-key" Error "motionseq.toml contains an unknown key."
        "A key that has no effect is most likely misspelled, and a limit that is silently ignored protects nothing. `motionseq config` shows every \
        key with its value. Settings that change what a script sends, such as `rate`, `tempo` and `seed`, belong in the script."
        "[limits]\nservo-300 = \"900..1700\"\n"
        "[limits]\nservo-2 = \"900..1700\"\n"

    ConfigValue "config-value" Error "motionseq.toml contains an invalid value."
        "The value has the wrong type, or it is not allowed for this key: a limit must be within the range of the board, and a time, a code or \
        a pattern must be one that motionseq knows. docs/config.md describes every key."
        "[limits]\nservo-2 = \"900..9000\"\n"
        "[limits]\nservo-2 = \"900..1700\"\n"
}
