//! Charts of curves.

use kuva::plot::{LinePlot, ScatterPlot};
use kuva::render::annotations::ReferenceLine;
use kuva::render::figure::Figure;
use kuva::render::layout::{ComputedLayout, Layout};
use kuva::render::plots::Plot;

use crate::legend::{self, Named, Style};
use crate::titles;
use crate::{Canvas, Drawing, colour};

/// Width and height of one chart, in units of a drawing.
const CHART: (f64, f64) = (640.0, 460.0);

/// Heights of a chart with equal units on both axes that stay legible.
const HEIGHTS: [f64; 2] = [240.0, 900.0];
/// Margin around the cells of a figure, and between them.
pub(crate) const PADDING: f64 = 6.0;
pub(crate) const SPACING: f64 = 20.0;
/// Margins above the axes, for the legend, and below.
const ABOVE: f64 = 44.0;
const BELOW: f64 = 62.0;
/// Size of the labels of ticks.
pub(crate) const TICK: u32 = 13;
/// Titles of an axis of time, and the time below which it is in milliseconds (s).
const TIME: &str = "time (s)";
const SHORT_TIME: &str = "time (ms)";
const SHORT: f64 = 0.05;
/// Title of an axis of time that counts steps.
const STEP: &str = "step";
/// Maximum number of points of a curve: more than the pixels of its width, so that no visible point
/// is lost.
const CURVE_POINTS: usize = 4000;

/// A named curve.
#[derive(Clone)]
pub struct Curve {
    /// Its name in the legend.
    pub label: String,
    /// Points (x, y). Points that are not finite, or not positive on a logarithmic axis, are
    /// omitted.
    pub points: Vec<(f64, f64)>,
    /// Its style.
    pub style: Style,
    /// Its colour.
    pub colour: &'static str,
    /// Time of each point (s); empty if the points are at no times of the run.
    pub times: Vec<f64>,
    /// Whether the legend has it.
    pub listed: bool,
}

/// Means with error bars.
#[derive(Clone)]
pub struct Bars {
    /// Their name in the legend.
    pub label: String,
    /// Their colour.
    pub colour: &'static str,
    /// Position x, mean y, and half-length of the bar.
    pub bars: Vec<(f64, f64, f64)>,
}

/// A chart of curves.
#[derive(Clone, Default)]
pub struct Chart {
    /// Title of the horizontal axis, with its unit.
    pub x: String,
    /// Title of the vertical axis, with its unit.
    pub y: String,
    /// Whether the horizontal axis is logarithmic.
    pub log_x: bool,
    /// Whether the vertical axis is logarithmic.
    pub log_y: bool,
    /// Whether the horizontal axis extends a little beyond the first and the last value, so that a
    /// steep rise there is visible.
    pub pad_x: bool,
    /// Whether a unit is as long on the vertical axis as on the horizontal one. The height of the
    /// chart follows from its width; of a chart beside others, more of an axis is shown.
    pub equal: bool,
    /// Whether values on the vertical axis are counts.
    pub y_is_count: bool,
    /// Whether values on the horizontal axis are counts.
    pub x_is_count: bool,
    /// The curves.
    pub curves: Vec<Curve>,
    /// Means with bars, over the curves.
    pub bars: Option<Bars>,
    /// Marked values of y, with their names in the legend.
    pub levels: Vec<(f64, String)>,
    /// Marked values of x.
    pub moments: Vec<f64>,
    /// Where an axis of time counts steps, what a step adds to the time (s).
    pub step: Option<f64>,
}

/// The axes of a chart in its drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    /// Left, upper, right and lower edge of the area of the curves, in units of the drawing.
    pub area: [f64; 4],
    /// Values at the left and at the right edge.
    pub x: [f64; 2],
    /// Values at the lower and at the upper edge.
    pub y: [f64; 2],
    /// Whether each axis is logarithmic.
    pub log: [bool; 2],
}

impl Axes {
    /// The axes of a layout whose cell begins at `corner`; values of y are multiplied by `lift`.
    fn of(layout: &ComputedLayout, corner: (f64, f64), lift: f64) -> Self {
        let (left, top) = (corner.0 + layout.margin_left, corner.1 + layout.margin_top);
        Self {
            area: [left, top, left + layout.plot_width(), top + layout.plot_height()],
            x: layout.x_range.into(),
            y: [layout.y_range.0 / lift, layout.y_range.1 / lift],
            log: [layout.log_x, layout.log_y],
        }
    }

