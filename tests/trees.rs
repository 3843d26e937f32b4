//! The tree of each script in `tests/trees`: how the grammar reads what is easily misread.

use motionseq::diagnostic::Diagnostics;
use motionseq::source::Source;
use motionseq::syntax::{
    Argument, Block, Expression, Item, Line, NodeKind, Origin, Start, Statement, Value, ValueKind, parse,
};

#[test]
fn trees() {
    let _alone = crate::support::one_glob_at_a_time();
    insta::with_settings!({ snapshot_path => "trees", prepend_module_to_snapshot => false, omit_expression => true }, {
        insta::glob!("trees/*.motion", |path| {
            let text = std::fs::read_to_string(path).unwrap();
            let source = Source::new(path.file_name().unwrap().to_string_lossy(), text);
            let mut diagnostics = Diagnostics::default();
            let ast = parse(&source, &mut diagnostics).unwrap();
            let mut tree = String::new();
            block(&ast.body, 0, &source, &mut tree);
            insta::assert_snapshot!("trees", format!("{tree}\n{}", crate::support::messages(&source.clone().into(), &diagnostics)));
        });
    });
}

/// One line per line of the script, with its text in brackets; parts and blocks are indented.
fn block(block: &Block<'_>, depth: usize, source: &Source, out: &mut String) {
    let indent = "  ".repeat(depth);
    for line in block.lines() {
        let Line { start, parts, span } = &*line;
        let start = match start {
            None => String::new(),
            Some(Start::After(after)) => format!(" after {}", value(after)),
            Some(Start::At(moment)) => {
                let origin = match &moment.origin {
                    Origin::Value(origin) => value(origin),
                    Origin::Bar(count) => match &**count {
                        (bar, None) => format!("bar {}", value(bar)),
                        (bar, Some(beat)) => format!("bar {} beat {}", value(bar), value(beat)),
                    },
                    other => panic!("{other:?}"),
                };
                let sign = |away: &bool| if *away { '-' } else { '+' };
                let offsets = moment.offsets.iter().map(|(away, offset)| format!(" {} {}", sign(away), value(offset)));
                format!(" at {origin}{}", offsets.collect::<String>())
            }
            Some(other) => panic!("{other:?}"),
        };
        out.push_str(&format!("{indent}line{start}  [{}]\n", source.slice(*span).replace('\n', "↵")));
        for part in parts {
            let robots: Vec<_> = part.robots.iter().map(|robot| robot.text).collect();
            let robots = if robots.is_empty() { String::new() } else { format!("{}: ", robots.join(", ")) };
            match &part.statement {
                Statement::Let(each) => {
                    out.push_str(&format!("{indent}  {robots}let {} = {}\n", each.name.text, expression(&each.value)));
                }
                Statement::Def(def) => {
                    let parameters = def.parameters.iter().map(|parameter| match &parameter.default {
                        Some(default) => format!("{} = {}", parameter.name.text, expression(default)),
                        None => parameter.name.text.to_owned(),
                    });
                    let parameters = parameters.collect::<Vec<_>>().join(", ");
                    out.push_str(&format!("{indent}  {robots}def {}({parameters})\n", def.name.text));
                    self::block(&def.body, depth + 2, source, out);
                }
                Statement::If(each) => {
                    for (condition, inner) in &each.arms {
                        out.push_str(&format!("{indent}  {robots}if {}\n", expression(condition)));
                        self::block(inner, depth + 2, source, out);
                    }
                    if let Some(inner) = &each.otherwise {
                        out.push_str(&format!("{indent}  {robots}else\n"));
                        self::block(inner, depth + 2, source, out);
                    }
                }
                Statement::Call(call) => {
                    let given = call.arguments.iter().map(|given| {
                        let name = given.name.map(|name| format!("{}=", name.text)).unwrap_or_default();
                        format!("{name}{}", expression(&given.value))
                    });
                    let given = given.collect::<Vec<_>>().join(", ");
                    out.push_str(&format!("{indent}  {robots}call {}({given})\n", call.name.text));
                }
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
                other => panic!("{other:?}"),
            }
        }
    }
}

fn argument(argument: &Argument<'_>) -> String {
    let name = argument.name.map(|name| format!("{}=", name.text)).unwrap_or_default();
    let item = match &argument.item {
        Item::One(one) => value(one),
        Item::Arrow(ends) => format!("arrow({} {})", value(&ends.0), value(&ends.1)),
        Item::Range(ends) => format!("range({} {})", value(&ends.0), value(&ends.1)),
        Item::List(list) => format!("list({})", list.iter().map(value).collect::<Vec<_>>().join(" ")),
        Item::Comparison(sign) => format!("compare`{}`", sign.text),
        other => panic!("{other:?}"),
    };
    format!("{name}{item}")
}

fn value(value: &Value<'_>) -> String {
    let minus = if value.negative { "minus " } else { "" };
    match &value.kind {
        ValueKind::Number(shape, text) => format!("{minus}{shape:?}`{text}`"),
        ValueKind::Text(text) => format!("{minus}text{text}"),
        ValueKind::Word(text) => format!("{minus}word`{text}`"),
        ValueKind::Expression(inner) => format!("{minus}({})", expression(inner)),
        other => panic!("{other:?}"),
    }
}

/// The steps of an expression, operands before their operator.
fn expression(expression: &Expression<'_>) -> String {
    let steps = expression.nodes.iter().map(|node| match node.kind {
        NodeKind::Number(_, text) | NodeKind::Text(text) | NodeKind::Name(text) => text.to_owned(),
        NodeKind::Negate => "negate".to_owned(),
        NodeKind::Not => "not".to_owned(),
        NodeKind::Binary(binary) => format!("{binary:?}"),
        NodeKind::Skip(binary, over) => format!("{binary:?}?{over}"),
        NodeKind::Call(name, count) => format!("{name}/{count}"),
        other => panic!("{other:?}"),
    });
    steps.collect::<Vec<_>>().join(" ")
}
