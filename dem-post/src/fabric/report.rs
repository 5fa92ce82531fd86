//! The state of the sample at each frame: the report, and how it is computed from a history.

use std::f64::consts::PI;

use dem_history::{Bonds, ContactRows, ContactStatus, History, Rupture, Series};
use serde::Serialize;

use super::region::Region;
use super::tensors::{Dyads, anisotropy, direction};
use crate::clock::Clock;
use crate::extent::{bonded_frame, box_around, first_box};
use crate::moments;
use crate::output::{Result, Text, number, progress, quantity};
use crate::tensor::{mean_and_deviator, principal};

/// The sample at one frame. `None`: not recorded, or not defined there; tensors row by row.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Row {
    /// Step.
    pub step: i64,
    /// Time, s.
    pub time: f64,
    /// Stress tensor, Pa, D × D, positive in compression.
    pub stress: Option<Vec<f64>>,
    /// Mean stress p, Pa.
    pub p: Option<f64>,
    /// Deviator q, Pa.
    pub q: Option<f64>,
    /// Volumetric strain, positive in dilation.
    pub volumetric_strain: Option<f64>,
    /// Porosity of the region in the middle of the sample.
    pub porosity: f64,
    /// Contacts between grains; `None` at the first frame, which has no contacts.
    pub contacts: Option<usize>,
    /// Contacts of a grain in the mean.
    pub coordination: Option<f64>,
    /// Fabric tensor, D × D; `None` without contacts.
    pub fabric: Option<Vec<f64>>,
    /// Its anisotropy.
    pub anisotropy: Option<f64>,
    /// Its greatest principal direction, degrees from x; in 2D.
    pub direction: Option<f64>,
    /// Bonds broken.
    pub broken: usize,
    /// Crack-density tensor, 1/m, D × D; `None` without bonds.
    pub crack_density: Option<Vec<f64>>,
}

/// The sample over time.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Dimension.
    pub dimension: usize,
    /// Extents of the box around all grains at the first frame, m: of the volume of stress.
    pub extents: Vec<f64>,
    /// The region of the porosity.
    pub region_centre: Vec<f64>,
    /// Its radius, m.
    pub region_radius: f64,
    /// What times count.
    #[serde(skip)]
    pub clock: Clock,
    /// A row for each frame.
    pub rows: Vec<Row>,
    /// The rows of the table on the terminal.
    #[serde(skip)]
    pub shown: Vec<usize>,
}