    /// The place of a point in the area: its share of the width from the left and of the height
    /// from below.
    pub fn share(&self, point: (f64, f64)) -> [f64; 2] {
        let part = |value: f64, [low, high]: [f64; 2], log: bool| {
            let of = |x: f64| if log { x.log10() } else { x };
            (of(value) - of(low)) / (of(high) - of(low))
        };
        [part(point.0, self.x, self.log[0]), part(point.1, self.y, self.log[1])]
    }
}

impl Chart {
    /// A chart with titles of its axes.
    pub fn new(x: &str, y: &str) -> Self {
        Self { x: x.into(), y: y.into(), ..Self::default() }
    }

    /// A chart over the time (s).
    pub fn over_time(y: &str) -> Self {
        Self::new(TIME, y)
    }

    /// Adds a curve.
    pub fn curve(mut self, label: &str, colour: &'static str, style: Style, points: Vec<(f64, f64)>) -> Self {
        self.curves.push(Curve { label: label.into(), points, style, colour, times: vec![], listed: true });
        self
    }

    /// States the time of each point of the last curve (s).
    pub fn timed(mut self, times: &[f64]) -> Self {
        if let Some(curve) = self.curves.last_mut() {
            curve.times = times.to_vec();
        }
        self
    }

    /// Leaves the last curve out of the legend: it has the colour of a curve that is there.
    pub fn unlisted(mut self) -> Self {
        if let Some(curve) = self.curves.last_mut() {
            curve.listed = false;
        }
        self
    }

    /// With a short time in milliseconds, and with a time that counts steps in steps.
    pub fn readable(mut self) -> Self {
        if self.x != TIME || self.log_x {
            return self;
        }
        let times = || self.curves.iter().flat_map(|curve| &curve.points).map(|p| p.0.abs());
        let last = times().filter(|time| time.is_finite()).fold(0.0, f64::max);
        if let Some(step) = self.step {
            (self.x, self.x_is_count) = (STEP.into(), true);
            self.map_x(|time| (time / step).round());
        } else if last > 0.0 && last < SHORT {
            self.x = SHORT_TIME.into();
            self.map_x(|time| 1e3 * time);
        }
        self
    }

    fn map_x(&mut self, to: impl Fn(f64) -> f64) {
        self.curves.iter_mut().flat_map(|curve| &mut curve.points).for_each(|point| point.0 = to(point.0));
        self.bars.iter_mut().flat_map(|bars| &mut bars.bars).for_each(|bar| bar.0 = to(bar.0));
        self.moments.iter_mut().for_each(|moment| *moment = to(*moment));
    }

    /// Units of the horizontal axis in a second of the run; `None` where the axis is not the time.
    pub fn second(&self) -> Option<f64> {
        match &*self.x {
            TIME => Some(1.0),
            SHORT_TIME => Some(1e3),
            STEP => self.step.map(|step| 1.0 / step),
            _ => None,
        }
    }

    /// Draws the charts side by side, each with its legend above it.
    pub fn draw(charts: Vec<Self>) -> Drawing {
        Self::draw_sized(charts, CHART)
    }

    /// As [`Chart::draw`], each chart of a given width and height in units of the drawing.
    pub fn draw_sized(charts: Vec<Self>, size: (f64, f64)) -> Drawing {
        Self::draw_located(charts, size).0
    }

    /// As [`Chart::draw_sized`], with the axes of each chart.
    pub fn draw_located(charts: Vec<Self>, size: (f64, f64)) -> (Drawing, Vec<Axes>) {
        let columns = charts.len();
        Self::draw_in_columns(charts, size, columns)
    }

