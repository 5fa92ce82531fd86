//! Drawings of a given width on paper.

use dem_output::{Picture, Print, Printed};
use kuva::render::render::Primitive;

use crate::chart::{PADDING, SPACING};
use crate::{Chart, Drawing, Raster};

/// A point, the unit of letters, in metres.
const POINT: f64 = 0.0254 / 72.0;
/// Size of the smallest letters of charts, in units of a drawing.
const SMALLEST: f64 = 13.0;
/// Least width of a chart in units of a drawing, so that its ticks have room; and its height over
/// its width.
const LEAST: f64 = 300.0;
const HEIGHT: f64 = 0.72;
impl Picture for Drawing {
    fn svg(&self) -> String {
        self.svg()
    }

    fn png(&self) -> Result<Vec<u8>, String> {
        self.png()
    }

    fn printed(&self, print: Print) -> Result<Printed, String> {
        printed(self, print)
    }
}

/// A drawing as wide as asked for. Charts are laid out anew, with letters of [`Print::LETTERS`] and
/// as many beside each other as fit; maps are scaled.
fn printed(drawing: &Drawing, print: Print) -> Result<Printed, String> {
    if drawing.charts.is_empty() {
        return finished(drawing, print);
    }
    let width = print.width * SMALLEST / (Print::LETTERS * POINT) - 2.0 * PADDING;
    let fit = ((width + SPACING) / (LEAST + SPACING)) as usize;
    let columns = fit.clamp(1, drawing.charts.len());
    // whole numbers, as SVG states sizes
    let cell = ((width + SPACING) / columns as f64 - SPACING).floor();
    let (laid_out, _) = Chart::draw_in_columns(drawing.charts.clone(), (cell, (HEIGHT * cell).floor()), columns);
    finished(&laid_out, print)
}

fn finished(drawing: &Drawing, print: Print) -> Result<Printed, String> {
    let (width, height) = drawing.size();
    // metres in a unit of the drawing
    let unit = print.width / width;
    let letters = drawing.scene.elements.iter().filter_map(|element| match element {
        Primitive::Text { size, .. } => Some(f64::from(*size)),
        _ => None,
    });
    let smallest = letters.fold(f64::INFINITY, f64::min);
    let png = Raster::of(&drawing.scene, (print.dots * unit) as f32)?.png(print.dots)?;
    let size = |length: f64| format!("\"{:.3}mm\"", 1e3 * unit * length);
    let own = format!("width=\"{width}\" height=\"{height}\"");
    let paper = format!("width={} height={} viewBox=\"0 0 {width} {height}\"", size(width), size(height));
    let svg = drawing.svg();
    if !svg.contains(&own) {
        return Err(format!("the drawing does not state its size {own}"));
    }
    Ok(Printed { svg: svg.replacen(&own, &paper, 1), png, letters: smallest * unit / POINT })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Style, colour};

    fn charts(count: usize) -> Drawing {
        let chart = |k: usize| {
            let title = format!("title {k}");
            Chart::new("time (s)", &title).curve("", colour::BLUE, Style::Line, vec![(0.0, 0.0), (1.0, 1.0)])
        };
        Chart::draw((0..count).map(chart).collect())
    }

    #[test]
    fn charts_have_their_width_and_letters_of_seven_points() {
        for (millimetres, count) in [(85.0, 1), (85.0, 2), (170.0, 2), (170.0, 3)] {
            let print = Print { width: 1e-3 * millimetres, dots: 600.0 / 0.0254 };
            let found = printed(&charts(count), print).expect("a drawing");
            assert!(found.letters >= 6.99, "{} pt", found.letters);
            assert!(found.svg.contains(&format!("width=\"{millimetres:.3}mm\"")), "{}", &found.svg[..200]);
            // the header of a PNG holds its width
            let pixels = f64::from(u32::from_be_bytes([16, 17, 18, 19].map(|k| found.png[k])));
            assert!((pixels / (millimetres / 25.4 * 600.0) - 1.0).abs() < 0.002, "{pixels}");
        }
    }

    #[test]
    fn a_chart_with_equal_units_states_its_size() {
        for flat in [0.61, 0.87, 1.0] {
            let mut chart = Chart::new("x", "y").curve("", colour::BLUE, Style::Line, vec![(0.0, 0.0), (1.0, flat)]);
            chart.equal = true;
            let drawing = Chart::draw(vec![chart]);
            for millimetres in [60.0, 85.0, 174.0] {
                printed(&drawing, Print { width: 1e-3 * millimetres, dots: 1e4 }).expect("a drawing");
            }
        }
    }

    #[test]
    fn a_wide_map_tells_that_its_letters_are_small() {
        let mut canvas = crate::Canvas::new(1000.0, 300.0);
        canvas.text((10.0, 20.0), "a", 14, crate::Anchor::Start);
        let found = printed(&canvas.finish(), Print { width: 0.085, dots: 1e4 }).expect("a drawing");
        // 85 mm are 240.9 points
        assert!((found.letters - 14.0 * 0.2409448819).abs() < 1e-6, "{}", found.letters);
    }
}
