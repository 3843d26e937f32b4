//! `plot`: pictures of scripts.

use std::fs;
use std::path::{Path, PathBuf};

use crate::support::{run, stderr, stdout};
use motionseq::plot::{Plot, Shows, Theme, plot};
use motionseq::program::Options;
use motionseq::source::{Source, Sources};
use motionseq::units::Micros;
use serde_json::Value;

/// The plot of a text called `name`.
fn plotted(name: &str, text: &str) -> Plot {
    let sources = Sources::from(Source::new(name, text));
    let compiled = motionseq::compile(&sources, &Options::default().with_events(10_000_000));
    assert!(!compiled.timelines.is_empty(), "{}", crate::support::messages(&sources, &compiled.diagnostics));
    plot(&compiled.timelines, &sources, &compiled.diagnostics)
}

fn svg(name: &str, text: &str) -> String {
    plotted(name, text).to_svg(Theme::Light)
}

/// All texts of a picture, which must be well-formed.
fn texts(svg: &str) -> Vec<String> {
    let document = roxmltree::Document::parse(svg).unwrap_or_else(|error| panic!("{error}\n{svg}"));
    assert_eq!(document.root_element().tag_name().name(), "svg");
    let texts = document.descendants().filter(|node| node.has_tag_name("text"));
    texts.map(|node| node.text().unwrap_or_default().to_owned()).collect()
}

/// The paths of a class.
fn path<'s>(svg: &'s str, class: &str) -> Vec<&'s str> {
    let begin = format!("<path class=\"{class}\" d=\"");
    svg.split(&begin).skip(1).map(|rest| rest.split('"').next().unwrap()).collect()
}

#[test]
fn plots() {
    let _alone = crate::support::one_glob_at_a_time();
    insta::with_settings!({ snapshot_path => "plots", prepend_module_to_snapshot => false, omit_expression => true }, {
        insta::glob!("plots/*.motion", |path| {
            let name = path.file_name().unwrap().to_str().unwrap();
            let svg = svg(name, &fs::read_to_string(path).unwrap());
            texts(&svg);
            insta::assert_snapshot!("plots", svg);
        });
    });
}

#[test]
fn each_value_is_at_its_time_and_its_height() {
    // The lane of a servo covers 500 to 2500, and the lanes cover 4 s between 128 and 1184 pixels.
    let svg = svg("x.motion", "servo 1 500\nat 1s servo 1 2500\nat 3s servo 1 1500\nat 4s servo 1 1500\n");
    let [curve] = path(&svg, "curve")[..] else { panic!("{svg}") };
    let lanes = path(&svg, "lane");
    // `M128 yh…v84…`: the top of the first lane.
    let top: f64 = lanes[0].strip_prefix("M128 ").unwrap().split('h').next().unwrap().parse().unwrap();
    let [low, high, middle] = [top + 81.0, top + 3.0, top + 42.0];
    assert_eq!(curve, format!("M128 {low}H392V{high}H920V{middle}H1184"));
    assert_eq!(texts(&svg).iter().filter(|text| ["500", "1500", "2500"].contains(&text.as_str())).count(), 5);
}

#[test]
fn text_of_a_script_is_text_in_every_format() {
    let script = "say \"<img src=x onerror=alert(1)> & ]]> \\\"quoted\\\"\"\nwait 3s\nservo 1 1500\n";
    let plot = plotted("<img onerror=x>&\u{1b}[31m.motion", script);
    let svg = plot.to_svg(Theme::Auto);
    for page in [&svg, &plot.to_html(Theme::Auto)] {
        assert!(!page.contains("<img") && !page.contains('\u{1b}') && !page.contains("&\u{1b}"), "{page}");
    }
    let texts = texts(&svg);
    assert!(texts.contains(&"<img src=x onerror=alert(1)> & ]]> \"quoted\"".to_owned()), "{texts:?}");
    assert!(texts[0].starts_with("<img onerror=x>&") && texts[0].ends_with(".motion"), "{texts:?}");
}