/// Reads the report, with a bar unless `quiet`; its table shows the frames nearest to `times` (s
/// or steps), or chosen ones.
///
/// # Errors
/// [`crate::output::PostError::Usage`] for times outside the history,
/// [`crate::output::PostError::Lacking`] for a history without frames.
pub fn read(history: &History, times: &[f64], quiet: bool) -> Result<Report> {
    let shown = moments::chosen(history, times)?;
    let d = history.dimension();
    let ends = first_box(history)?;
    let region = Region::inside(&ends);
    let extents: Vec<f64> = ends.iter().map(|[low, high]| high - low).collect();
    let radius = history.grains()?.radius;
    let [stress, strain] = [history.observable("stress")?, history.observable("strain")?];
    let mut cracks = Cracks::new(history)?;
    let mut rows = vec![];
    let bar = progress(history.frames() as u64, quiet, "{bar:24} {percent} % of the frames read, {eta} left");
    for (frame, (&step, &time)) in history.steps().iter().zip(history.times()).enumerate() {
        let stress = at(stress.as_ref(), step, d * d);
        let mean = stress.as_deref().map(|stress| mean_and_deviator(&principal(stress, d)));
        let mut row = Row {
            step,
            time,
            p: mean.map(|[p, _]| p),
            q: mean.map(|[_, q]| q),
            stress,
            volumetric_strain: at(strain.as_ref(), step, d * d).map(|e| (0..d).map(|k| e[k * d + k]).sum()),
            porosity: region.porosity(&history.grain_state(frame)?.position, &radius),
            crack_density: cracks.until(step),
            broken: cracks.broken,
            ..Row::default()
        };
        // the first frame is recorded before any contact is solved
        if frame > 0 {
            row.add_contacts(&history.contacts(frame)?, d, radius.len());
        }
        rows.push(row);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let (region_centre, region_radius) = (region.centre, region.radius);
    Ok(Report { dimension: d, extents, region_centre, region_radius, clock: Clock::of(history), rows, shown })
}

/// The value of an observable at a step; `None` where it was not observed.
fn at(series: Option<&Series>, step: i64, width: usize) -> Option<Vec<f64>> {
    let series = series?;
    let row = series.step.binary_search(&step).ok()?;
    series.value.get(row * width..(row + 1) * width).map(<[f64]>::to_vec)
}

/// The broken bonds, in the order in which they broke.
struct Cracks {
    bonds: Bonds,
    ruptures: Vec<Rupture>,
    position: Vec<f64>,
    sum: Dyads,
    dimension: usize,
    volume: f64,
    /// Bonds broken so far.
    broken: usize,
}

impl Cracks {
    fn new(history: &History) -> Result<Self> {
        let dimension = history.dimension();
        let position = history.grain_state(bonded_frame(history)?)?.position;
        let ends = box_around(&history.grains()?.radius, &position, dimension);
        Ok(Self {
            bonds: history.bonds()?,
            ruptures: history.ruptures()?,
            position,
            sum: Dyads::new(dimension),
            dimension,
            volume: ends.iter().map(|[low, high]| high - low).product(),
            broken: 0,
        })
    }

    /// The crack density at the end of a step, which must not decrease; `None` without bonds.
    fn until(&mut self, step: i64) -> Option<Vec<f64>> {
        let d = self.dimension;
        while let Some(rupture) = self.ruptures.get(self.broken).filter(|rupture| rupture.step <= step) {
            let arm = self.bonds.mean_diameter[rupture.bond as usize];
            // in 2D the thickness of section and volume cancels
            let section = if d == 2 { arm } else { 0.25 * PI * arm * arm };
            let [i, j] = rupture.pair.map(|grain| &self.position[grain as usize * d..(grain as usize + 1) * d]);
            let way: Vec<f64> = i.iter().zip(j).map(|(i, j)| i - j).collect();
            let length = way.iter().map(|x| x * x).sum::<f64>().sqrt();
            if length > 0.0 {
                self.sum.add(section, &way.iter().map(|x| x / length).collect::<Vec<_>>());
            }
            self.broken += 1;
        }
        (!self.bonds.is_empty()).then(|| self.sum.over(self.volume))
    }
}

impl Row {
    /// Coordination and fabric of the contacts between grains.
    fn add_contacts(&mut self, contacts: &ContactRows, dimension: usize, grains: usize) {
        let mut dyads = Dyads::new(dimension);
        let mut count = 0;
        let own = contacts.pair.iter().zip(&contacts.status).zip(contacts.normal.chunks(dimension));
        for (_, normal) in own.filter(|((pair, status), _)| pair[1] >= 0 && **status != ContactStatus::Open) {
            dyads.add(1.0, normal);
            count += 1;
        }
        self.contacts = Some(count);
        self.coordination = Some(2.0 * count as f64 / grains as f64);
        if count > 0 {
            let fabric = dyads.over(count as f64);
            self.anisotropy = Some(anisotropy(&fabric, dimension));
            self.direction = (dimension == 2).then(|| direction(&fabric));
            self.fabric = Some(fabric);
        }
    }

    /// Area of the sections of broken bonds in a unit of volume, 1/m.
    pub fn crack_area(&self) -> Option<f64> {
        let tensor = self.crack_density.as_ref()?;
        let d = if tensor.len() == 4 { 2 } else { 3 };
        Some((0..d).map(|k| tensor[k * d + k]).sum())
    }
}

impl Report {
    /// Whether grains were ever in contact.
    pub fn touched(&self) -> bool {
        self.rows.iter().any(|row| row.contacts.is_some_and(|count| count > 0))
    }

    /// The report as a table of the shown frames.
    pub fn table(&self) -> String {
        let mut table = Text::new(&[
            self.clock.title(),
            "p (Pa)",
            "q (Pa)",
            "dilation",
            "porosity",
            "coordination",
            "anisotropy",
            "broken",
            "broken sections (1/m)",
        ]);
        for row in self.shown.iter().filter_map(|&frame| self.rows.get(frame)) {
            table.row(vec![
                number(self.clock.value(row.time)),
                quantity(row.p, ""),
                quantity(row.q, ""),
                quantity(row.volumetric_strain, ""),
                number(row.porosity),
                quantity(row.coordination, ""),
                quantity(row.anisotropy, ""),
                row.broken.to_string(),
                quantity(row.crack_area(), ""),
            ]);
        }
        let kind = if self.dimension == 2 { "disk" } else { "sphere" };
        table.lines()
            + &format!(
                "\nporosity of a {kind} of {} m in the middle of the sample; stress over the box around it at the first \
                 frame, sections of broken bonds over that when the bonds formed\n",
                number(2.0 * self.region_radius)
            )
    }
}
