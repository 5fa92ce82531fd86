//! Ranges, ticks and margins of the axes of a chart.

use std::sync::Arc;

use kuva::render::layout::{ComputedLayout, Layout, TickFormat};
use kuva::render::render_utils::{generate_ticks, generate_ticks_log};

use crate::chart::{Chart, TICK};
use crate::legend::Style;
use crate::ticks::{self, linear, power_of_ten, whole};

/// Relative range up to which values are drawn as constant: the ticks of a smaller one would need
/// more digits than are legible, and show round-off.
const CONSTANT: f64 = 1e-6;
/// Share of a vertical axis that half a marker covers at most.
const MARKER: f64 = 0.02;
/// The axis of smaller counts ends at this value.
const FEW: f64 = 5.0;
/// Width of a letter of the label of a tick, and of what is beside the labels: title and ticks.
const LETTER: f64 = 7.8;
const BESIDE: f64 = 42.0;

impl Chart {
    /// Factor, a power of ten, of the values on a logarithmic vertical axis: the plotting crate
    /// misplaces values below 1e-10.
    pub(crate) fn lift(&self) -> f64 {
        let values = self.curves.iter().flat_map(|curve| &curve.points).map(|p| p.1);
        let low = values.filter(|y| self.log_y && *y > 0.0).fold(1.0, f64::min);
        if low < 1e-9 { 10f64.powi(-low.log10().floor() as i32) } else { 1.0 }
    }