#[test]
fn a_million_events_are_reduced_without_losing_extremes() {
    // 20,000 swings, and one moment at 2499.
    let text = "rate 50hz\nrepeat 10000 { servo 1 1000 -> 2000 over 1s; rocker x=20 z=30 for 1s\nservo 1 1000 over 1s\nmark a\nsay \"b\"\n}\nservo 1 2499\n+20ms servo 1 1000\nwait 2000s\n";
    let plot = plotted("x.motion", text);
    assert!(plot.tracks[0].frames > 1_000_000);
    let svg = plot.to_svg(Theme::Auto);
    assert!(svg.len() < 2_000_000, "{}", svg.len());
    texts(&svg);
    let [curve] = path(&svg, "curve")[..] else { panic!() };
    let heights: Vec<f64> = curve
        .split(['V', 'H', 'M'])
        .filter_map(|part| part.split(' ').nth(1).or(Some(part)))
        .filter_map(|n| n.parse().ok())
        .collect();
    let top: f64 = path(&svg, "lane")[0].strip_prefix("M128 ").unwrap().split('h').next().unwrap().parse().unwrap();
    // 2499 of 2500, to a tenth of a pixel.
    assert!(heights.contains(&(top + 3.0)), "{curve}");
    assert!(curve.len() < 60_000);
}

#[test]
fn the_data_are_what_is_sent() {
    let plot = plotted(
        "x.motion",
        "mark go\nservos 1500 1400\nat 0.5s rocker x=5 y=-3 for 1s\nat 2s servo 1 1600\nbuzzer on for 0.25s\n",
    );
    let data: Value = serde_json::from_str(&plot.to_json()).unwrap();
    let lanes = data["tracks"][0]["lanes"].as_array().unwrap();
    let lane = |name: &str| lanes.iter().find(|lane| lane["name"] == name).unwrap();
    let points = |name: &str| lane(name)["points"].to_string();
    assert_eq!(points("servo 1"), "[[0,1500.0],[2000000,1600.0]]");
    assert_eq!(points("servo 2"), "[[0,1400.0]]");
    assert_eq!(points("sideways"), "[[500000,5.0],[1500000,0.0]]");
    assert_eq!(points("forward"), "[[500000,-3.0],[1500000,0.0]]");
    assert_eq!(lane("buzzer")["spans"][0]["t_us"], 2_000_000);
    assert_eq!(lane("buzzer")["spans"][0]["until_us"], 2_250_000);
    assert_eq!(lanes.len(), 5, "{lanes:?}");
    assert_eq!((&data["end_us"], &data["marks"][0]["text"]), (&Value::from(2_250_000), &Value::from("go")));
    // One second at 5 and -3 cm/s.
    let end = data["tracks"][0]["path"].as_array().unwrap().last().unwrap();
    assert_eq!((end["x_cm"].as_f64().unwrap().round(), end["y_cm"].as_f64().unwrap().round()), (5.0, -3.0));
}

#[test]
fn a_late_frame_and_a_warning_are_where_they_happen() {
    let text = "baud 9600\nwait 1s\nraw 0x40 1 2 3\nservo 1 1500\nservo 3 1500\nwait 1s\n";
    let plot = plotted("x.motion", text);
    let late = &plot.tracks[0].wire.late;
    // 8 bytes at 9600 baud take 8.3 ms, and the next frames wait for them; the closing frames wait
    // for the 13 bytes of the stop.
    let late: Vec<(u64, u64)> = late.iter().map(|late| (late.at.0, late.late.0)).collect();
    assert_eq!(late, [(1_000_000, 8_334), (1_000_000, 16_667), (2_000_000, 13_542)]);
    let raw = plot.warnings.iter().find(|warning| warning.code == "raw-frame").unwrap();
    assert_eq!((raw.at, raw.line), (Some(Micros::SECOND), 3));
}

#[test]
fn limits_of_the_script_are_in_its_lane() {
    let plot = plotted("x.motion", "limit servo 1 900..2100\nservo 1 1500\nservo 2 1500\n");
    let limits = |at: usize| match &plot.tracks[0].lanes[at].shows {
        Shows::Curve { limits, range, .. } => (*limits, *range),
        other => panic!("{other:?}"),
    };
    assert_eq!(limits(0), (Some([900.0, 2100.0]), [500.0, 2500.0]));
    // A tilt servo is damaged beyond 1950.
    assert_eq!(limits(1), (None, [500.0, 1950.0]));
    assert_eq!(path(&plot.to_svg(Theme::Light), "limit").len(), 2);
}

#[test]
fn limits_have_numbers() {
    let drawn = texts(&svg("x.motion", "limit servo 1 900..2100\nservo 1 1500\nwait 1s\n"));
    for limit in ["limit 900", "limit 2100"] {
        assert!(drawn.iter().any(|text| text == limit), "{drawn:?}");
    }
}

