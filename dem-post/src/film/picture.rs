//! Drawings side by side, and an animated PNG of them.
//!
//! Of each picture but the first, the pixels that changed are stored, in the smallest rectangle
//! that contains them; the others are transparent. Colours are rounded to steps of 8 of 255, which
//! nobody sees and which halves the file.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use dem_drawing::{Drawing, RGB, Raster};

/// Bytes of a stored pixel: red, green, blue, opacity.
const RGBA: usize = 4;
/// Colours are multiples of this, and white.
const STEP: u8 = 8;

/// Pixels of a picture of the film.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture(Raster);

impl Picture {
    /// A drawing with charts beside it, one below the other.
    pub fn beside(drawing: &Drawing, charts: &[Drawing], scale: f32) -> Result<Self, String> {
        let left = drawing.pixels(scale)?;
        let charts: Vec<Raster> = charts.iter().map(|chart| chart.pixels(scale)).collect::<Result<_, String>>()?;
        let right = charts.iter().map(|chart| chart.size[0]).max().unwrap_or(0);
        let below: usize = charts.iter().map(|chart| chart.size[1]).sum();
        let height = left.size[1].max(below);
        let mut whole = Self(Raster::white(left.size[0] + right, height));
        whole.put(&left, (0, (height - left.size[1]) / 2));
        let mut top = (height - below) / 2;
        for chart in &charts {
            whole.put(chart, (left.size[0], top));
            top += chart.size[1];
        }
        for channel in &mut whole.0.pixels {
            *channel = if *channel < 255 - STEP / 2 { (*channel + STEP / 2) / STEP * STEP } else { 255 };
        }
        Ok(whole)
    }

    fn put(&mut self, other: &Raster, (x, y): (usize, usize)) {
        for (row, pixels) in other.pixels.chunks_exact(RGB * other.size[0].max(1)).enumerate() {
            let start = RGB * ((y + row) * self.0.size[0] + x);
            self.0.pixels[start..start + pixels.len()].copy_from_slice(pixels);
        }
    }

    /// The smallest rectangle outside which two pictures of one size agree: its corner and its size
    /// in pixels, at least one.
    fn changed(&self, before: &Self) -> [usize; 4] {
        let [width, height] = self.0.size;
        let row = |y: usize| y * RGB * width..(y + 1) * RGB * width;
        let differs = |y: &usize| self.0.pixels[row(*y)] != before.0.pixels[row(*y)];
        let Some(top) = (0..height).find(differs) else { return [0, 0, 1, 1] };
        let bottom = (0..height).rev().find(differs).unwrap_or(top);
        let (mut left, mut right) = (width - 1, 0);
        for y in top..=bottom {
            let rows = self.0.pixels[row(y)].chunks_exact(RGB).zip(before.0.pixels[row(y)].chunks_exact(RGB));
            for (x, _) in rows.enumerate().filter(|(_, (now, then))| now != then) {
                (left, right) = (left.min(x), right.max(x));
            }
        }
        [left, top, right - left + 1, bottom - top + 1]
    }

    /// A part, with pixels that are the same as before transparent.
    fn part(&self, [left, top, width, height]: [usize; 4], before: Option<&Self>) -> Vec<u8> {
        let mut part = Vec::with_capacity(RGBA * width * height);
        for y in top..top + height {
            let row = RGB * (y * self.0.size[0] + left)..RGB * (y * self.0.size[0] + left + width);
            let then = before.map(|before| &before.0.pixels[row.clone()]);
            for (k, pixel) in self.0.pixels[row].chunks_exact(RGB).enumerate() {
                let same = then.is_some_and(|then| then[RGB * k..RGB * (k + 1)] == *pixel);
                part.extend_from_slice(if same { &[0; RGB] } else { pixel });
                part.push(if same { 0 } else { 255 });
            }
        }
        part
    }
}

/// An animated PNG that is being written.
pub struct Animation {
    writer: png::Writer<BufWriter<File>>,
    before: Option<Picture>,
}

