//! Shorter SVG with the same picture: coordinates with two decimals, and shapes in a row that share
//! their colours and widths in a group that states them once.
//!
//! The plotting crate states every attribute of every shape, and prints numbers that it has rounded
//! as 96.60000000000001.

use std::fmt::Write;

/// Shapes that may stand in a group.
const SHAPES: [&str; 6] = ["circle", "line", "path", "polygon", "polyline", "rect"];
/// Attributes of lengths, in units of the drawing.
const LENGTHS: [&str; 14] =
    ["cx", "cy", "d", "height", "points", "r", "stroke-width", "width", "x", "x1", "x2", "y", "y1", "y2"];
/// Attributes that a shape inherits from its group, without `fill`: fills may differ in a group.
const INHERITED: [&str; 6] =
    ["fill-opacity", "stroke", "stroke-dasharray", "stroke-linecap", "stroke-linejoin", "stroke-width"];

/// A shape with its attributes, each as ` name="value"`.
struct Shape {
    name: String,
    /// Those of its own.
    own: String,
    /// Its fill.
    fill: String,
    /// Those that it may inherit.
    style: String,
}

/// The same picture in fewer bytes.
pub fn compact(svg: &str) -> String {
    let mut out = String::with_capacity(svg.len());
    let mut row: Vec<Shape> = vec![];
    let mut rest = svg;
    while let Some((text, tag, after)) = next_tag(rest) {
        let shape = Shape::read(tag);
        let continues = text.is_empty()
            && matches!((&shape, row.first()), (Some(shape), Some(first)) if shape.style == first.style);
        if !continues {
            flush(&mut row, &mut out);
        }
        out += text;
        match shape {
            Some(shape) => row.push(shape),
            None => out += tag,
        }
        rest = after;
    }
    flush(&mut row, &mut out);
    out + rest
}

/// The text before the next tag or comment, the tag, and what follows it.
fn next_tag(svg: &str) -> Option<(&str, &str, &str)> {
    let start = svg.find('<')?;
    let (text, tail) = svg.split_at(start);
    let end = if tail.starts_with("<!--") {
        tail.find("-->")? + 3
    } else {
        let mut quoted = false;
        let close = tail.char_indices().find(|(_, letter)| {
            quoted ^= *letter == '"';
            *letter == '>' && !quoted
        });
        close?.0 + 1
    };
    let (tag, after) = tail.split_at(end);
    Some((text, tag, after))
}

impl Shape {
    /// The shape of a tag without content; `None` for any other tag.
    fn read(tag: &str) -> Option<Self> {
        let inner = tag.strip_prefix('<')?.strip_suffix("/>")?.trim_end();
        let (name, mut rest) = inner.split_once(' ')?;
        if !SHAPES.contains(&name) {
            return None;
        }
        let mut shape = Self { name: name.into(), own: String::new(), fill: String::new(), style: String::new() };
        while !rest.trim_start().is_empty() {
            let (name, after) = rest.trim_start().split_once("=\"")?;
            let (value, after) = after.split_once('"')?;
            let part = match name {
                "fill" => &mut shape.fill,
                _ if INHERITED.contains(&name) => &mut shape.style,
                _ => &mut shape.own,
            };
            let value = if LENGTHS.contains(&name) { rounded(value) } else { value.into() };
            let value = if name == "d" { joined(&value) } else { value };
            let _ = write!(part, " {name}=\"{value}\"");
            rest = after;
        }
        Some(shape)
    }
}

/// Writes a row of shapes of one style, in a group where there are several.
fn flush(row: &mut Vec<Shape>, out: &mut String) {
    let Some(first) = row.first() else { return };
    let filled = row.iter().all(|shape| shape.fill == first.fill);
    let shared = format!("{}{}", first.style, if filled { &first.fill } else { "" });
    let grouped = row.len() > 1 && !shared.is_empty();
    if grouped {
        let _ = write!(out, "<g{shared}>");
    }
    for Shape { name, own, fill, style } in row.iter() {
        let style = if grouped { "" } else { style };
        let fill = if grouped && filled { "" } else { fill };
        let _ = write!(out, "<{name}{own}{fill}{style}/>");
    }
    if grouped {
        *out += "</g>";
    }
    row.clear();
}

