//! Samples as CSV tables: reads the grains of a scene, writes those of a run.

use crate::csv_lines::{Lines, Wrong};
use crate::error::RunError;
use crate::output::replace;
use crate::prepare::Ball;
use crate::scene::{BASE, LARGEST, LEAST, MAX_GRAINS, shorten};
use dem_core::dim::{Dim, Vect};
use std::io::{BufRead, Write};
use std::path::Path;

/// The field of a scene that names a sample file.
const FIELD: &str = "sample.file.path";
/// The column of the names of materials, the last one, which may be absent.
const MATERIAL: &str = "material";

/// The grains of a table.
#[derive(Debug)]
pub struct Table<D: Dim> {
    /// Centres and radii (m).
    pub balls: Vec<Ball<D>>,
    /// Material of each grain, a place in the list of names; empty without the column.
    pub material: Vec<u8>,
}

fn header<D: Dim>() -> &'static [&'static str] {
    if D::N == 2 { &["x", "y", "radius"] } else { &["x", "y", "z", "radius"] }
}

/// Number of grains in a sample file, without parsing them: lines except the header, empty lines
/// and comments.
///
/// # Errors
/// [`RunError::SceneFile`], [`RunError::File`], [`RunError::Sample`].
pub fn count(path: &Path) -> Result<usize, RunError> {
    let mut lines = Lines::open(path, FIELD)?;
    let mut count = 0_usize;
    while lines.next()? {
        count += 1;
    }
    Ok(count.saturating_sub(1))
}

/// The grains of a CSV file with the header `x,y,radius` or `x,y,z,radius` (m), to which `material`
/// may be added: one of `materials`.
///
/// # Errors
/// [`RunError::SceneFile`] and [`RunError::File`] for a file that cannot be read,
/// [`RunError::Sample`] with all wrong lines.
pub fn read<D: Dim>(path: &Path, materials: &[&str]) -> Result<Table<D>, RunError> {
    parse::<D, _>(Lines::open(path, FIELD)?, materials)
}

/// As [`read`] without materials, from text that was read from the file `path`.
///
/// # Errors
/// [`RunError::Sample`] with all wrong lines.
pub fn read_text<D: Dim>(path: &Path, text: &str) -> Result<Vec<Ball<D>>, RunError> {
    Ok(parse::<D, _>(Lines::new(path, text.as_bytes()), &[BASE])?.balls)
}

fn parse<D: Dim, R: BufRead>(mut lines: Lines<R>, materials: &[&str]) -> Result<Table<D>, RunError> {
    let mut wrong = Wrong::of(&lines.path);
    let (columns, header) = (header::<D>().len(), header::<D>().join(","));
    lines.next()?;
    let mut with_material = false;
    match lines.fields().map(|fields| fields.collect::<Vec<_>>().join(",")) {
        Ok(found) if found == header => {}
        Ok(found) if found.strip_prefix(&header).is_some_and(|rest| rest == format!(",{MATERIAL}")) => {
            with_material = true;
        }
        Ok(found) => {
            let commas = if found.contains([';', '\t']) { ", between commas" } else { "" };
            let found = shorten(&found);
            wrong.tell(
                lines.number.max(1),
                format!("the header is {found}, it must be {header} and, if needed, {MATERIAL}{commas}"),
            );
        }
        Err(what) => wrong.tell(lines.number, what),
    }
    // below a wrong header, lines cannot be checked
    wrong.end()?;
    let mut table = Table { balls: vec![], material: vec![] };
    let columns = columns + usize::from(with_material);
    while lines.next()? {
        let row = lines.row(columns).and_then(|mut fields| {
            let material = if with_material { fields.pop() } else { None };
            let material = material.map(|name| self::material(name, materials)).transpose();
            Ok((ball::<D>(&fields)?, material?))
        });
        match row {
            Ok((ball, material)) => {
                table.balls.push(ball);
                table.material.extend(material);
            }
            Err(what) => wrong.tell(lines.number, what),
        }
        if table.balls.len() > MAX_GRAINS {
            wrong.tell(lines.number, format!("there are more than {MAX_GRAINS} grains"));
            break;
        }
    }
    wrong.end()?;
    if table.balls.is_empty() {
        wrong.tell(lines.number, "there are no grains in the file".into());
    }
    wrong.end()?;
    Ok(table)
}

/// The place of the material `name` in the list of names.
fn material(name: &str, materials: &[&str]) -> Result<u8, String> {
    let place = materials.iter().position(|known| *known == name).and_then(|place| u8::try_from(place).ok());
    let (shown, known) = (shorten(name), materials.join(", "));
    place.ok_or_else(|| {
        format!("material is {shown:?}, it must be one of: {known}; materials.named of the scene adds one")
    })
}

/// The grain of a line, or the error of the line.
fn ball<D: Dim>(fields: &[&str]) -> Result<Ball<D>, String> {
    let header = header::<D>();
    let mut numbers = [0.0; 4];
    let mut wrong = vec![];
    for (k, (field, name)) in fields.iter().zip(header).enumerate() {
        match field.parse::<f64>() {
            Ok(x) if x.abs() <= LARGEST => numbers[k] = x,
            _ => wrong.push(format!("{name} is {:?}, it must be a finite number (m)", shorten(field))),
        }
    }
    let radius = numbers[D::N];
    if wrong.is_empty() && radius < LEAST {
        wrong.push(format!("radius is {radius:?}, it must be above zero"));
    }
    if wrong.is_empty() { Ok((D::Vector::from_slice(&numbers[..D::N]), radius)) } else { Err(wrong.join("; ")) }
}

