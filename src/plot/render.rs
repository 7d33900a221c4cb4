//! Plots as files. The font is part of the program, so that no font must be installed.

use super::{Plot, draw};
use crate::xml_text;
use plotters::backend::{BitMapBackend, SVGBackend};
use plotters::drawing::IntoDrawingArea;
use plotters::style::{FontStyle, register_font};
use std::path::Path;
use std::sync::Once;
use thiserror::Error;

/// The font's name for the renderer, and the generic name for viewers of an SVG.
pub(super) const FONT: &str = "monospace";

/// Reason for which a plot cannot be made.
#[derive(Debug, Error)]
pub enum PlotError {
    /// The file name does not end in `.svg` or `.png`.
    #[error("`{0}`: the name of a plot ends in .svg or .png")]
    Name(String),
    /// The plot could not be drawn.
    #[error("the plot cannot be drawn: {0}")]
    Drawing(String),
    /// The picture could not be encoded.
    #[error("the plot cannot be encoded: {0}")]
    Encoding(String),
}

/// Format of a plot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Picture {
    /// A picture in the format Scalable Vector Graphics.
    Svg,
    /// A picture in the format Portable Network Graphics.
    Png,
}

impl Picture {
    /// Returns the format for the name of a file.
    ///
    /// # Errors
    /// The name has another extension.
    pub fn of(file: &Path) -> Result<Self, PlotError> {
        match file.extension().and_then(|ending| ending.to_str()) {
            Some("svg") => Ok(Picture::Svg),
            Some("png") => Ok(Picture::Png),
            _ => Err(PlotError::Name(file.display().to_string())),
        }
    }
}

impl Plot {
    /// Returns the plot as the contents of a file.
    ///
    /// # Errors
    /// [`PlotError`] if it cannot be drawn or encoded.
    pub fn render(&self, picture: Picture) -> Result<Vec<u8>, PlotError> {
        match picture {
            Picture::Svg => self.svg().map(String::into_bytes),
            Picture::Png => self.png(),
        }
    }

    /// Returns the plot as SVG.
    ///
    /// # Errors
    /// [`PlotError::Drawing`].
    pub fn svg(&self) -> Result<String, PlotError> {
        register();
        let mut text = String::new();
        let area = SVGBackend::with_string(&mut text, draw::size(self)).into_drawing_area();
        draw::draw(self, &area).and_then(|()| area.present()).map_err(drawing)?;
        drop(area);
        Ok(xml_text::allowed(text))
    }

    /// Returns the plot as PNG.
    ///
    /// # Errors
    /// [`PlotError::Drawing`], [`PlotError::Encoding`].
    pub fn png(&self) -> Result<Vec<u8>, PlotError> {
        register();
        let (width, height) = draw::size(self);
        let mut pixels = vec![0; 3 * width as usize * height as usize];
        let area = BitMapBackend::with_buffer(&mut pixels, (width, height)).into_drawing_area();
        draw::draw(self, &area).and_then(|()| area.present()).map_err(drawing)?;
        drop(area);
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&pixels));
        written.map_err(|error| PlotError::Encoding(error.to_string()))?;
        Ok(file)
    }
}

fn drawing(error: impl std::fmt::Display) -> PlotError {
    PlotError::Drawing(error.to_string())
}

/// Registers the font with the renderer.
fn register() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // The font is part of the program; an unreadable font would fail every test of plots.
        let _ = register_font(FONT, FontStyle::Normal, epaint_default_fonts::HACK_REGULAR);
    });
}