/// The text with its decimal numbers rounded to two decimals.
fn rounded(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(start) = rest.find(|letter: char| letter.is_ascii_digit()) {
        out += &rest[..start];
        let tail = &rest[start..];
        let end = tail.find(|letter: char| !letter.is_ascii_digit() && letter != '.').unwrap_or(tail.len());
        let (digits, after) = tail.split_at(end);
        match digits.parse::<f64>() {
            // a power of ten would change the meaning of the decimals
            Ok(number) if digits.contains('.') && !after.starts_with(['e', 'E']) => {
                let short = format!("{number:.2}");
                out += short.trim_end_matches('0').trim_end_matches('.');
            }
            _ => out += digits,
        }
        rest = after;
    }
    out + rest
}

/// A path of straight lines without the letters and spaces that it does not need.
fn joined(path: &str) -> String {
    let straight = |letter: char| letter.is_ascii_digit() || "MLZ.,- ".contains(letter);
    if !path.chars().all(straight) {
        return path.into();
    }
    // points after the first of M are ends of lines
    path.replace(" L ", " ").replace(" L", " ").replace("M ", "M").replace(" Z", "Z").trim_end().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_two_decimals() {
        for (long, short) in [
            ("96.60000000000001", "96.6"),
            ("-3.004", "-3"),
            ("M 1.005 2 L -0.126 40", "M 1 2 L -0.13 40"),
            ("100", "100"),
            ("1.234e-5", "1.234e-5"),
        ] {
            assert_eq!(rounded(long), short);
        }
    }

    #[test]
    fn a_path_of_lines_needs_one_letter() {
        assert_eq!(joined("M 1 2 L 3 4 L 5 6"), "M1 2 3 4 5 6");
        assert_eq!(joined("M1,2 L3,4 L5,6 Z"), "M1,2 3,4 5,6Z");
        assert_eq!(joined("M 1 2 C 3 4 5 6 7 8 L 9 9"), "M 1 2 C 3 4 5 6 7 8 L 9 9");
    }

    #[test]
    fn shapes_of_one_style_share_a_group() {
        let line =
            |x: &str, width: &str| format!(r##"<line x1="{x}" y1="0" stroke="#0072b2" stroke-width="{width}" />"##);
        let svg = format!("<svg>{}{}{}</svg>", line("1.000000001", "0.8"), line("2", "0.8"), line("3", "1"));
        let expected = concat!(
            r##"<svg><g stroke="#0072b2" stroke-width="0.8"><line x1="1" y1="0"/><line x1="2" y1="0"/></g>"##,
            r##"<line x1="3" y1="0" stroke="#0072b2" stroke-width="1"/></svg>"##
        );
        assert_eq!(compact(&svg), expected);
    }

    #[test]
    fn fills_that_differ_stay_with_their_shapes() {
        let disk = |fill: &str| format!(r#"<circle r="1" fill="{fill}" stroke="grey" />"#);
        let expected =
            r#"<g stroke="grey"><circle r="1" fill="red"/><circle r="1" fill="blue"/></g><text>1.00000 &gt; 0</text>"#;
        assert_eq!(compact(&(disk("red") + &disk("blue") + "<text>1.00000 &gt; 0</text>")), expected);
        assert_eq!(
            compact(&(disk("red") + &disk("red"))),
            r#"<g stroke="grey" fill="red"><circle r="1"/><circle r="1"/></g>"#
        );
    }

    #[test]
    fn what_is_no_shape_stays_as_it_is() {
        let svg = "<svg width=\"1.2345\"><!-- <line /> 1.0001 --><clipPath id=\"a-0.001\"></clipPath>a < b";
        assert_eq!(compact(svg), svg);
        // the opacity of a group is not that of its shapes
        let faint = r#"<rect x="1" opacity="0.1234"/>"#;
        assert_eq!(compact(&faint.repeat(2)), faint.repeat(2));
    }
}