#[test]
fn a_value_beyond_its_lane_stays_in_it_and_has_a_number() {
    let mut plot = plotted("x.motion", "servo 1 1500\nservo 2 1500\nat 1s servo 1 1600\nwait 2s\n");
    let Shows::Curve { points, .. } = &mut plot.tracks[0].lanes[0].shows else { panic!() };
    points[1].1 = Some(4_000.0);
    points.push((Micros::from_millis(1_500), Some(-700.0)));
    let svg = plot.to_svg(Theme::Light);
    // The lane is 84 high, and its curve stays 3 away from its edges.
    let top: f64 = path(&svg, "lane")[0].strip_prefix("M128 ").unwrap().split('h').next().unwrap().parse().unwrap();
    let [high, low] = [top + 3.0, top + 81.0];
    assert!(path(&svg, "curve")[0].contains(&format!("H480V{high}H656V{low}")), "{}", path(&svg, "curve")[0]);
    let drawn = texts(&svg);
    for value in ["4000", "-700"] {
        assert_eq!(drawn.iter().filter(|text| *text == value).count(), 1, "{drawn:?}");
    }
    assert_eq!(path(&svg, "warn").len(), 2);
}

#[test]
fn every_label_is_drawn_or_counted() {
    let lines: Vec<String> = (0..5).map(|n| format!("say \"number {n}\"\nmark place_{n}\nwait 1ms\n")).collect();
    let drawn = texts(&svg("x.motion", &format!("{}servo 1 1500\nwait 20s\n", lines.concat())));
    for n in 0..5 {
        for label in [format!("number {n}"), format!("place_{n}")] {
            assert!(drawn.contains(&label), "{label}: {drawn:?}");
        }
    }
    let drawn =
        texts(&svg("x.motion", &format!("{}servo 1 1500\nwait 20s\n", lines.concat().repeat(6).replace("mark", "#"))));
    let labels = drawn.iter().filter(|text| text.starts_with("number ")).count();
    assert!(drawn.contains(&format!("and {} more labels", 30 - labels)), "{drawn:?}");
}

#[test]
fn labels_do_not_overlap() {
    let svg = svg("x.motion", &fs::read_to_string("tests/plots/labels_that_need_room.motion").unwrap());
    let document = roxmltree::Document::parse(&svg).unwrap();
    let mut boxes: Vec<(f64, f64, f64)> = Vec::new();
    for node in document.descendants().filter(|node| ["text", "label"].contains(&node.attribute("class").unwrap_or("")))
    {
        let [x, y] = ["x", "y"].map(|name| node.attribute(name).unwrap().parse::<f64>().unwrap());
        // Letters are at most 0.6 of the font size wide on average.
        let wide = 0.6 * 13.0 * f64::from(u32::try_from(node.text().unwrap().chars().count()).unwrap());
        let from = if node.attribute("text-anchor") == Some("end") { x - wide } else { x };
        let meets = |other: &&(f64, f64, f64)| (other.2 - y).abs() < 12.0 && from < other.1 && from + wide > other.0;
        assert_eq!(boxes.iter().find(meets), None, "{:?} at {from}, {y}", node.text());
        boxes.push((from, from + wide, y));
    }
    assert_eq!(boxes.len(), 6 + 3 + 5 + 2, "{boxes:?}");
}

#[test]
fn a_raw_drive_frame_is_shown() {
    let drawn = texts(&svg("x.motion", "servo 1 1500\nwait 1s\nraw 3\nwait 1s\n"));
    assert!(drawn.contains(&"raw 0x03".to_owned()), "{drawn:?}");
}

#[test]
fn a_robot_that_is_back_is_not_turned_by_zero() {
    let spin = texts(&svg("x.motion", "rocker z=90 for 1s\nrocker z=-90 for 1s\n"));
    assert!(spin[1].ends_with(", turns on the spot, and ends facing as at the start"), "{spin:?}");
    let way = texts(&svg("x.motion", "rocker y=10 for 1s\nrocker y=-10 for 1s\nrocker y=10 for 1s\n"));
    assert!(way.contains(&"ends 10 cm forward,".to_owned()), "{way:?}");
    assert!(way.contains(&"facing as at the start".to_owned()), "{way:?}");
    let back = texts(&svg("x.motion", "rocker y=10 for 1s\nrocker y=-10 for 1s\n"));
    assert!(back.contains(&"ends at its start,".to_owned()), "{back:?}");
    for text in spin.iter().chain(&way).chain(&back) {
        assert!(!text.contains("0° to") && !text.contains(" 0 cm"), "{text}");
    }
}

