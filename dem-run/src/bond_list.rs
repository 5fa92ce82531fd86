//! Bonds from a CSV file: the two grains of each, and what differs from the scene.

use crate::csv_lines::{Lines, Wrong};
use crate::error::RunError;
use crate::scene::{LARGEST, LEAST, shorten};
use dem_core::body::Grains;
use dem_core::bond::{Bond, BondStatus};
use dem_core::dim::{Dim, Vect};
use std::collections::HashMap;
use std::io::BufRead;
use std::path::Path;

/// The field of a scene that names a list of bonds.
const FIELD: &str = "bonds.list";
/// The columns. The first two must be there.
const COLUMNS: [&str; 5] = ["i", "j", "strength", "shear", "rolling"];

/// A bond, and the values that its list gives instead of the scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Listed {
    /// The bond; strength and coefficients are not set.
    pub bond: Bond,
    /// Tensile strength (N).
    pub strength: Option<f64>,
    /// Coefficient of the shear limit.
    pub shear: Option<f64>,
    /// Coefficient of the rolling limit.
    pub rolling: Option<f64>,
}

impl Listed {
    /// A bond with no values of its own.
    pub fn of(bond: Bond) -> Self {
        Self { bond, strength: None, shear: None, rolling: None }
    }
}

/// The bonds of a file, in its order. `gap_tolerance`: largest gap of a pair over its mean
/// diameter.
///
/// # Errors
/// [`RunError::SceneFile`] and [`RunError::File`] for a file that cannot be read,
/// [`RunError::Sample`] with all wrong lines.
pub fn read<D: Dim>(path: &Path, grains: &Grains<D>, gap_tolerance: f64) -> Result<Vec<Listed>, RunError> {
    parse(Lines::open(path, FIELD)?, grains, gap_tolerance)
}

fn parse<D: Dim, R: BufRead>(
    mut lines: Lines<R>,
    grains: &Grains<D>,
    gap_tolerance: f64,
) -> Result<Vec<Listed>, RunError> {
    let mut wrong = Wrong::of(&lines.path);
    lines.next()?;
    let columns = match lines.fields().and_then(|fields| columns(&fields.collect::<Vec<_>>())) {
        Ok(columns) => columns,
        Err(what) => {
            wrong.tell(lines.number.max(1), what);
            vec![]
        }
    };
    // below a wrong header, lines cannot be checked
    wrong.end()?;
    let (mut list, mut first) = (vec![], HashMap::new());
    while lines.next()? {
        let row = lines.row(columns.len()).and_then(|fields| row(&fields, &columns, grains, gap_tolerance));
        let row = row.and_then(|listed| match first.insert(listed.bond.pair, lines.number) {
            None => Ok(listed),
            Some(line) => Err(format!("the pair of line {line} again; remove one of the two lines")),
        });
        match row {
            Ok(listed) => list.push(listed),
            Err(what) => wrong.tell(lines.number, what),
        }
    }
    wrong.end()?;
    if list.is_empty() {
        wrong.tell(lines.number, "there are no bonds in the file; a scene without `bonds` has none".into());
    }
    wrong.end()?;
    Ok(list)
}

/// The column of `COLUMNS` that each field of a line belongs to.
fn columns(names: &[&str]) -> Result<Vec<usize>, String> {
    let places: Option<Vec<usize>> =
        names.iter().map(|name| COLUMNS.iter().position(|column| column == name)).collect();
    let places = places.filter(|places| {
        let once = (0..COLUMNS.len()).all(|k| places.iter().filter(|place| **place == k).count() <= 1);
        once && places.contains(&0) && places.contains(&1)
    });
    places.ok_or_else(|| {
        let found = shorten(&names.join(","));
        format!("the header is {found}, it must be i,j and, if needed, strength, shear, rolling, between commas")
    })
}

