//! Sections of the page without an analysis of their own: the accuracy of the solver, the energy.

use dem_drawing::{Style, colour};
use dem_history::{History, Series};

use super::solver::Accuracy;
use crate::clock::Clock;
use crate::output::{Result, number};
use crate::section::{Maps, OnPage, Section, capitalised, chart_figure};

/// The points of an observable over time; empty if it was not recorded.
fn points(series: Option<Series>) -> Vec<(f64, f64)> {
    series.map_or_else(Vec::new, |s| s.time.into_iter().zip(s.value).collect())
}

impl OnPage for Accuracy {
    const ID: &'static str = "accuracy";
    const TITLE: &'static str = "Accuracy of the solver";

    fn section(&self, history: &History, _: &Maps) -> Result<Section> {
        let mut figures = vec![];
        for (name, title, what, steps) in [
            ("solver_residual", "residual", "Residual of the accepted solve of each step", false),
            ("solver_load_error", "load error", "Load error of each step", false),
            ("false_acceleration", "false acceleration", "False acceleration of each step", false),
            ("solver_iterations", "iterations of a step", "Iterations of each step", true),
            ("penetration", "penetration (m)", "Deepest penetration of each step", false),
        ] {
            let points: Vec<(f64, f64)> = points(history.observable(name)?).into_iter().filter(|p| p.1 > 0.0).collect();
            // a logarithmic axis shows no zeros
            if points.len() < 2 {
                continue;
            }
            let mut curve = self.clock.chart(title).curve(title, colour::BLUE, Style::Thin, points);
            curve.log_y = true;
            let tolerance = self.tolerance.filter(|_| name == "solver_residual");
            if let Some(tolerance) = tolerance {
                curve.levels.push((tolerance, format!("tolerance: {tolerance:e}")));
            }
            let alt = format!("{what} over {}.", self.clock.over());
            let left_out = if steps { "steps without any are left out" } else { "steps where it is zero are left out" };
            figures.push(chart_figure(curve, &alt, &format!("{alt} {}.", capitalised(left_out))));
        }
        Ok(Section {
            text:
                "The residual is the violation of the contact laws, relative to the reactions and the load. The load \
                   error is the estimated error of the net impulses of the contacts on the bodies, and of elastic \
                   forces, relative to these; only the direct solvers report it. The false acceleration is the \
                   inertial force of the grains relative to the load. It should be zero in a scene at rest; it can be \
                   large although the residual is small."
                    .into(),
            facts: self.lines(),
            figures,
            ..Section::of::<Self>()
        })
    }
}

/// The energy balance over time.
///
/// # Errors
/// Those of reading the history.
pub fn energy(history: &History) -> Result<Section> {
    let books = [
        ("external_work", "external work"),
        ("kinetic_energy", "kinetic energy"),
        ("dissipation_friction", "dissipated by friction"),
        ("dissipation_impact", "dissipated by impacts"),
        ("elastic_energy", "elastic energy"),
        ("dissipation_damping", "damping of the time step"),
        ("fracture_energy", "fracture energy"),
        ("bond_remainder", "work of rigid bonds (should be 0)"),
        ("energy_remainder", "energy remainder (should be 0)"),
    ];
    let mut facts = vec![];
    let clock = Clock::of(history);
    let mut curves = clock.chart("energy (J)");
    for (name, label) in books {
        let points = points(history.observable(name)?);
        let Some(&(_, end)) = points.last() else {
            continue;
        };
        facts.push((capitalised(label), format!("{} J at the end", number(end))));
        // remainders should be zero and are not drawn
        let drawn = !name.ends_with("_remainder") && points.iter().any(|(_, energy)| *energy != 0.0);
        if drawn {
            let colours = colour::CYCLE.iter().chain([&colour::BLACK, &colour::GREY]);
            let colour = colours.copied().nth(curves.curves.len()).unwrap_or(colour::BLACK);
            curves = curves.curve(label, colour, Style::Line, points);
        }
    }
    curves.pad_x = true;
    let alt = format!("External work, kinetic energy and dissipation over {}.", clock.over());
    let figures = if curves.curves.is_empty() { vec![] } else { vec![chart_figure(curves, &alt, &alt)] };
    Ok(Section { id: "energy", title: "Energy", facts, figures, ..Section::default() })
}