    /// As [`Chart::draw_located`], in so many columns.
    pub(crate) fn draw_in_columns(charts: Vec<Self>, size: (f64, f64), columns: usize) -> (Drawing, Vec<Axes>) {
        let (columns, count) = (columns.max(1), charts.len());
        let kept = charts.clone();
        let legends: Vec<Vec<Named>> = charts.iter().map(Self::legend).collect();
        // all begin at one height
        let most = legends.iter().map(|legend| legend::rows(legend, size.0).len()).max().unwrap_or(0);
        let above = ABOVE.max(legend::ROW * most as f64 + 6.0);
        let size = match charts.as_slice() {
            [chart] if chart.equal => (size.0, chart.equal_height(above, size)),
            _ => size,
        };
        let size = (size.0, size.1.max(titles::height(charts.iter().map(|chart| chart.y.as_str()), above, BELOW)));
        let corner = |k: usize| {
            let place = |k: usize, length: f64| PADDING + k as f64 * (length + SPACING);
            (place(k % columns, size.0), place(k / columns, size.1))
        };
        let (mut axes, mut titles): (Vec<Axes>, Vec<String>) = (vec![], vec![]);
        let (plots, layouts) = charts
            .into_iter()
            .map(|chart| {
                let chart = chart.readable();
                titles.push(chart.x.clone());
                let (plots, layout, lift) = chart.build(above, size);
                axes.push(Axes::of(&ComputedLayout::from_layout(&layout), corner(axes.len()), lift));
                (plots, layout)
            })
            .unzip();
        let figure = Figure::new(count.div_ceil(columns).max(1), columns)
            .with_plots(plots)
            .with_layouts(layouts)
            .with_cell_size(size.0, size.1)
            .with_spacing(SPACING)
            .with_padding(PADDING);
        let figure = if count > 1 { figure.with_labels_lowercase() } else { figure };
        // round ends would fill the gaps of dashed lines
        let mut canvas = Canvas { scene: figure.render(), round_ends: false };
        titles::wrap(&mut canvas.scene.elements, &titles, size.0);
        for (k, legend) in legends.iter().enumerate() {
            let (left, top) = corner(k);
            let rows = legend::rows(legend, size.0);
            for (r, row) in rows.iter().enumerate() {
                let y = top + 0.5 * above + legend::ROW * (r as f64 - 0.5 * (rows.len() - 1) as f64);
                legend::draw(&mut canvas, row, (left + 0.55 * size.0, y));
            }
        }
        (Drawing { charts: kept, ..canvas.finish() }, axes)
    }

    /// Name, colour and style of each curve and each marked level; a single entry needs no name.
    fn legend(&self) -> Vec<Named> {
        let listed = self.curves.iter().filter(|curve| curve.listed);
        let curves = listed.map(|curve| (curve.label.clone(), curve.colour, curve.style));
        let bars = self.bars.iter().map(|bars| (bars.label.clone(), bars.colour, Style::Bars));
        let levels = self.levels.iter().map(|(_, label)| (label.clone(), colour::GREY, Style::Level));
        let entries: Vec<_> = curves.chain(bars).chain(levels).collect();
        if entries.len() < 2 { vec![] } else { entries }
    }

    /// Plots, layout, and the factor of [`Chart::lift`].
    fn build(mut self, above: f64, size: (f64, f64)) -> (Vec<Plot>, Layout, f64) {
        let lift = self.lift();
        for curve in &mut self.curves {
            let visible = |&(x, y): &(f64, f64)| {
                x.is_finite() && y.is_finite() && (!self.log_x || x > 0.0) && (!self.log_y || y > 0.0)
            };
            curve.points.retain(visible);
            thin(&mut curve.points);
            curve.points.iter_mut().for_each(|point| point.1 *= lift);
        }
        let mut plots: Vec<Plot> = self.curves.iter().flat_map(Curve::plots).collect();
        plots.extend(self.bars.as_ref().map(|bars| bars.plot(lift, self.log_y)));
        let mut layout = Layout::auto_from_plots(&plots)
            .with_x_label(&self.x)
            .with_y_label(&self.y)
            .with_label_size(titles::SIZE)
            .with_tick_size(TICK)
            .with_body_size(13)
            .with_force_margins_y(above, BELOW)
            .with_width(size.0)
            .with_height(size.1)
            .with_box_axes();
        layout.show_legend = false;
        layout.equal_aspect = self.equal;
        layout = self.label_ticks(self.keep_markers_off_edges(self.scale_axes(layout, lift)));
        layout = self.with_room_for_powers(layout, lift);
        for (value, _) in self.levels {
            layout = layout.with_reference_line(ReferenceLine::horizontal(value * lift).with_color(colour::GREY));
        }
        for value in self.moments {
            layout = layout.with_reference_line(ReferenceLine::vertical(value).with_color(colour::GREY));
        }
        (plots, layout, lift)
    }

