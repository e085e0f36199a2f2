//! Checksums: a file holds the SHA-256 of its own bytes, so that any changed bit of it is found.
//!
//! In a table file the hash is over the whole file, with zeros in the place of its 64 characters, which stand in the
//! footer under the key `seal`. Checksums of pages, which the format knows, cover neither its footer nor the headers of
//! its pages.

use serde::Serialize;
use sha2::{Digest, Sha256};
use std::fmt::Write as _;

pub const FOOTER_KEY: &str = "seal";
/// What is in its place while the hash is taken.
pub const PLACEHOLDER: &str = "0000000000000000000000000000000000000000000000000000000000000000";
/// How the format writes a key of 4 and a text of 64 characters. No sweep file may hold such control characters.
const ENCODED_KEY: &[u8] = b"\x18\x04seal\x18\x40";
/// Bytes after the footer: its length in four of them, and [`MAGIC`].
const END: usize = 8;
const MAGIC: &[u8] = b"PAR1";

pub fn hexadecimal(hash: &[u8]) -> String {
    hash.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// Where the hash stands in bytes that end a file.
fn place(end: &[u8]) -> Option<usize> {
    let mut windows = end.windows(ENCODED_KEY.len());
    let mark = windows.position(|bytes| bytes == ENCODED_KEY)?;
    let place = mark + ENCODED_KEY.len();
    (place + PLACEHOLDER.len() <= end.len()).then_some(place)
}

/// Puts the checksum into a footer, which comes last in a file: `hasher` has seen all bytes before it.
/// `None` if it has no place for it.
pub(super) fn close(mut hasher: Sha256, footer: &mut [u8]) -> Option<()> {
    let begin = place(footer)?;
    hasher.update(&*footer);
    let checksum = hexadecimal(&hasher.finalize());
    footer[begin..begin + PLACEHOLDER.len()].copy_from_slice(checksum.as_bytes());
    Some(())
}

/// Compares the bytes of a file with their checksum; what is wrong with them.
pub fn check(bytes: &[u8]) -> Result<(), &'static str> {
    const CUT: &str = "it is cut off, or no Parquet file";
    let (Some(rest), true) = (bytes.len().checked_sub(END), bytes.ends_with(MAGIC)) else {
        return Err(CUT);
    };
    let encoded = bytes[rest..].first_chunk();
    let length = encoded.map_or(0, |length| u32::from_le_bytes(*length));
    let begin = rest.checked_sub(length as usize);
    let footer = begin.filter(|begin| *begin >= MAGIC.len()).ok_or(CUT)?;
    let place = footer + place(&bytes[footer..]).ok_or("it has no checksum")?;
    let (before, rest) = bytes.split_at(place);
    let (written, after) = rest.split_at(PLACEHOLDER.len());
    let mut hasher = Sha256::new();
    for bytes in [before, PLACEHOLDER.as_bytes(), after] {
        hasher.update(bytes);
    }
    if hexadecimal(&hasher.finalize()).as_bytes() == written {
        Ok(())
    } else {
        Err("its bytes are not those that were written")
    }
}

pub fn of_text(text: &str) -> String {
    hexadecimal(&Sha256::digest(text))
}

/// A value with the SHA-256 of the rest of its text.
#[derive(Serialize)]
struct Checksummed<'a, T> {
    #[serde(flatten)]
    value: &'a T,
    sha256: String,
}

/// A value as JSON with a checksum: the same text for the same value.
pub fn to_json<T: Serialize>(value: &T) -> serde_json::Result<String> {
    let sha256 = hexadecimal(&Sha256::digest(serde_json::to_string_pretty(value)?));
    Ok(serde_json::to_string_pretty(&Checksummed { value, sha256 })? + "\n")
}

/// Such a text without its checksum, if that fits.
pub fn checked(text: &str) -> Result<String, &'static str> {
    let (rest, checksum) = text
        .rsplit_once(",\n  \"sha256\": ")
        .ok_or("it is cut off, or has no checksum")?;
    let rest = format!("{rest}\n}}");
    if checksum == format!("\"{}\"\n}}\n", of_text(&rest)) {
        Ok(rest)
    } else {
        Err("its bytes are not those that were written")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::file::{Footer, TableWriter};
    use crate::table::storage::{Disk, Storage};
    use crate::table::tests::{Reading, readings};
    use std::collections::BTreeMap;
    use std::fs;

    #[test]
    fn every_changed_bit_and_every_cut_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.parquet");
        let mut writer = TableWriter::<Reading>::new(
            &crate::table::arrow::Gaps::default(),
            &path,
            Disk.create(&path).unwrap(),
            &Footer::default(),
        )
        .unwrap();
        for (reading, _) in &readings() {
            writer.push(reading).unwrap();
        }
        writer.finish().unwrap();
        let bytes = fs::read(&path).unwrap();
        check(&bytes).unwrap();
        let is_found = |changed: &[u8]| check(changed).is_err();
        for bit in 0..8 * bytes.len() {
            let mut changed = bytes.clone();
            changed[bit / 8] ^= 1 << (bit % 8);
            assert!(is_found(&changed), "bit {bit}");
        }
        for length in 0..bytes.len() {
            assert!(is_found(&bytes[..length]), "cut at {length}");
        }
    }

    #[test]
    fn every_changed_bit_of_a_text_with_a_checksum_is_found() {
        let value = BTreeMap::from([("a".to_owned(), vec![1, 2]), ("b \"ü".to_owned(), vec![])]);
        let text = to_json(&value).unwrap();
        let read: BTreeMap<String, Vec<u32>> =
            serde_json::from_str(&checked(&text).unwrap()).unwrap();
        assert_eq!(read, value);
        for bit in 0..8 * text.len() {
            let mut changed = text.clone().into_bytes();
            changed[bit / 8] ^= 1 << (bit % 8);
            if let Ok(changed) = String::from_utf8(changed) {
                assert!(checked(&changed).is_err(), "{changed}");
            }
        }
    }
}
