//! What figures read of a results directory, and write into it.

use super::picture::{Picture, PictureFormat};
use super::quantity::distinct;
use crate::reduce::{advise, read_reduced, read_sets};
use crate::results::ResultsError;
use crate::results::commit::Commit;
use crate::results::layout::Layout;
use crate::sets::SetRow;
use crate::table::Table;
use anyhow::Result;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Sets that figures hold at once, about a kilobyte each; of more, no figure of sets is drawn.
const MAX_SETS: usize = 100_000;
pub(super) const ADVICE: &str = "if it is missing or damaged, reduce the tables again";

/// The sets with at least one interval or a regime; none if these are too many.
pub(super) fn sets_with_results(layout: &Layout<'_>) -> Result<Vec<SetRow>, ResultsError> {
    let mut sets = Vec::new();
    for set in read_sets(layout) {
        let set = set?;
        if set.intervals > 0 || set.regime.is_some() {
            sets.push(set);
        }
        if sets.len() > MAX_SETS {
            return Ok(Vec::new());
        }
    }
    Ok(sets)
}

pub(super) fn read<R: Table>(layout: &Layout<'_>) -> Result<Vec<R>> {
    read_reduced(layout).map_err(advise(ADVICE))
}

/// Figures that were written, and what is to be said of them.
#[derive(Clone, Debug, Default)]
pub struct Drawn {
    pub files: Vec<PathBuf>,
    pub remarks: Vec<String>,
}

/// What is to be said of pictures: in what directories differ, which have no mark, and letters that are boxes.
pub fn remarks(pictures: &[Picture]) -> Vec<String> {
    let directories = pictures
        .iter()
        .flat_map(|picture| &picture.look.directories);
    let lines = distinct(directories.map(String::as_str)).into_iter();
    let mut remarks: Vec<String> = lines
        .map(|line| format!("differs  {}", line.replace('\u{a0}', " ")))
        .collect();
    for picture in pictures {
        let name = picture.name();
        let absent = picture.absent.iter();
        remarks.extend(absent.map(|absent| format!("figure {name} shows nothing of {absent}")));
    }
    let boxes: BTreeSet<char> = pictures.iter().flat_map(Picture::boxes).collect();
    if !boxes.is_empty() {
        let letters: Vec<String> = boxes.iter().map(char::to_string).collect();
        remarks.push(format!(
            "warning: the font of figures lacks {}: boxes stand for them (in SVG, unless the viewer has another font)",
            letters.join(" ")
        ));
    }
    remarks
}

/// Puts pictures into `figures/`, each in these formats.
pub fn write(
    layout: &Layout<'_>,
    pictures: &[Picture],
    formats: &[PictureFormat],
) -> Result<Vec<PathBuf>> {
    pictures.iter().try_for_each(Picture::check_size)?;
    let folder = layout.figures();
    layout.ensure_folder(&folder)?;
    let mut commit = Commit::begin(layout)?;
    let mut files = Vec::new();
    for picture in pictures {
        for &format in formats {
            let file = folder.join(format!("{}.{}", picture.name(), format.word()));
            commit.stage_bytes(&file, &picture.encoded(format)?)?;
            files.push(file);
        }
    }
    commit.publish()?;
    Ok(files)
}
