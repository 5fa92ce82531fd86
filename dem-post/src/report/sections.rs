//! What stands in the sections of the page.

use dem_history::{History, Series};

use super::Report;
use super::page::{Figure, Section, Table, chart, map};
use crate::chains::pictures::{chain_map, distribution_chart, length_charts, network_map};
use crate::chains::{CHAIN_HEAD, Report as Chains};
use crate::cracks::pictures::{broken_chart, crack_map, decohesion, fragment_charts, front_charts, surface_maps};
use crate::cracks::{Report as Cracks, broken_over_time};
use crate::map::Sample;
use crate::output::{Result, number, quantity};
use crate::plot::{Chart, Style, colour};
use crate::stress_strain::{Report as StressStrain, force_displacement, onset, stress_strain};
use crate::velocities::{self, Report as Velocities};

/// Heads of the sections that a scene may have nothing for.
const LOAD: &str = "Load and displacement";
const CRACKS: &str = "Cracks";
const CHAINS: &str = "Forces and chains";

/// All sections; one that the history has nothing for says why.
///
/// # Errors
/// Those of reading the history and of drawing.
pub fn all(history: &History, report: &Report) -> Result<Vec<Section>> {
    let missing = |id: &'static str, title: &'static str| {
        let why = report.left_out.iter().find(|out| out.section == id);
        Section {
            id,
            title,
            text: why.map_or_else(String::new, |out| format!("None: {}.", out.why)),
            ..Section::default()
        }
    };
    let mut sections = vec![run(report), accuracy(history, report)?];
    sections.push(report.stress_strain.as_ref().map_or_else(|| missing("load", LOAD), load));
    sections.push(match &report.cracks {
        Some(found) => cracks(history, report, found)?,
        None => missing("cracks", CRACKS),
    });
    sections.push(match &report.chains {
        Some(found) => chains(history, found)?,
        None => missing("chains", CHAINS),
    });
    sections.push(motion(history, &report.velocities)?);
    sections.push(energy(history)?);
    Ok(sections)
}

fn run(report: &Report) -> Section {
    let facts = report.info.facts().into_iter().map(|(name, value)| (name.to_string(), value)).collect();
    Section { id: "run", title: "Run", facts, ..Section::default() }
}

/// The points of an observable over time; empty if it was not recorded.
fn points(series: Option<Series>) -> Vec<(f64, f64)> {
    series.map_or_else(Vec::new, |s| s.time.into_iter().zip(s.value).collect())
}

fn accuracy(history: &History, report: &Report) -> Result<Section> {
    let mut figures = vec![];
    for (name, title, alt, steps) in [
        ("solver_residual", "residual", "Residual of the accepted solve of each step over time.", false),
        ("solver_load_error", "load error", "Load error of each step over time.", false),
        ("false_acceleration", "false acceleration", "False acceleration of each step over time.", false),
        ("solver_iterations", "iterations of a step", "Iterations of each step over time.", true),
        ("penetration", "penetration (m)", "Deepest penetration of each step over time.", false),
    ] {
        let points: Vec<(f64, f64)> = points(history.observable(name)?).into_iter().filter(|p| p.1 > 0.0).collect();
        // an axis of powers of ten shows no zeros
        if points.len() < 2 {
            continue;
        }
        let mut curve = Chart::new("time (s)", title).curve(title, colour::BLUE, Style::Thin, points);
        curve.log_y = true;
        let tolerance = report.accuracy.tolerance.filter(|_| name == "solver_residual");
        if let Some(tolerance) = tolerance {
            curve.levels.push((tolerance, format!("aimed at: {tolerance:e}")));
        }
        let what = if steps { "steps without any are left out" } else { "steps where it is zero are left out" };
        figures.push(chart(curve, alt, &format!("{alt} {}.", capitalised(what))));
    }
    Ok(Section {
        id: "accuracy",
        title: "Accuracy of the solver",
        text: "The residual tells how far the contact laws are from being met, over the size of the reactions and the \
               load. The load error is the estimated error of the net impulses of the contacts on the bodies, over \
               those impulses, as the direct solvers report it. The false acceleration is the force that the \
               accelerations of the grains stand for, over the load: in a scene at rest it should be zero, and a \
               small residual can hide a large one."
            .into(),
        facts: report.accuracy.lines(),
        figures,
        ..Section::default()
    })
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().collect::<String>() + letters.as_str())
}