#[test]
fn bars_go_with_the_speed_and_with_a_part_of_the_script() {
    let script = file("bars.motion");
    fs::write(&script, "tempo 120bpm\nservo 1 1500\nat bar 3 { servo 1 1600 }\nat bar 5 { servo 1 1500 }\n").unwrap();
    let bars = |args: &[&str]| {
        let output = run(&[&["plot", script.to_str().unwrap(), "--format", "json"], args].concat());
        let data: Value = serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
        (data["bars"]["first_us"].as_i64().unwrap(), data["bars"]["beat_us"].as_f64().unwrap())
    };
    assert_eq!(bars(&[]), (0, 500_000.0));
    assert_eq!(bars(&["--speed", "0.5"]), (0, 1_000_000.0));
    // A lead-in of a second, and three seconds that are left out.
    assert_eq!(bars(&["--from", "3s"]), (-2_000_000, 500_000.0));
    fs::remove_file(script).unwrap();
}

/// The path of a temporary file.
fn file(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("motionseq-plot-{}-{name}", std::process::id()))
}

/// A picture of a script, with its width, its height and its pixels.
#[cfg(feature = "png")]
fn pixels(name: &str, text: &str, more: &[&str]) -> (usize, usize, Vec<[u8; 3]>) {
    let (script, picture) = (file(&format!("{name}.motion")), file(&format!("{name}.png")));
    fs::write(&script, text).unwrap();
    let output = run(&[&["plot", script.to_str().unwrap(), "-o", picture.to_str().unwrap()], more].concat());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let decoder = png::Decoder::new(std::io::BufReader::new(fs::File::open(&picture).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgba, png::BitDepth::Eight));
    fs::remove_file(script).unwrap();
    fs::remove_file(picture).unwrap();
    let pixels = bytes.chunks_exact(4).map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    (info.width as usize, info.height as usize, pixels)
}

#[cfg(feature = "png")]
#[test]
fn a_png_has_its_size_its_curve_where_it_must_be_and_words() {
    let text = "servo 1 500\nat 2s servo 1 2500\nwait 2s\n";
    let (width, height, light) = pixels("light", text, &[]);
    assert_eq!(width, 1_200);
    assert!(height > 150 && height < 400, "{height}");
    let at = |pixels: &[[u8; 3]], x: usize, y: usize| pixels[y * width + x];
    let blue = [0x0b, 0x5c, 0xad];
    let column = |pixels: &[[u8; 3]], x: usize, colour: [u8; 3]| -> Vec<usize> {
        (0..height).filter(|y| at(pixels, x, *y) == colour).collect()
    };
    // The first half is low, the second half 78 pixels higher.
    let (first, second) = (column(&light, 300, blue), column(&light, 1_000, blue));
    assert!(!first.is_empty() && !second.is_empty());
    assert_eq!(first[0] - second[0], 78);
    // Where the value jumps, the curve covers a column from top to bottom.
    assert!(column(&light, 656, blue).len() > 70 || column(&light, 655, blue).len() > 70);
    // The title uses the included font: there are dark pixels in its place.
    let title = (12..32).flat_map(|y| (16..200).map(move |x| (x, y))).filter(|(x, y)| at(&light, *x, *y)[0] < 60);
    assert!(title.count() > 150);
    assert_eq!(at(&light, 1, 1), [255, 255, 255]);

    let (_, _, dark) = pixels("dark", text, &["--theme", "dark"]);
    assert_eq!(at(&dark, 1, 1), [0x11, 0x15, 0x1b]);
    assert!(!column(&dark, 300, [0x6d, 0xb3, 0xff]).is_empty());

    let (wide, high, _) = pixels("wide", text, &["--width", "2400"]);
    assert_eq!((wide, high), (2_400, height * 2));
}

#[test]
fn mistakes_are_reported() {
    for (args, why) in [
        (&["-o", "picture.gif"][..], "; use .svg, .png, .html or .json"),
        (&["-o", "scripts/hello.motion", "--format", "svg"], "this run reads it"),
        (&["--loop", "forever"], "write a number of passes, 1 or more"),
        (&["-o", "/tmp/no such folder/x.svg"], "No such file"),
    ] {
        let output = run(&[&["plot", "scripts/hello.motion"], args].concat());
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        assert!(stderr(&output).contains(why), "{}", stderr(&output));
    }
    let wrong = file("wrong.motion");
    fs::write(&wrong, "servo 9 1500\n").unwrap();
    let output = run(&["plot", wrong.to_str().unwrap()]);
    assert_eq!((output.status.code(), stdout(&output)), (Some(1), String::new()));
    fs::remove_file(wrong).unwrap();
}