/// Writes the grains to a CSV file that [`read`] reads back bit for bit. An old file stays until
/// the new one is complete. `materials`: the materials of the grains, places in the list of names;
/// empty for a table without the column.
///
/// # Errors
/// [`RunError::File`]: a file that cannot be written.
pub fn write<D: Dim>(
    balls: impl IntoIterator<Item = Ball<D>>,
    materials: (&[u8], &[&str]),
    path: &Path,
) -> Result<(), RunError> {
    let mut content = Vec::new();
    write_to::<D>(balls, materials, &mut content)?;
    // a device cannot be replaced
    let written = match path.exists() && !path.is_file() {
        true => std::fs::write(path, &content),
        false => replace::write(path, &content),
    };
    written.map_err(|error| RunError::File { path: path.into(), doing: "cannot be written", source: error.into() })
}

/// As [`write()`], to `out`.
///
/// # Errors
/// `out` cannot be written.
pub fn write_to<D: Dim>(
    balls: impl IntoIterator<Item = Ball<D>>,
    (materials, names): (&[u8], &[&str]),
    out: impl Write,
) -> Result<(), csv::Error> {
    let mut writer = csv::Writer::from_writer(out);
    writer.write_record(header::<D>().iter().chain((!materials.is_empty()).then_some(&MATERIAL)))?;
    for (k, (x, r)) in balls.into_iter().enumerate() {
        let name = materials.get(k).and_then(|place| names.get(usize::from(*place)));
        let numbers = x.as_slice().iter().chain([&r]).map(f64::to_string);
        writer.write_record(numbers.chain(name.map(ToString::to_string)))?;
    }
    writer.flush()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::csv_lines::MOST_TOLD;
    use dem_core::dim::{D2, D3};
    use std::path::PathBuf;

    fn file(text: &str) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("sample.csv");
        std::fs::write(&path, text).expect("write");
        (folder, path)
    }

    fn refused(text: &str) -> Vec<String> {
        let (_folder, path) = file(text);
        let Err(RunError::Sample(told)) = read::<D2>(&path, &[BASE, "stone"]) else { panic!("not refused: {text}") };
        told
    }

    #[test]
    fn all_wrong_lines_are_told_at_once() {
        let told = refused("x,y,radius\n0,0,1\n0,nan,1\n1,x,-1\n2,0\n3,0,-1\n# 4\n5,0,0\n6,0,1e-70\n");
        let lines = [3, 4, 5, 6, 8, 9].map(|line| format!("line {line}: "));
        assert_eq!(told.len(), lines.len(), "{told:?}");
        assert!(told.iter().zip(lines).all(|(told, line)| told.contains(&line)), "{told:?}");
        let many = refused(&format!("x,y,radius\n{}", "0,0,-1\n".repeat(100)));
        assert_eq!((many.len(), many[MOST_TOLD].ends_with("80 more lines are wrong")), (MOST_TOLD + 1, true));
    }

    #[test]
    fn a_header_says_what_it_should_be_and_a_line_has_an_end() {
        assert!(
            refused("x;y;radius\n0;0;1\n")[0]
                .ends_with("it must be x,y,radius and, if needed, material, between commas")
        );
        assert!(refused("")[0].contains("the header is , it must be x,y,radius"));
        assert!(refused("x,y,radius\n")[0].contains("no grains"));
        for text in ["0".repeat(100_000), format!("x,y,radius\n{}", "0".repeat(100_000))] {
            let told = refused(&text);
            assert!(told[0].contains("it has more than 4096 bytes"), "{told:?}");
        }
    }

    #[test]
    fn materials_are_a_column_that_is_written_as_it_is_read() {
        let text = "x,y,radius,material\n0,0,1,base\n2,0,1,stone\n4,0,1,stone\n";
        let (folder, path) = file(text);
        let names = [BASE, "stone"];
        let table = read::<D2>(&path, &names).expect("a sample with materials");
        assert_eq!(table.material, [0, 1, 1]);
        let again = folder.path().join("again.csv");
        write::<D2>(table.balls, (&table.material, &names), &again).expect("write");
        assert_eq!(std::fs::read_to_string(again).expect("read"), text);
        let told = refused("x,y,radius,material\n0,0,1,stoen\n2,0,1\n4,0,1,base\n");
        assert!(told[0].contains("line 2: material is \"stoen\", it must be one of: base, stone"), "{told:?}");
        assert!(told[1].contains("line 3: it has 3 values, the header has 4") && told.len() == 2, "{told:?}");
    }

    #[test]
    fn lines_are_counted_as_they_are_read() {
        for text in [
            "x,y,z,radius\n# two grains\n0,0,0,1\n\n2,0,0,1",
            "\u{feff}\"x\", \"y\",\"z\",\"radius\"\r\n0, 0,0,1\r\n2,0,0,1\r\n",
        ] {
            let (_folder, path) = file(text);
            assert_eq!((count(&path).expect("count"), read::<D3>(&path, &[BASE]).expect("grains").balls.len()), (2, 2));
        }
    }
}
