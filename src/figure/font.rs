//! The font of all figures, for the widths of texts.

use std::sync::LazyLock;
use ttf_parser::{Face, GlyphId};

pub(super) fn file() -> &'static [u8] {
    dejavu::sans::regular()
}

static FACE: LazyLock<Option<Face<'static>>> = LazyLock::new(|| Face::parse(file(), 0).ok());
/// Width of a letter over the size of the text, if the font cannot be read.
const LETTER: f64 = 0.6;

/// Width of a text of this size.
pub(super) fn width(text: &str, size: u32) -> f64 {
    let letter = |letter: char| {
        let face = FACE.as_ref()?;
        let glyph = face.glyph_index(letter).unwrap_or(GlyphId(0));
        Some(f64::from(face.glyph_hor_advance(glyph)?) / f64::from(face.units_per_em()))
    };
    f64::from(size)
        * text
            .chars()
            .map(|character| letter(character).unwrap_or(LETTER))
            .sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_are_those_of_the_letters() {
        assert!((width("nn", 10) - 2.0 * width("n", 10)).abs() < 1e-12);
        assert!(width("m", 10) > 2.0 * width("i", 10) && width("", 10) == 0.0);
        assert!(width("φₘᵢₙ", 10) < width("φmin", 10));
    }
}