    /// A linear vertical axis that is longer where a marker would be cut at its end.
    pub(crate) fn keep_markers_off_edges(&self, layout: Layout) -> Layout {
        let marked = self.curves.iter().filter(|curve| matches!(curve.style, Style::Points | Style::Marked));
        let points = marked.filter(|_| !self.log_y).flat_map(|curve| &curve.points);
        let [least, most] = points.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, m], p| [l.min(p.1), m.max(p.1)]);
        let (low, high) = ComputedLayout::from_layout(&layout).y_range;
        let marker = MARKER * (high - low);
        let layout = if least < low + marker { layout.with_y_axis_min(low - 2.0 * marker) } else { layout };
        if most > high - marker { layout.with_y_axis_max(high + 2.0 * marker) } else { layout }
    }

    /// A left margin in which the labels of a logarithmic axis and its title fit.
    pub(crate) fn with_room_for_powers(&self, layout: Layout, lift: f64) -> Layout {
        if !self.log_y {
            return layout;
        }
        let computed = ComputedLayout::from_layout(&layout);
        let ticks = generate_ticks_log(computed.y_range.0, computed.y_range.1);
        let letters = ticks.into_iter().map(|tick| power_of_ten(tick / lift).chars().count()).max().unwrap_or(0);
        let left = computed.margin_left.max(LETTER * letters as f64 + BESIDE);
        layout.with_force_margins(left, computed.margin_right)
    }

    /// Labels of the ticks of linear axes.
    pub(crate) fn label_ticks(&self, mut layout: Layout) -> Layout {
        // the labels have a width, on which the number of ticks depends
        for _ in 0..2 {
            let computed = ComputedLayout::from_layout(&layout);
            if !self.log_x && !self.x_is_count {
                let ticks = generate_ticks(computed.x_range.0, computed.x_range.1, computed.x_ticks);
                let unit = computed.plot_width() / (computed.x_range.1 - computed.x_range.0);
                if let Some(step) = ticks::step(&ticks, unit, f64::from(TICK)) {
                    layout = layout.with_x_tick_step(step);
                }
                layout = layout.with_x_tick_format(TickFormat::Custom(Arc::new(linear(&ticks))));
            }
            if !self.log_y && !self.y_is_count {
                let ticks = generate_ticks(computed.y_range.0, computed.y_range.1, computed.y_ticks);
                layout = layout.with_y_tick_format(TickFormat::Custom(Arc::new(linear(&ticks))));
            }
        }
        layout
    }

    /// Axes limited to the range of the values, with matching ticks. Values of y are multiplied by
    /// `lift`.
    pub(crate) fn scale_axes(&self, mut layout: Layout, lift: f64) -> Layout {
        let values = || self.curves.iter().flat_map(|curve| &curve.points);
        let bars = self.bars.iter().flat_map(|bars| &bars.bars);
        let places = values().map(|p| p.0).chain(bars.map(|bar| bar.0)).chain(self.moments.iter().copied());
        let places: Vec<f64> = places.collect();
        let low = places.iter().copied().fold(f64::INFINITY, f64::min);
        let high = places.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if self.log_x {
            layout = layout.with_log_x().with_x_tick_format(TickFormat::Custom(Arc::new(power_of_ten)));
            if self.pad_x && 0.0 < low && low < high {
                // the same share of the axis as in the linear case
                let off = (high / low).powf(0.04);
                layout = layout.with_x_axis_min(low / off).with_x_axis_max(high * off);
            }
        } else if low < high {
            let off = if self.pad_x { 0.03 * (high - low) } else { 0.0 };
            layout = layout.with_x_axis_min(low - off).with_x_axis_max(high + off);
        }
        if self.x_is_count && !self.log_x {
            layout = layout.with_x_tick_format(TickFormat::Custom(Arc::new(whole)));
            if high - low < FEW {
                layout = layout.with_x_axis_min(low).with_x_axis_max(low + FEW);
            }
        }
        if self.log_y {
            // the axis includes the marked levels, so that they are visible
            let levels = self.levels.iter().map(|(value, _)| value * lift).filter(|value| *value > 0.0);
            let shown: Vec<f64> = values().map(|p| p.1).chain(levels).collect();
            let low = shown.iter().copied().fold(f64::INFINITY, f64::min);
            let high = shown.iter().copied().fold(0.0, f64::max);
            let tick = move |value: f64| power_of_ten(value / lift);
            layout = layout.with_log_y().with_y_tick_format(TickFormat::Custom(Arc::new(tick)));
            if high > 10.0 * low {
                layout = layout.with_y_axis_min(0.6 * low).with_y_axis_max(1.6 * high);
            } else if low <= high {
                // within a decade there may be no tick at all: show the whole decade
                let decade = |x: f64| 10f64.powf(x);
                // a point on the edge would be clipped
                let (below, above) = ((0.8 * low).log10().floor(), (1.25 * high).log10().ceil());
                layout = layout.with_y_axis_min(decade(below)).with_y_axis_max(decade(above));
            }
        } else if self.y_is_count {
            layout = layout.with_y_tick_format(TickFormat::Custom(Arc::new(whole)));
            let high = values().map(|p| p.1).fold(0.0, f64::max);
            // on a shorter axis ticks would stand between whole numbers
            if high < FEW {
                layout = layout.with_y_axis_min(0.0).with_y_axis_max(FEW);
            }
        } else {
            // a marked level above or below all values is visible
            let [low, high] = values().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], p| [l.min(p.1), h.max(p.1)]);
            let levels = || self.levels.iter().map(|(value, _)| value * lift);
            let (deepest, level) = (levels().fold(low, f64::min), levels().fold(high, f64::max));
            let size = low.abs().max(high.abs());
            if low < high && high - low < CONSTANT * size {
                layout = layout.with_y_axis_min(low - 0.05 * size).with_y_axis_max(high + 0.05 * size);
            } else if low < high {
                let off = 0.08 * (level - deepest);
                layout = if level > high { layout.with_y_axis_max(level + off) } else { layout };
                layout = if deepest < low { layout.with_y_axis_min(deepest - off) } else { layout };
            }
        }
        layout
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Axes, colour};

    fn axes(chart: Chart) -> Axes {
        let (_, mut axes) = Chart::draw_located(vec![chart], (640.0, 460.0));
        axes.remove(0)
    }

    fn chart(style: Style, points: &[(f64, f64)]) -> Chart {
        Chart::new("x", "y").curve("", colour::BLUE, style, points.to_vec())
    }

    #[test]
    fn marked_levels_and_moments_are_within_the_axes() {
        let mut chart = chart(Style::Line, &[(2.0, 22.1), (3.0, 22.3)]);
        chart.levels.push((22.02, "level".into()));
        chart.moments = vec![1.5];
        let Axes { x, y, .. } = axes(chart);
        assert!(x[0] <= 1.5 && x[1] >= 3.0 && y[0] < 22.02 && y[1] > 22.3, "{x:?} {y:?}");
    }

    #[test]
    fn markers_are_not_cut_at_the_ends_of_the_axis() {
        for points in [[(1.0, 0.0), (2.0, 2.0)], [(1.0, -1.0), (2.0, 0.5)]] {
            for style in [Style::Points, Style::Marked] {
                let Axes { y, .. } = axes(chart(style, &points));
                let marker = 0.99 * MARKER * (y[1] - y[0]);
                let inside = |value: f64| y[0] + marker < value && value < y[1] - marker;
                assert!(points.iter().all(|point| inside(point.1)), "{y:?}");
            }
        }
    }

    /// A label such as 5·10⁻¹⁰ is wider than the plotting crate takes it to be.
    #[test]
    fn labels_of_powers_of_ten_have_room_beside_the_title() {
        let left = |low: f64| {
            let mut chart = chart(Style::Marked, &[(1.0, low), (2.0, 3.0 * low)]);
            chart.log_y = true;
            axes(chart).area[0]
        };
        // seven letters and the title
        assert!(left(2e-10) > 7.0 * LETTER + 20.0 && left(2e-10) > left(2.0), "{}", left(2e-10));
    }
}