    /// The height at which a unit is as long on the vertical axis as on the horizontal one, if it
    /// is legible.
    fn equal_height(&self, above: f64, size: (f64, f64)) -> f64 {
        let (_, layout, lift) = Self { equal: false, ..self.clone() }.build(above, size);
        let Axes { area: [left, top, right, bottom], x, y, .. } =
            Axes::of(&ComputedLayout::from_layout(&layout), (0.0, 0.0), lift);
        let unit = (right - left) / (x[1] - x[0]);
        // a whole number, as SVG states sizes
        (size.1 - (bottom - top) + unit * (y[1] - y[0])).round().clamp(HEIGHTS[0], HEIGHTS[1])
    }
}

impl Curve {
    fn plots(&self) -> Vec<Plot> {
        let points = || self.points.iter().copied();
        let line = LinePlot::new().with_data(points()).with_color(self.colour).with_stroke_width(1.8);
        match self.style {
            Style::Line | Style::Level | Style::Bars => vec![line.into()],
            Style::Thin => vec![line.with_stroke_width(1.0).into()],
            Style::Steps => vec![line.with_step().into()],
            Style::Marked => {
                let dots = ScatterPlot::new().with_data(points()).with_color(self.colour).with_size(3.5);
                vec![line.with_stroke_width(1.2).into(), dots.into()]
            }
            Style::Points => {
                vec![ScatterPlot::new().with_data(points()).with_color(self.colour).with_size(4.0).into()]
            }
        }
    }
}

impl Bars {
    fn plot(&self, lift: f64, log_y: bool) -> Plot {
        // a bar below zero has no end on a logarithmic axis: it is cut at a hundredth of the mean
        let down = |mean: f64, half: f64| if log_y { half.min(0.99 * mean) } else { half };
        let errors = self.bars.iter().map(|&(_, mean, half)| (lift * down(mean, half), lift * half));
        ScatterPlot::new()
            .with_data(self.bars.iter().map(|&(x, mean, _)| (x, lift * mean)))
            .with_y_err_asymmetric(errors)
            .with_color(self.colour)
            .with_size(3.5)
            .into()
    }
}

/// Thins a long curve to the points of [`thinned`].
fn thin(points: &mut Vec<(f64, f64)>) {
    if points.len() > CURVE_POINTS {
        *points = thinned(points, CURVE_POINTS).into_iter().map(|k| points[k]).collect();
    }
}