fn load(found: &StressStrain) -> Section {
    let mut figures = vec![
        chart(
            force_displacement(found),
            "Applied force and reaction of the grains over the displacement of the driven wall.",
            "Force over displacement of the driven wall.",
        ),
        chart(
            stress_strain(found),
            "Axial stress over axial strain, from the walls and from the particles.",
            "Axial stress over strain.",
        ),
    ];
    figures.extend(onset(found).map(|onset| {
        let alt = "Applied force over the logarithm of the axial strain, with the strains that define the collapse.";
        chart(onset, alt, "The onset of collapse: force over the logarithm of the strain.")
    }));
    let s = &found.summary;
    let mut facts = vec![
        ("Driven wall", s.wall.clone()),
        ("Sample", s.sample()),
        ("First break", quantity(s.first_break, "N")),
        ("Collapse load (strain 1e-4)", s.collapse(0)),
        ("Collapse load (strain 1e-3)", s.collapse(1)),
        ("Load with 5 % of the bonds broken", quantity(s.load_at_5_percent_broken, "N")),
        ("Collapse load over cohesion", quantity(s.collapse_over_cohesion, "")),
        ("Peak load", s.peak()),
        ("Greatest load", quantity(Some(s.greatest_load), "N")),
        ("Work of the wall", quantity(Some(s.work), "J")),
    ];
    facts.extend(s.splitting.as_ref().map(|splitting| ("Splitting strength", splitting.to_string())));
    Section {
        id: "load",
        title: LOAD,
        text:
            "Of rigid grains that bonds join to one piece a strain before the first bond breaks is solver error: believe a \
               collapse load only where it lies above the load of the first break. A wall that moves at a prescribed \
               velocity loads the sample with the force that acted before any bond broke in the step."
                .into(),
        facts: facts.into_iter().map(|(name, value)| (name.into(), value)).collect(),
        figures,
        ..Section::default()
    }
}

fn cracks(history: &History, report: &Report, found: &Cracks) -> Result<Section> {
    let end = history.times().last().copied().unwrap_or(0.0);
    let mut figures = vec![];
    if !found.cracks.is_empty() {
        let (all, near) = crack_map(history, found)?;
        let alt = "Broken bonds as lines over the grains of the first frame, coloured by the time at which they broke.";
        figures.push(map(&all, alt, "Cracks by the time at which each bond broke.")?);
        if let Some(near) = near {
            figures.push(map(&near, &format!("{alt} Enlarged."), "The part around the cracks.")?);
        }
    }
    if !found.surfaces.is_empty() {
        let alt =
            "Facets of broken bonds at their places in the first frame, coloured by the time at which they broke.";
        let [whole, front, side] = surface_maps(history, found)?;
        figures.push(map(&whole, alt, "Cracks by the time at which each bond broke.")?);
        figures.push(map(&front, alt, "The same, seen along y.")?);
        figures.push(map(&side, alt, "The same, seen against x.")?);
    }
    for field in &report.velocities.fields {
        let time = number(field.time);
        let alt = format!("Grains at t = {time} s; those that lost a bond are white.");
        // spheres hide what breaks behind them
        let (sample, seen) = if history.dimension() == 2 {
            (Sample::read(history)?, "")
        } else {
            (Sample::cut_open(history)?, ", cut open along the middle")
        };
        let caption = format!("Lost bonds at t = {time} s{seen}.");
        figures.push(map(&decohesion(history, &sample, &[field.frame])?, &alt, &caption)?);
    }
    if found.broken.total() > 0 {
        let curve = broken_chart(&broken_over_time(&found.events), end);
        figures.push(chart(curve, "Number of broken bonds over time, by mode.", "Broken bonds by mode."));
        for curve in fragment_charts(&found.fragments) {
            let alt = format!("{} over time.", capitalised(&curve.y));
            figures.push(chart(curve, &alt, &alt));
        }
    }
    if !found.cracks.is_empty() || !found.surfaces.is_empty() {
        for curve in front_charts(found) {
            let alt = format!("{} over {}.", capitalised(&curve.y), curve.x);
            figures.push(chart(curve, &alt, &alt));
        }
    }
    let caption = if found.surfaces.is_empty() {
        "The largest cracks; T/S/R: bonds broken in tension, in shear, by rolling"
    } else {
        "The largest cracks; T/S/R/Tw: bonds broken in tension, in shear, by rolling, by twist"
    };
    let tables = found.crack_rows().into_iter().map(|(head, rows)| Table::new(caption, head, rows)).collect();
    let facts = vec![
        ("Bonds".into(), found.bonds.to_string()),
        ("Broken".into(), found.broken.total().to_string()),
        ("Cracks".into(), (found.cracks.len() + found.surfaces.len()).to_string()),
        ("First break".into(), quantity(found.first_break, "s")),
        ("5 % broken".into(), quantity(found.time_of_5_percent, "s")),
    ];
    let text = if history.dimension() == 2 {
        "A crack is a set of broken bonds that meet in the voids between the grains; its path is the longest way through it, drawn \
         thick. Places are those of the first frame."
    } else {
        "A crack is a set of broken bonds whose facets, the faces that the cells of two grains share, meet in the voids between the \
         grains. Places are those of the first frame."
    };
    Ok(Section { id: "cracks", title: CRACKS, text: text.into(), facts, figures, tables })
}

