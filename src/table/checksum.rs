//! Checksums: a file holds the SHA-256 of its own bytes, so that any changed bit of it is found.
//!
//! In a table file the hash is over the whole file, with zeros in the place of its 64 characters, which stand in the
//! footer under the key `seal`. Checksums of pages, which the format knows, cover neither its footer nor the headers of
//! its pages.

use crate::table::error::DatasetError;
use crate::table::read_file::ReadFile;
use crate::table::storage::{MAX_WHOLE, Storage, StorageError};
use parquet::file::reader::Length;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::io::{self, Read};
use std::path::Path;

/// The footer's key of the checksum.
pub const FOOTER_KEY: &str = "seal";
/// What is in its place while the hash is taken.
pub const PLACEHOLDER: &str = "0000000000000000000000000000000000000000000000000000000000000000";
/// How the format writes a key of 4 and a text of 64 characters. No sweep file may hold such control characters.
const ENCODED_KEY: &[u8] = b"\x18\x04seal\x18\x40";
/// Bytes after the footer: its length in four of them, and [`MAGIC`].
const END: usize = 8;
/// First and last bytes of a file.
const MAGIC: &[u8] = b"PAR1";
/// Bytes that are read and hashed at once.
const CHUNK: usize = 1 << 16;

pub fn hexadecimal(hash: &[u8]) -> String {
    hash.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// Where the hash stands in bytes that end a file.
fn place(end: &[u8]) -> Option<usize> {
    let mark = end.windows(ENCODED_KEY.len()).position(|bytes| bytes == ENCODED_KEY)?;
    let place = mark + ENCODED_KEY.len();
    (place + PLACEHOLDER.len() <= end.len()).then_some(place)
}

/// Puts the checksum into a footer, which comes last in a file: `hasher` has seen all bytes before it. Returns it.
pub(super) fn close(mut hasher: Sha256, footer: &mut [u8]) -> Option<String> {
    let place = place(footer)?;
    hasher.update(&*footer);
    let checksum = hexadecimal(&hasher.finalize());
    footer[place..place + PLACEHOLDER.len()].copy_from_slice(checksum.as_bytes());
    Some(checksum)
}

/// Reads a file and compares its bytes with its checksum, which it returns.
pub fn check(storage: &dyn Storage, path: &Path) -> Result<String, DatasetError> {
    check_file(&ReadFile::open(storage, path)?, path)
}

/// The same of a file that is open.
pub(super) fn check_file(file: &ReadFile, path: &Path) -> Result<String, DatasetError> {
    let compared = compare(file).map_err(|error| {
        // The error that the file remembers says more.
        StorageError::at("read", path)(file.take_refused().unwrap_or(error))
    })?;
    compared.map_err(|problem| DatasetError::damaged(path)(problem))
}

fn compare(file: &ReadFile) -> io::Result<Result<String, &'static str>> {
    const CUT: &str = "it is cut off, or no Parquet file";
    let length = file.len();
    if length < (MAGIC.len() + END) as u64 {
        return Ok(Err(CUT));
    }
    let footer_end = length - END as u64;
    let mut end = [0; END];
    file.from(footer_end).read_exact(&mut end)?;
    let [a, b, c, d, magic @ ..] = end;
    let footer = u32::from_le_bytes([a, b, c, d]);
    if magic != MAGIC || u64::from(footer) > footer_end {
        return Ok(Err(CUT));
    }
    if u64::from(footer) > MAX_WHOLE {
        return Ok(Err("its footer is longer than any"));
    }
    let begin = footer_end - u64::from(footer);
    let mut bytes = file.bytes(begin, footer as usize + END)?;
    let Some(place) = place(&bytes) else { return Ok(Err("it has no checksum")) };
    let written = bytes[place..place + PLACEHOLDER.len()].to_owned();
    bytes[place..place + PLACEHOLDER.len()].copy_from_slice(PLACEHOLDER.as_bytes());

    let mut hasher = Sha256::new();
    let mut data = file.from(0).take(begin);
    let mut chunk = vec![0; CHUNK];
    loop {
        match data.read(&mut chunk) {
            Ok(0) => break,
            Ok(read) => hasher.update(&chunk[..read]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => (),
            Err(error) => return Err(error),
        }
    }
    hasher.update(&bytes);
    let expected = hexadecimal(&hasher.finalize());
    Ok(if expected.as_bytes() == written { Ok(expected) } else { Err("its bytes are not those that were written") })
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

/// The value of such a text.
pub fn from_json<T: Serialize + DeserializeOwned>(text: &str) -> Result<T, String> {
    let mut object: Map<String, Value> = serde_json::from_str(text).map_err(|error| error.to_string())?;
    object.remove("sha256").ok_or("it has no checksum")?;
    let value = serde_json::from_value(Value::Object(object)).map_err(|error| error.to_string())?;
    let expected = to_json(&value).map_err(|error| error.to_string())?;
    if text == expected { Ok(value) } else { Err("it is not as the program wrote it".to_owned()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::columns::tests::{Reading, readings};
    use crate::table::file::{Footer, TableWriter};
    use crate::table::storage::Disk;
    use std::collections::BTreeMap;
    use std::fs;

    #[test]
    fn every_changed_bit_and_every_cut_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.parquet");
        let mut writer = TableWriter::<Reading>::new(Disk.create(&path).unwrap(), &Footer::default()).unwrap();
        for (reading, _) in &readings() {
            writer.push(reading).unwrap();
        }
        let checksum = writer.finish().unwrap();
        assert_eq!(check(&Disk, &path).unwrap(), checksum);
        let bytes = fs::read(&path).unwrap();
        let is_found = |changed: &[u8]| {
            fs::write(&path, changed).unwrap();
            matches!(check(&Disk, &path), Err(DatasetError::Damaged { .. }))
        };
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
        assert_eq!(from_json::<BTreeMap<String, Vec<u32>>>(&text), Ok(value));
        for bit in 0..8 * text.len() {
            let mut changed = text.clone().into_bytes();
            changed[bit / 8] ^= 1 << (bit % 8);
            if let Ok(changed) = String::from_utf8(changed) {
                assert!(from_json::<BTreeMap<String, Vec<u32>>>(&changed).is_err(), "{changed}");
            }
        }
    }
}