impl Animation {
    /// An animation of `count` pictures, all of the size of `first`, played once after another
    /// without end.
    pub fn create(path: &Path, first: &Picture, count: usize) -> Result<Self, String> {
        let told = |error: png::EncodingError| error.to_string();
        let file = File::create(path).map_err(|error| error.to_string())?;
        let mut encoder = png::Encoder::new(BufWriter::new(file), first.0.size[0] as u32, first.0.size[1] as u32);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        // most pixels are those of before: differences to neighbours would only hide that
        encoder.set_filter(png::Filter::NoFilter);
        encoder.set_animated(count as u32, 0).map_err(told)?;
        Ok(Self { writer: encoder.write_header().map_err(told)?, before: None })
    }

    /// Adds a picture that stays for `ticks / rate` seconds.
    pub fn add(&mut self, picture: Picture, (ticks, rate): (u16, u16)) -> Result<(), String> {
        let place = match &self.before {
            Some(before) if before.0.size != picture.0.size => {
                return Err("the pictures differ in size".into());
            }
            Some(before) => picture.changed(before),
            None => [0, 0, picture.0.size[0], picture.0.size[1]],
        };
        let [left, top, width, height] = place.map(|length| length as u32);
        let mut write = || {
            self.writer.set_frame_delay(ticks, rate)?;
            // a rectangle may not leave the picture, so the old place goes first
            self.writer.reset_frame_position()?;
            self.writer.set_frame_dimension(width, height)?;
            self.writer.set_frame_position(left, top)?;
            self.writer.set_blend_op(png::BlendOp::Over)?;
            self.writer.write_image_data(&picture.part(place, self.before.as_ref()))
        };
        write().map_err(|error| error.to_string())?;
        self.before = Some(picture);
        Ok(())
    }

    /// Writes the end of the file.
    pub fn finish(self) -> Result<(), String> {
        self.writer.finish().map_err(|error| error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(pixels: &[(usize, usize)]) -> Picture {
        let mut picture = Picture(Raster::white(7, 5));
        for (x, y) in pixels {
            picture.0.pixels[RGB * (7 * y + x)..][..RGB].copy_from_slice(&[10, 20, 30]);
        }
        picture
    }

    #[test]
    fn the_changed_part_is_the_smallest_rectangle() {
        assert_eq!(with(&[(2, 1), (4, 3)]).changed(&with(&[])), [2, 1, 3, 3]);
        assert_eq!(with(&[(6, 4)]).changed(&with(&[(0, 0)])), [0, 0, 7, 5]);
        assert_eq!(with(&[(1, 1)]).changed(&with(&[(1, 1)])), [0, 0, 1, 1]);
    }

    #[test]
    fn a_reader_sees_the_pictures_that_were_added() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("film.png");
        let pictures = [with(&[]), with(&[(6, 4)]), with(&[(0, 2)]), with(&[(0, 2)])];
        let mut animation = Animation::create(&path, &pictures[0], pictures.len()).expect("a file");
        for (k, picture) in pictures.iter().enumerate() {
            animation.add(picture.clone(), (k as u16 + 1, 15)).expect("a picture");
        }
        animation.finish().expect("an end");
        let file = std::io::BufReader::new(File::open(&path).expect("the file"));
        let mut reader = png::Decoder::new(file).read_info().expect("a PNG");
        assert_eq!(reader.info().animation_control.map(|control| control.num_frames), Some(4));
        // what a viewer does: opaque pixels of each part cover those before
        let mut seen = Picture(Raster::white(7, 5));
        for (k, expected) in pictures.iter().enumerate() {
            let mut buffer = vec![0; reader.output_buffer_size().expect("a size")];
            let info = reader.next_frame(&mut buffer).expect("a frame");
            let control = *reader.info().frame_control().expect("its place");
            assert_eq!((control.delay_num, control.delay_den), (k as u16 + 1, 15));
            assert_eq!(control.blend_op, png::BlendOp::Over);
            for (at, pixel) in buffer[..info.buffer_size()].chunks_exact(RGBA).enumerate() {
                let (x, y) = (at % info.width as usize, at / info.width as usize);
                let to = RGB * (7 * (y + control.y_offset as usize) + x + control.x_offset as usize);
                if pixel[RGB] == 255 {
                    seen.0.pixels[to..to + RGB].copy_from_slice(&pixel[..RGB]);
                }
            }
            assert_eq!(seen, *expected, "{k}");
        }
    }
}