fn chains(history: &History, found: &Chains) -> Result<Section> {
    let mut figures: Vec<Figure> = vec![];
    for network in &found.networks {
        let one = Chains { networks: vec![network.clone()] };
        let time = number(network.time);
        let alt = format!("Contact forces as lines at t = {time} s: blue presses, orange pulls, wider is stronger.");
        figures.push(map(&network_map(history, &one)?, &alt, &format!("Force network at t = {time} s."))?);
        let alt = format!("Grains in force chains at t = {time} s, blue in compression, orange in tension.");
        figures.push(map(&chain_map(history, &one)?, &alt, &format!("Force chains at t = {time} s."))?);
    }
    let alt = "Probability density of the normal forces over their mean, at each moment.";
    figures.push(chart(distribution_chart(found), alt, alt));
    for curve in length_charts(found) {
        let alt = format!("{}, by the number of their grains.", capitalised(&curve.y));
        figures.push(chart(curve, &alt, &alt));
    }
    let text = "A chain is a line of at least three grains whose greatest principal stress exceeds the mean, each \
                within 45° of the direction of that stress (Peters et al., Phys. Rev. E 72, 041307, 2005).";
    let tables = vec![Table::new("Force chains", &CHAIN_HEAD, found.chain_rows())];
    Ok(Section { id: "chains", title: CHAINS, text: text.into(), figures, tables, ..Section::default() })
}

fn motion(history: &History, found: &Velocities) -> Result<Section> {
    let mut figures = vec![];
    for field in &found.fields {
        let one = Velocities { fields: vec![field.clone()] };
        let time = number(field.time);
        let alt = format!("Grains coloured by their speed at t = {time} s, with arrows of the mean velocity.");
        figures.push(map(&velocities::map(history, &one)?, &alt, &format!("Velocities at t = {time} s."))?);
    }
    Ok(Section { id: "velocities", title: "Velocities", figures, ..Section::default() })
}

fn energy(history: &History) -> Result<Section> {
    let books = [
        ("external_work", "work from outside"),
        ("kinetic_energy", "kinetic energy"),
        ("dissipation_friction", "lost to friction"),
        ("dissipation_impact", "lost to impacts"),
        ("elastic_energy", "elastic energy"),
        ("dissipation_damping", "damping of the time step"),
        ("fracture_energy", "fracture energy"),
        ("bond_remainder", "work of rigid bonds (should be 0)"),
        ("energy_remainder", "not accounted for (should be 0)"),
    ];
    let mut facts = vec![];
    let mut curves = Chart::new("time (s)", "energy (J)");
    for (name, label) in books {
        let points = points(history.observable(name)?);
        let Some(&(_, end)) = points.last() else {
            continue;
        };
        facts.push((capitalised(label), format!("{} J at the end", number(end))));
        // what should be zero is no line of its own beside the others
        let drawn = !name.ends_with("_remainder") && points.iter().any(|(_, energy)| *energy != 0.0);
        if drawn {
            let colours = colour::CYCLE.iter().chain([&colour::BLACK, &colour::GREY]);
            let colour = colours.copied().nth(curves.curves.len()).unwrap_or(colour::BLACK);
            curves = curves.curve(label, colour, Style::Line, points);
        }
    }
    curves.set_off = true;
    let alt = "Work from outside, kinetic energy and losses over time.";
    let figures = if curves.curves.is_empty() { vec![] } else { vec![chart(curves, alt, alt)] };
    Ok(Section { id: "energy", title: "Energy", facts, figures, ..Section::default() })
}
