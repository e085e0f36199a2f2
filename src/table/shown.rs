//! Names and texts of files in messages: what could steer a terminal, or look like another line, is escaped.

use std::fmt;
use std::path::Path;

/// A path as messages show it: unchanged if it is plain. Control characters and those that turn the direction of
/// writing are escaped as in Rust, and bytes that are not UTF-8 as `\xff`.
pub fn shown(path: &Path) -> Shown<'_> {
    Shown(path.as_os_str().as_encoded_bytes())
}

/// A text in the same way.
pub fn shown_text(text: &str) -> Shown<'_> {
    Shown(text.as_bytes())
}

#[derive(Clone, Copy, Debug)]
pub struct Shown<'a>(&'a [u8]);

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for chunk in self.0.utf8_chunks() {
            for c in chunk.valid().chars() {
                if is_plain(c) {
                    write!(f, "{c}")?;
                } else {
                    write!(f, "{}", c.escape_default())?;
                }
            }
            for byte in chunk.invalid() {
                write!(f, "\\x{byte:02x}")?;
            }
        }
        Ok(())
    }
}

/// Whether a terminal shows a character for what it is, and nothing else happens: neither one that turns the direction
/// of writing, nor one that cannot be seen or looks like a space.
pub fn is_plain(c: char) -> bool {
    let turns = matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let has_no_width = matches!(
        c,
        '\u{ad}' | '\u{180e}' | '\u{200b}'..='\u{200d}' | '\u{2060}' | '\u{feff}'
    );
    !c.is_control() && !turns && !has_no_width && (c == ' ' || !c.is_whitespace())
}

/// Bytes in the unit that suits them, rounded up.
pub fn shown_bytes(bytes: f64) -> String {
    if bytes < 1e6 {
        format!("{:.0} kB", (1e-3 * bytes).ceil())
    } else if bytes < 1e9 {
        format!("{:.0} MB", (1e-6 * bytes).ceil())
    } else {
        format!("{:.1} GB", 1e-9 * bytes)
    }
}

/// A path in JSON, which holds texts alone: exact if it is UTF-8, else with `\xff` for each byte that is not.
pub fn serialize_path<S: serde::Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    match path.to_str() {
        Some(text) => serializer.serialize_str(text),
        None => serializer.collect_str(&shown(path)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_names_are_shown_as_they_are_and_others_steer_no_terminal() {
        for plain in ["results/fig3", r"C:\results", "with space", "θ/ü", ""] {
            assert_eq!(shown(Path::new(plain)).to_string(), plain);
        }
        assert_eq!(
            shown_text("a\nto repair:\n  \u{1b}[31m\u{9b}\u{202e}").to_string(),
            r"a\nto repair:\n  \u{1b}[31m\u{9b}\u{202e}"
        );
    }

    #[test]
    #[cfg(unix)]
    fn bytes_that_are_no_text_are_shown_as_numbers() {
        use std::os::unix::ffi::OsStrExt;
        let path = Path::new(std::ffi::OsStr::from_bytes(b"a\xff\n/b"));
        assert_eq!(shown(path).to_string(), r"a\xff\n/b");
    }
}