#[test]
fn standard_output_takes_a_picture_and_a_page_is_one_file() {
    let output = run(&["plot", "scripts/hello.motion"]);
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(stdout(&output), {
        let text = fs::read_to_string("scripts/hello.motion").unwrap();
        plotted("scripts/hello.motion", &text).to_svg(Theme::Auto)
    });
    let page = stdout(&run(&["plot", "scripts/hello.motion", "--format", "html"]));
    assert!(page.starts_with("<!doctype html>") && page.contains("<title>scripts/hello.motion</title>"));
    // Nothing is loaded from elsewhere.
    assert!(!page.contains("src=") && !page.contains("href=") && !page.contains("url("), "{page}");
    assert!(Path::new("docs/pictures").is_dir());
}

#[test]
fn huge_labels_are_cut_to_the_available_width() {
    let (name, words) = ("n".repeat(3_000), "wörter ".repeat(8_000));
    let text = format!("mark {name}\nsay \"{words}\"\nservo 1 1500\nwait 1s\nexpect voltage > 10V \"{words}\"\n");
    let svg = svg(&format!("{}.motion", "f".repeat(500)), &text);
    let texts = texts(&svg);
    assert!(texts.iter().all(|text| text.chars().count() < 160), "{texts:?}");
    assert!(texts.iter().any(|text| text.starts_with("nnnn") && text.ends_with('…')), "{texts:?}");
    assert!(svg.len() < 20_000, "{}", svg.len());
}

#[test]
fn each_robot_has_a_band_of_its_own() {
    let mut plot = plotted("x.motion", "rocker y=10 for 1s\nservo 1 1500\n");
    let mut second = plot.tracks[0].clone();
    plot.tracks[0].robot = Some("left".to_owned());
    second.robot = Some("right <b>".to_owned());
    plot.tracks.push(second);
    let svg = plot.to_svg(Theme::Light);
    let texts = texts(&svg);
    let count = |word: &str| texts.iter().filter(|text| *text == word).count();
    assert_eq!([count("servo 1"), count("wire"), count("top view"), count("seconds")], [2, 2, 1, 1]);
    // Above its band, at its path, and below the top view.
    assert_eq!([count("left"), count("right <b>")], [3, 3]);
    // The bands are one below the other.
    let place = |name: &str| {
        let before = svg.split(&format!(">{name}</text>")).next().unwrap();
        let y = before.rsplit("y=\"").next().unwrap().split('"').next().unwrap();
        y.parse::<f64>().unwrap()
    };
    assert!(place("right &lt;b&gt;") - place("left") > 150.0, "{svg}");
    // The paths are side by side.
    let start = |robot: usize| {
        let paths = path(&svg, &format!("road road-{robot}"));
        paths[0].trim_start_matches('M').split(' ').next().unwrap().parse::<f64>().unwrap()
    };
    assert!(start(1) - start(0) > 20.0, "{svg}");
}

#[test]
fn one_robot_is_drawn_with_its_name() {
    let path = file("duet.motion");
    fs::write(&path, "robots left\nleft: servo 1 1500\n").unwrap();
    let name = path.to_str().unwrap();
    let drawn = stdout(&run(&["plot", name, "--robot", "left"]));
    assert!(texts(&drawn).contains(&"left".to_owned()), "{drawn}");
    let unknown = run(&["plot", name, "--robot", "rihgt"]);
    assert_eq!(unknown.status.code(), Some(2));
    assert!(
        stderr(&unknown).contains("the script has no robot `rihgt`; the robots are `left`"),
        "{}",
        stderr(&unknown)
    );
    fs::remove_file(path).unwrap();
}

#[test]
fn characters_that_xml_forbids_are_escaped() {
    let path = file("noncharacters.motion");
    fs::write(&path, "say \"a\u{FFFE}b\u{FFFF}\"\nservo 1 1500\nwait 1s\n").unwrap();
    let name = path.to_str().unwrap();
    for format in ["svg", "html"] {
        let drawn = stdout(&run(&["plot", name, "--format", format]));
        assert!(drawn.contains(r"a\u{fffe}b\u{ffff}") && !drawn.contains(['\u{FFFE}', '\u{FFFF}']), "{drawn}");
    }
    let png = run(&["plot", name, "--format", "png"]);
    assert_eq!(png.status.code(), Some(0), "{}", stderr(&png));
    fs::remove_file(path).unwrap();
}
