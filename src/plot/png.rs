//! Pictures as PNG: the same on every machine, because the font is included.

use std::io::Read;
use std::sync::Arc;

use flate2::read::GzDecoder;
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb};

use super::{Plot, Theme};

/// The font `DejaVu Sans`, compressed to half its size; its licence is in the same folder.
static FONT: &[u8] = include_bytes!("font/DejaVuSans.ttf.gz");

/// Why a picture could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PngError {
    /// The font cannot be read.
    #[error("the font cannot be read: {0}")]
    Font(#[from] std::io::Error),
    /// The drawing cannot be parsed.
    #[error("the picture cannot be drawn: {0}")]
    Drawing(#[from] resvg::usvg::Error),
    /// The picture would be too large.
    #[error("a picture of {0} by {1} pixels is too large")]
    Size(u32, u32),
    /// The picture cannot be encoded.
    #[error("the picture cannot be encoded: {0}")]
    Encoding(String),
}

/// Draws a plot as a PNG of `width` pixels.
///
/// # Errors
/// If the picture is too large, or cannot be drawn or encoded.
pub fn png(plot: &Plot, theme: Theme, width: u32) -> Result<Vec<u8>, PngError> {
    let mut fonts = fontdb::Database::new();
    let mut font = Vec::new();
    GzDecoder::new(FONT).read_to_end(&mut font)?;
    fonts.load_font_data(font);
    let options = Options { fontdb: Arc::new(fonts), font_family: "DejaVu Sans".to_owned(), ..Options::default() };
    let theme = if theme == Theme::Auto { Theme::Light } else { theme };
    let tree = Tree::from_str(&plot.to_svg(theme), &options)?;
    let size = tree.size().to_int_size();
    let scaled = size.scale_to_width(width).ok_or(PngError::Size(width, size.height()))?;
    let mut picture =
        Pixmap::new(scaled.width(), scaled.height()).ok_or(PngError::Size(scaled.width(), scaled.height()))?;
    #[expect(clippy::cast_precision_loss, reason = "a few thousand pixels")]
    let factor = width as f32 / tree.size().width();
    resvg::render(&tree, Transform::from_scale(factor, factor), &mut picture.as_mut());
    picture.encode_png().map_err(|error| PngError::Encoding(error.to_string()))
}
