//! The tree of each script in `tests/trees`, which pins how the grammar reads what is easily read wrong.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::format_push_string)]

mod support;

use motionseq::diagnostic::Diagnostics;
use motionseq::source::Source;
use motionseq::syntax::{Argument, Block, Item, Line, Origin, Start, Statement, Value, ValueKind, parse};

#[test]
fn trees() {
    insta::with_settings!({ snapshot_path => "trees", prepend_module_to_snapshot => false, omit_expression => true }, {
        insta::glob!("trees/*.motion", |path| {
            let text = std::fs::read_to_string(path).unwrap();
            let source = Source::new(path.file_name().unwrap().to_string_lossy(), text);
            let mut diagnostics = Diagnostics::default();
            let ast = parse(&source, &mut diagnostics).unwrap();
            let mut tree = String::new();
            block(&ast.body, 0, &source, &mut tree);
            insta::assert_snapshot!("trees", format!("{tree}\n{}", support::messages(&source, &diagnostics)));
        });
    });
}

/// One line for each line of the script, in brackets the text that it covers; parts and blocks further in.
fn block(block: &Block<'_>, depth: usize, source: &Source, out: &mut String) {
    let indent = "  ".repeat(depth);
    for Line { start, parts, span } in &block.lines {
        let start = match start {
            None => String::new(),
            Some(Start::After(after)) => format!(" after {}", value(after)),
            Some(Start::At(moment)) => {
                let origin = match &moment.origin {
                    Origin::Value(origin) => value(origin),
                    Origin::Bar(span) => format!("bar`{}`", source.slice(*span)),
                };
                let sign = |away: &bool| if *away { '-' } else { '+' };
                let offsets = moment.offsets.iter().map(|(away, offset)| format!(" {} {}", sign(away), value(offset)));
                format!(" at {origin}{}", offsets.collect::<String>())
            }
        };
        out.push_str(&format!("{indent}line{start}  [{}]\n", source.slice(*span).replace('\n', "↵")));
        for part in parts {
            let robots: Vec<_> = part.robots.iter().map(|robot| robot.text).collect();
            let robots = if robots.is_empty() { String::new() } else { format!("{}: ", robots.join(", ")) };
            match &part.statement {
                Statement::Later(later) => out.push_str(&format!("{indent}  {robots}later `{}`\n", later.what)),
                Statement::Call(call) => out.push_str(&format!("{indent}  {robots}call {}\n", call.text)),
                Statement::Block(inner) => {
                    out.push_str(&format!("{indent}  {robots}block\n"));
                    self::block(inner, depth + 2, source, out);
                }
                Statement::Command(command) => {
                    let arguments = command.arguments.iter().map(|each| format!(" {}", argument(each)));
                    out.push_str(&format!(
                        "{indent}  {robots}{}{}\n",
                        command.head.text,
                        arguments.collect::<String>()
                    ));
                    if let Some(inner) = &command.block {
                        self::block(inner, depth + 2, source, out);
                    }
                }
            }
        }
    }
}

fn argument(argument: &Argument<'_>) -> String {
    let name = argument.name.map(|name| format!("{}=", name.text)).unwrap_or_default();
    let item = match &argument.item {
        Item::One(one) => value(one),
        Item::Arrow(from, to) => format!("arrow({} {})", value(from), value(to)),
        Item::Range(from, to) => format!("range({} {})", value(from), value(to)),
        Item::List(list) => format!("list({})", list.iter().map(value).collect::<Vec<_>>().join(" ")),
        Item::Comparison(sign) => format!("compare`{}`", sign.text),
    };
    format!("{name}{item}")
}

fn value(value: &Value<'_>) -> String {
    let minus = if value.negative { "minus " } else { "" };
    match value.kind {
        ValueKind::Number(shape, text) => format!("{minus}{shape:?}`{text}`"),
        ValueKind::Text(text) => format!("{minus}text{text}"),
        ValueKind::Word(text) => format!("{minus}word`{text}`"),
        ValueKind::Call(name) => format!("{minus}call`{name}`"),
        ValueKind::Paren => format!("{minus}parentheses"),
    }
}
