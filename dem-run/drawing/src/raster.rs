//! Drawings as pixels.
//!
//! The plotting crate draws rotated text with jagged edges. Here such a text is drawn upright on a
//! sheet of its own, which is turned by a right angle and laid over the picture.

use kuva::PngBackend;
use kuva::render::render::{Primitive, Scene, TextAnchor};

/// Bytes of a pixel: red, green, blue.
pub const RGB: usize = 3;

/// Pixels in rows from the top, as red, green and blue.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Raster {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// The pixels.
    pub pixels: Vec<u8>,
}

impl Raster {
    /// A white picture.
    pub fn white(width: usize, height: usize) -> Self {
        Self { size: [width, height], pixels: vec![255; RGB * width * height] }
    }

    /// A scene with `scale` pixels per unit of length.
    ///
    /// # Errors
    /// The message of the plotting crate, or of the decoder.
    pub fn of(scene: &Scene, scale: f32) -> Result<Self, String> {
        let render = |scene: &Scene| Self::decode(&PngBackend::new().with_scale(scale).render_scene(scene)?);
        let labels = upright_labels(scene);
        if labels.is_empty() {
            return render(scene);
        }
        let turned =
            |element: &&Primitive| matches!(element, Primitive::Text { rotate: Some(angle), .. } if is_left(*angle));
        let mut rest = Scene::new(scene.width, scene.height);
        rest.background_color.clone_from(&scene.background_color);
        rest.text_color.clone_from(&scene.text_color);
        rest.font_family.clone_from(&scene.font_family);
        rest.defs.clone_from(&scene.defs);
        rest.elements = scene.elements.iter().filter(|element| !turned(element)).cloned().collect();
        let mut whole = render(&rest)?;
        for (label, corner) in labels {
            let upright = render(&label)?;
            let corner = corner.map(|x| (x * f64::from(scale)).round() as i64);
            whole.darken(&upright.turned_left(), corner);
        }
        Ok(whole)
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
        Ok(Self { size: [info.width as usize, info.height as usize], pixels: pixels.collect() })
    }

    /// The picture turned to the left by a right angle.
    fn turned_left(&self) -> Self {
        let [width, height] = self.size;
        let mut turned = Self::white(height, width);
        for y in 0..height {
            for x in 0..width {
                let (from, to) = (RGB * (y * width + x), RGB * ((width - 1 - x) * height + y));
                turned.pixels[to..to + RGB].copy_from_slice(&self.pixels[from..from + RGB]);
            }
        }
        turned
    }

    /// Takes the darker of two pixels where another picture, whose corner is at `corner`, overlaps.
    fn darken(&mut self, other: &Self, corner: [i64; 2]) {
        let [width, height] = self.size.map(|length| length as i64);
        for y in 0..other.size[1] {
            for x in 0..other.size[0] {
                let at = [corner[0] + x as i64, corner[1] + y as i64];
                if at[0] < 0 || at[1] < 0 || at[0] >= width || at[1] >= height {
                    continue;
                }
                let (from, to) = (RGB * (y * other.size[0] + x), RGB * (at[1] * width + at[0]) as usize);
                for channel in 0..RGB {
                    self.pixels[to + channel] = self.pixels[to + channel].min(other.pixels[from + channel]);
                }
            }
        }
    }