/// The bond of a line, or what is wrong with it.
fn row<D: Dim>(fields: &[&str], columns: &[usize], grains: &Grains<D>, gap_tolerance: f64) -> Result<Listed, String> {
    let cell = |column: usize| columns.iter().position(|k| *k == column).map(|place| fields[place]);
    let pair = [grain(0, cell(0), grains)?, grain(1, cell(1), grains)?];
    let [i, j] = pair;
    if i == j {
        return Err(format!("i and j are both {i}; a bond joins two grains"));
    }
    if grains.fixed[i] && grains.fixed[j] {
        return Err(format!(
            "grains {i} and {j} are both fixed, or held by the grip of a wall, and form no bond with each other; remove \
             the line"
        ));
    }
    let mean_diameter = grains.radius[i] + grains.radius[j];
    let rest_gap = (grains.position[i] - grains.position[j]).norm() - mean_diameter;
    if rest_gap > gap_tolerance * mean_diameter {
        return Err(format!(
            "the gap of grains {i} and {j} is {rest_gap:.3e} m, {:.3e} of their mean diameter, more than \
             bonds.gap_tolerance: correct the numbers (they count from 0), or raise the tolerance",
            rest_gap / mean_diameter
        ));
    }
    let value = |column: usize, least: f64, unit: &str| {
        let Some(text) = cell(column).filter(|text| !text.is_empty()) else { return Ok(None) };
        match text.parse::<f64>() {
            Ok(x) if x >= least && x <= LARGEST => Ok(Some(x)),
            _ => {
                let (name, sign) = (COLUMNS[column], if least > 0.0 { ">" } else { "≥" });
                Err(format!(
                    "{name} is {:?}, it must be a finite number {sign} 0 ({unit}), at most {LARGEST:.0e}",
                    shorten(text)
                ))
            }
        }
    };
    let low_first = if i < j { pair } else { [j, i] };
    let bond = Bond {
        pair: low_first.map(|k| k as u32),
        rest_gap,
        mean_diameter,
        strength: 0.0,
        shear: 0.0,
        rolling: 0.0,
        twist: 0.0,
        stiffness: None,
        status: BondStatus::Intact,
    };
    let strength = value(2, LEAST, "N")?;
    Ok(Listed { bond, strength, shear: value(3, 0.0, "no unit")?, rolling: value(4, 0.0, "no unit")? })
}

/// The number of a grain.
fn grain<D: Dim>(column: usize, text: Option<&str>, grains: &Grains<D>) -> Result<usize, String> {
    let (name, text, count) = (COLUMNS[column], text.unwrap_or_default(), grains.len());
    let number = text.parse::<usize>().ok().filter(|k| *k < count);
    number.ok_or_else(|| {
        format!(
            "{name} is {:?}, it must be the number of a grain, from 0 to {}",
            shorten(text),
            count.saturating_sub(1)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use dem_core::body::Grain;
    use dem_core::dim::D2;

    /// Four unit disks in a row, the last two fixed.
    fn row_of_disks() -> Grains<D2> {
        let mut grains: Grains<D2> =
            (0..4).map(|k| Grain::at_rest([2.0 * f64::from(k), 0.0].into(), 1.0, 1.0)).collect();
        (grains.fixed[2], grains.fixed[3]) = (true, true);
        grains
    }

    fn of(text: &str) -> Result<Vec<Listed>, RunError> {
        parse(Lines::new(Path::new("bonds.csv"), text.as_bytes()), &row_of_disks(), 1e-3)
    }

    #[test]
    fn columns_come_in_any_order_and_an_empty_cell_leaves_the_scene() {
        let list = of("shear,j,i,strength\n0.5,0,1,\n# comment\n,2,1,7\n").expect("a list");
        let values: Vec<_> = list.iter().map(|l| (l.bond.pair, l.strength, l.shear, l.rolling)).collect();
        assert_eq!(values, [([0, 1], None, Some(0.5), None), ([1, 2], Some(7.0), None, None)]);
        assert!(list.iter().all(|l| l.bond.mean_diameter == 2.0 && l.bond.rest_gap.abs() < 1e-15));
    }

    #[test]
    fn wrong_lines_are_told_with_the_remedy() {
        let told = |text: &str| {
            let Err(RunError::Sample(told)) = of(text) else { panic!("accepted: {text}") };
            told
        };
        for (text, part) in [
            ("i;j\n0;1\n", "line 1: the header is i;j, it must be i,j"),
            ("i,strength\n0,1\n", "it must be i,j and, if needed"),
            ("i,j,i\n0,1,0\n", "it must be i,j"),
            ("i,j\n", "there are no bonds in the file"),
            ("i,j\n0,4\n", "line 2: j is \"4\", it must be the number of a grain, from 0 to 3"),
            ("i,j\n1,1\n", "i and j are both 1"),
            ("i,j\n2,3\n", "both fixed"),
            ("i,j\n0,2\n", "more than bonds.gap_tolerance"),
            ("i,j\n0,1\n1,0\n", "line 3: the pair of line 2 again"),
            ("i,j,strength\n0,1,0\n", "strength is \"0\", it must be a finite number > 0 (N), at most 1e60"),
            ("i,j,shear\n0,1,-0.1\n", "shear is \"-0.1\", it must be a finite number ≥ 0"),
            ("i,j,rolling\n0,1,nan\n", "rolling is \"nan\""),
            ("i,j\n0\n", "it has 1 value, the header has 2"),
        ] {
            let told = told(text);
            assert!(told.len() == 1 && told[0].contains(part), "{part:?} in {told:?}");
        }
        assert_eq!(told("i,j\n0,9\n0,x\n1,0\n").len(), 2);
    }
}