/// The places of at most `most` points of a curve, in order: the first, lowest, highest and last
/// point of each interval, so that no peak is lost.
pub fn thinned(points: &[(f64, f64)], most: usize) -> Vec<usize> {
    if points.len() <= most {
        return (0..points.len()).collect();
    }
    let stretch = points.len().div_ceil((most / 4).max(1));
    let mut kept = Vec::with_capacity(most);
    for start in (0..points.len()).step_by(stretch) {
        let part = start..(start + stretch).min(points.len());
        let by = |a: &usize, b: &usize| points[*a].1.total_cmp(&points[*b].1);
        let low = part.clone().min_by(by).unwrap_or(start);
        let high = part.clone().max_by(by).unwrap_or(start);
        let mut picks = [start, low, high, part.end - 1];
        picks.sort_unstable();
        kept.extend(picks.iter().enumerate().filter(|&(n, k)| n == 0 || picks[n - 1] != *k).map(|(_, &k)| k));
    }
    kept
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use kuva::backend::svg::SvgBackend;

    use super::*;

    #[test]
    fn a_thinned_curve_keeps_its_peak_and_its_ends() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|k| (f64::from(k), 0.0)).collect();
        points[54_321].1 = 7.0;
        thin(&mut points);
        assert!(points.len() <= CURVE_POINTS);
        assert!(points.contains(&(54_321.0, 7.0)));
        assert_eq!((points[0].0, points[points.len() - 1].0), (0.0, 99_999.0));
    }

    #[test]
    fn a_circle_is_round_if_units_are_equal() {
        let circle = |flat: f64| -> Vec<(f64, f64)> {
            (0..=64).map(|k| f64::from(k) * PI / 32.0).map(|t| (50.0 * t.cos(), flat * 50.0 * t.sin())).collect()
        };
        // of a flat curve the height has a limit, and more of the vertical axis is shown
        for (flat, size) in [(1.0, (640.0, 460.0)), (1.0, (300.0, 216.0)), (0.01, (640.0, 460.0))] {
            let mut chart = Chart::new("x", "y").curve("", colour::BLUE, Style::Line, circle(flat));
            chart.equal = true;
            let (drawing, axes) = Chart::draw_located(vec![chart], size);
            let Axes { area: [left, top, right, bottom], x, y, .. } = axes[0];
            let units = [(right - left) / (x[1] - x[0]), (bottom - top) / (y[1] - y[0])];
            assert!((units[0] / units[1] - 1.0).abs() < 1e-9, "{units:?}");
            assert!(bottom < drawing.size().1 && drawing.size().0 == size.0 + 2.0 * PADDING);
            assert!(x[0] <= -50.0 && x[1] >= 50.0 && y[0] <= -50.0 * flat && y[1] >= 50.0 * flat, "{x:?}, {y:?}");
        }
    }

    #[test]
    fn round_off_is_drawn_as_a_constant() {
        for value in [0.06086, -17.0, 3e7] {
            let points = (0..50).map(|k| (f64::from(k), value * (1.0 + 1e-12 * f64::from(k * k % 7)))).collect();
            let chart = Chart::new("x", "y").curve("", colour::BLUE, Style::Line, points);
            let Axes { y: [low, high], .. } = Chart::draw_located(vec![chart], (460.0, 330.0)).1[0];
            assert!(high - low > 0.05 * value.abs() && low < value && value < high, "{low} to {high}");
        }
    }

    #[test]
    fn axes_are_where_points_are_drawn() {
        for (log_x, log_y, points) in [
            (false, false, vec![(0.0, 3.0), (2.0, 11.0), (7.5, -4.0)]),
            (true, true, vec![(1e-6, 3e-13), (2e-3, 4e-9), (0.3, 5e-2)]),
        ] {
            let charts = ["first", "second"].map(|title| {
                let mut chart = Chart::new("x", title).curve("", colour::BLUE, Style::Points, points.clone());
                (chart.log_x, chart.log_y) = (log_x, log_y);
                chart
            });
            let (drawing, axes) = Chart::draw_located(charts.into(), (500.0, 400.0));
            let svg = SvgBackend::new().render_scene(&drawing.scene);
            // centres of the dots within the cells, which are moved to their places
            let of = |tag: &str, name: &str| -> f64 {
                tag.split(&format!(" {name}=\"")).nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
            };
            let dots: Vec<[f64; 2]> = svg.split("<circle").skip(1).map(|tag| [of(tag, "cx"), of(tag, "cy")]).collect();
            assert_eq!(dots.len(), 6);
            for (chart, axes) in axes.iter().enumerate() {
                let [left, top, right, bottom] = axes.area;
                for (point, dot) in points.iter().zip(&dots[3 * chart..]) {
                    let [x, y] = axes.share(*point);
                    let corner = [PADDING + chart as f64 * (500.0 + SPACING), PADDING];
                    let off = [
                        left + x * (right - left) - corner[0] - dot[0],
                        bottom + y * (top - bottom) - corner[1] - dot[1],
                    ];
                    assert!(off.iter().all(|off| off.abs() < 0.02), "{point:?}: {off:?}");
                }
            }
        }
    }

    #[test]
    fn a_level_above_all_values_is_on_the_axis() {
        let chart = |level: f64| {
            let mut chart = Chart::new("x", "y").curve("a", colour::BLUE, Style::Line, vec![(0.0, 0.0), (1.0, 10.0)]);
            chart.levels.push((level, "level".into()));
            Chart::draw_located(vec![chart], CHART).1[0].y[1]
        };
        assert!(chart(35.0) > 35.0 && chart(5.0) < 15.0);
    }

    #[test]
    fn an_unlisted_curve_is_drawn_without_an_entry() {
        let points = || vec![(0.0, 0.0), (1.0, 1.0)];
        let chart = Chart::new("x", "y").curve("first", colour::BLUE, Style::Line, points());
        let chart = chart.curve("second", colour::GREEN, Style::Line, points());
        let both = Chart::draw(vec![chart.clone()]).svg();
        let one =
            Chart::draw(vec![chart.clone().curve("third", colour::GREEN, Style::Line, points()).unlisted()]).svg();
        assert!(both.contains(">second<") && one.contains(">second<") && !one.contains("third"));
        assert!(one.len() > both.len());
    }
}