    /// The picture as PNG with its size on paper: `dots` pixels in a metre.
    ///
    /// # Errors
    /// The message of the encoder.
    pub fn png(&self, dots: f64) -> Result<Vec<u8>, String> {
        let mut png = vec![];
        let mut encoder = png::Encoder::new(&mut png, self.size[0] as u32, self.size[1] as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let dots = dots.round() as u32;
        encoder.set_pixel_dims(Some(png::PixelDimensions { xppu: dots, yppu: dots, unit: png::Unit::Meter }));
        let told = |error: png::EncodingError| error.to_string();
        let mut writer = encoder.write_header().map_err(told)?;
        writer.write_image_data(&self.pixels).map_err(told)?;
        writer.finish().map_err(told)?;
        Ok(png)
    }
}

fn is_left(angle: f64) -> bool {
    angle == -90.0
}

/// Each text that is turned to the left by a right angle, upright on a sheet of its own, and the
/// corner of the turned sheet in the scene.
fn upright_labels(scene: &Scene) -> Vec<(Scene, [f64; 2])> {
    let mut labels = vec![];
    // groups move what is in them
    let mut moved = vec![[0.0; 2]];
    for element in &scene.elements {
        match element {
            Primitive::GroupStart { transform, .. } => {
                let [x, y] = moved.last().copied().unwrap_or_default();
                let [dx, dy] = transform.as_deref().map_or([0.0; 2], translation);
                moved.push([x + dx, y + dy]);
            }
            Primitive::GroupEnd => {
                moved.pop();
            }
            Primitive::Text { x, y, content, size, anchor, rotate: Some(angle), bold, color } if is_left(*angle) => {
                let [dx, dy] = moved.last().copied().unwrap_or_default();
                // room for letters as wide as high
                let reach = f64::from(*size) * (content.chars().count() as f64 + 1.0);
                let (before, width) = match anchor {
                    TextAnchor::Start => (0.0, reach),
                    TextAnchor::Middle => (0.5 * reach, reach),
                    TextAnchor::End => (reach, reach),
                };
                let (above, height) = (1.5 * f64::from(*size), 2.0 * f64::from(*size));
                let mut sheet = Scene::new(width, height);
                sheet.text_color.clone_from(&scene.text_color);
                sheet.font_family.clone_from(&scene.font_family);
                sheet.add(Primitive::Text {
                    x: before,
                    y: above,
                    content: content.clone(),
                    size: *size,
                    anchor: *anchor,
                    rotate: None,
                    bold: *bold,
                    color: color.clone(),
                });
                // (before, above) on the sheet is (above, width - before) on the turned one
                labels.push((sheet, [x + dx - above, y + dy - (width - before)]));
            }
            _ => {}
        }
    }
    labels
}

/// The lengths of `translate(x,y)`; zero for any other transform.
fn translation(transform: &str) -> [f64; 2] {
    let inner = transform.strip_prefix("translate(").and_then(|rest| rest.strip_suffix(')'));
    let parts: Vec<f64> = inner.unwrap_or("").split(',').filter_map(|part| part.trim().parse().ok()).collect();
    parts.try_into().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Chart, Style, colour};

    /// A picture with dark pixels at these places.
    fn with(size: [usize; 2], dark: &[[usize; 2]]) -> Raster {
        let mut picture = Raster::white(size[0], size[1]);
        for [x, y] in dark {
            picture.pixels[RGB * (y * size[0] + x)..][..RGB].fill(0);
        }
        picture
    }

    #[test]
    fn a_turn_to_the_left_brings_the_right_end_to_the_top() {
        assert_eq!(with([3, 2], &[[2, 0], [0, 1]]).turned_left(), with([2, 3], &[[0, 0], [1, 2]]));
    }

    #[test]
    fn an_overlay_outside_is_cut_off() {
        let mut picture = with([3, 3], &[[1, 1]]);
        picture.darken(&with([2, 2], &[[0, 0], [1, 1]]), [-1, 1]);
        assert_eq!(picture, with([3, 3], &[[1, 1], [0, 2]]));
    }

    #[test]
    fn a_rotated_title_is_smooth_where_the_plotting_crate_draws_it() {
        let chart = || Chart::new("x", "HIH").curve("", colour::BLUE, Style::Line, vec![(0.0, 0.0), (1.0, 1.0)]);
        let drawing = Chart::draw(vec![chart()]);
        // title of the vertical axis: left of the tick labels
        let left = |picture: &Raster| -> Vec<(usize, usize, u8)> {
            let [width, height] = picture.size;
            let all = (0..height).flat_map(|y| (0..50).map(move |x| (x, y)));
            let grey = |(x, y): (usize, usize)| picture.pixels[RGB * (y * width + x)];
            all.map(|(x, y)| (x, y, grey((x, y)))).filter(|pixel| pixel.2 < 128).collect()
        };
        let ours = left(&Raster::of(&drawing.scene, 2.5).expect("pixels"));
        let theirs = PngBackend::new().with_scale(2.5).render_scene(&drawing.scene).expect("a PNG");
        let theirs = left(&Raster::decode(&theirs).expect("pixels"));
        let centre = |pixels: &[(usize, usize, u8)]| {
            let n = pixels.len() as f64;
            [pixels.iter().map(|p| p.0 as f64).sum::<f64>() / n, pixels.iter().map(|p| p.1 as f64).sum::<f64>() / n]
        };
        assert!(ours.len() > 50 && theirs.len() > ours.len(), "{} and {}", ours.len(), theirs.len());
        let (a, b) = (centre(&ours), centre(&theirs));
        assert!((a[0] - b[0]).abs() < 1.5 && (a[1] - b[1]).abs() < 1.5, "{a:?}, {b:?}");
    }

    #[test]
    fn the_size_on_paper_is_in_the_file() {
        let png = with([4, 2], &[[1, 1]]).png(2.5 * crate::UNITS).expect("a PNG");
        let chunk = png.windows(4).position(|name| name == b"pHYs").expect("a size") + 4;
        // 240 pixels in an inch, a unit of a metre
        let dots = (240.0f64 / 0.0254).round() as u32;
        assert_eq!(png[chunk..chunk + 9], [&dots.to_be_bytes()[..], &dots.to_be_bytes(), &[1]].concat());
        assert_eq!(Raster::decode(&png), Ok(with([4, 2], &[[1, 1]])));
    }
}
