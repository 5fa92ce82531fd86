//! Pictures of pixels: drawings side by side, and an animated PNG of them.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use dem_drawing::Drawing;

/// Bytes of a pixel.
const RGB: usize = 3;

/// Pixels in rows from the top, as red, green and blue.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
}

impl Picture {
    fn white(width: usize, height: usize) -> Self {
        Self { width, height, pixels: vec![255; RGB * width * height] }
    }

    /// The pixels of a PNG, on white.
    fn decode(png: &[u8]) -> Result<Self, String> {
        let mut decoder = png::Decoder::new(std::io::Cursor::new(png));
        decoder.set_transformations(png::Transformations::normalize_to_color8() | png::Transformations::ALPHA);
        let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
        let mut buffer = vec![0; reader.output_buffer_size().ok_or("the picture is too large")?];
        let info = reader.next_frame(&mut buffer).map_err(|error| error.to_string())?;
        if info.color_type != png::ColorType::Rgba {
            return Err(format!("a picture in {:?}", info.color_type));
        }
        let over_white = |channel: u8, alpha: u8| {
            let (channel, alpha) = (u32::from(channel), u32::from(alpha));
            ((channel * alpha + 255 * (255 - alpha) + 127) / 255) as u8
        };
        let pixels = buffer[..info.buffer_size()].chunks_exact(4).flat_map(|pixel| {
            let [red, green, blue, alpha] = [pixel[0], pixel[1], pixel[2], pixel[3]];
            [red, green, blue].map(|channel| over_white(channel, alpha))
        });
        Ok(Self { width: info.width as usize, height: info.height as usize, pixels: pixels.collect() })
    }

    /// A drawing with charts beside it, one below the other.
    pub fn beside(drawing: &Drawing, charts: &[Drawing], scale: f32) -> Result<Self, String> {
        let left = Self::decode(&drawing.png_scaled(scale)?)?;
        let charts: Vec<Self> =
            charts.iter().map(|chart| Self::decode(&chart.png_scaled(scale)?)).collect::<Result<_, String>>()?;
        let right = charts.iter().map(|chart| chart.width).max().unwrap_or(0);
        let below: usize = charts.iter().map(|chart| chart.height).sum();
        let mut whole = Self::white(left.width + right, left.height.max(below));
        whole.put(&left, (0, (whole.height - left.height) / 2));
        let mut top = (whole.height - below) / 2;
        for chart in &charts {
            whole.put(chart, (left.width, top));
            top += chart.height;
        }
        Ok(whole)
    }

    fn put(&mut self, other: &Self, (x, y): (usize, usize)) {
        for (row, pixels) in other.pixels.chunks_exact(RGB * other.width.max(1)).enumerate() {
            let start = RGB * ((y + row) * self.width + x);
            self.pixels[start..start + pixels.len()].copy_from_slice(pixels);
        }
    }

    /// The smallest rectangle outside which two pictures of one size agree: its corner and its size
    /// in pixels, at least one.
    fn changed(&self, before: &Self) -> [usize; 4] {
        let row = |picture: &Self, y: usize| y * RGB * picture.width..(y + 1) * RGB * picture.width;
        let differs = |y: &usize| self.pixels[row(self, *y)] != before.pixels[row(before, *y)];
        let Some(top) = (0..self.height).find(differs) else { return [0, 0, 1, 1] };
        let bottom = (0..self.height).rev().find(differs).unwrap_or(top);
        let (mut left, mut right) = (self.width - 1, 0);
        for y in top..=bottom {
            let rows = self.pixels[row(self, y)].chunks_exact(RGB).zip(before.pixels[row(before, y)].chunks_exact(RGB));
            for (x, _) in rows.enumerate().filter(|(_, (now, then))| now != then) {
                (left, right) = (left.min(x), right.max(x));
            }
        }
        [left, top, right - left + 1, bottom - top + 1]
    }

    fn part(&self, [left, top, width, height]: [usize; 4]) -> Vec<u8> {
        (top..top + height)
            .flat_map(|y| &self.pixels[RGB * (y * self.width + left)..RGB * (y * self.width + left + width)])
            .copied()
            .collect()
    }
}

/// An animated PNG that is being written. Of each picture but the first, the part that changed is
/// stored.
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
        let mut encoder = png::Encoder::new(BufWriter::new(file), first.width as u32, first.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Balanced);
        encoder.set_animated(count as u32, 0).map_err(told)?;
        Ok(Self { writer: encoder.write_header().map_err(told)?, before: None })
    }

    /// Adds a picture that stays for `ticks / rate` seconds.
    pub fn add(&mut self, picture: Picture, (ticks, rate): (u16, u16)) -> Result<(), String> {
        let place = match &self.before {
            Some(before) if (before.width, before.height) != (picture.width, picture.height) => {
                return Err("the pictures differ in size".into());
            }
            Some(before) => picture.changed(before),
            None => [0, 0, picture.width, picture.height],
        };
        let [left, top, width, height] = place.map(|length| length as u32);
        let mut write = || {
            self.writer.set_frame_delay(ticks, rate)?;
            // a rectangle may not leave the picture, so the old place goes first
            self.writer.reset_frame_position()?;
            self.writer.set_frame_dimension(width, height)?;
            self.writer.set_frame_position(left, top)?;
            self.writer.write_image_data(&picture.part(place))
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
        let mut picture = Picture::white(7, 5);
        for (x, y) in pixels {
            picture.pixels[RGB * (7 * y + x)..][..RGB].copy_from_slice(&[10, 20, 30]);
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
        // what a viewer does: each part is put over the picture before
        let mut seen = Picture::white(7, 5);
        for (k, expected) in pictures.iter().enumerate() {
            let mut buffer = vec![0; reader.output_buffer_size().expect("a size")];
            let info = reader.next_frame(&mut buffer).expect("a frame");
            let control = *reader.info().frame_control().expect("its place");
            assert_eq!((control.delay_num, control.delay_den), (k as u16 + 1, 15));
            let part = Picture {
                width: info.width as usize,
                height: info.height as usize,
                pixels: buffer[..info.buffer_size()].to_vec(),
            };
            seen.put(&part, (control.x_offset as usize, control.y_offset as usize));
            assert_eq!(seen, *expected, "{k}");
        }
    }
}
