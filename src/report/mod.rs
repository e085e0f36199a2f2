//! Report: a results directory as one HTML page to explore in a browser, which loads nothing else.
//!
//! ```text
//! page_columns.rs    tables, column by column: the sets, their histograms, a sample of slips
//! content.rs         they, with the sweep, how far it is, its cost and its runs
//!                    content and page.html, style.css, *.js -> one file
//! ```
//!
//! No chart library: the crate `plotly` 0.14 would bring 7.6 MB of scripts into the program, and 1.9 MB into each page,
//! compressed. `chart.js` draws 100,000 points on a canvas, and no more is needed.

mod content;
mod page_columns;

use crate::reduce::{WRITER, renew};
use crate::results::Results;
use crate::results::commit::{Commit, exclusive_lock};
use anyhow::{Context, Result};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use serde_json::Value as Json;
use sha2::{Digest, Sha256};
use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Duration;

/// What to do about a table that cannot be read.
const ADVICE: &str = "`stickslip verify` says what to do about damage";

/// The report of a directory as HTML. Reduces the tables first if the reduced data are out of date.
///
/// With `refresh`, the page says that a run is in progress, and reloads itself after about this time.
pub fn page(results: &Results<'_>, refresh: Option<Duration>) -> Result<String> {
    let results = renew(results)?;
    html(&content::content(&results, refresh)?).context("the report cannot be encoded")
}

/// Writes the report of a directory to `report.html` in it, over an earlier one, and returns its path.
pub fn write(results: &Results<'_>, refresh: Option<Duration>) -> Result<PathBuf> {
    let layout = results.layout();
    let page = page(results, refresh)?;
    let _alone = exclusive_lock(layout, WRITER)?;
    let mut commit = Commit::begin(layout, &layout.staging(WRITER))?;
    commit.stage_bytes(&layout.report(), page.as_bytes())?;
    results.publish(commit)?;
    Ok(layout.report())
}

const PAGE: &str = include_str!("page.html");
const STYLE: &str = include_str!("style.css");
/// Each script needs only those before it.
const SCRIPTS: [&str; 9] = [
    include_str!("data.js"),
    include_str!("axis.js"),
    include_str!("chart.js"),
    include_str!("colours.js"),
    include_str!("table.js"),
    include_str!("set.js"),
    include_str!("explore.js"),
    include_str!("sections.js"),
    include_str!("main.js"),
];

/// The page of this content: its files put together, with the content compressed, so that no text of it can be taken for
/// HTML.
fn html(content: &Json) -> Result<String> {
    let data = data(content)?;
    let script = format!("\"use strict\";\n{}", SCRIPTS.concat());
    // Scripts and styles other than these do not count, and nothing is loaded.
    let policy = format!(
        "default-src 'none'; script-src '{}'; style-src '{}'; base-uri 'none'; form-action 'none'",
        digest(&script),
        digest(STYLE)
    );
    let parts = [
        ("policy", policy.as_str()),
        ("style", STYLE),
        ("script", &script),
        ("data", &data),
    ];
    Ok(parts
        .into_iter()
        .fold(PAGE.to_owned(), |page, (name, text)| {
            page.replacen(&format!("{{{{{name}}}}}"), text, 1)
        }))
}

/// The content, compressed, in characters that mean nothing in HTML.
fn data(content: &Json) -> Result<String, io::Error> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(content.to_string().as_bytes())?;
    Ok(BASE64_STANDARD.encode(encoder.finish()?))
}

/// A text as a policy names it.
fn digest(text: &str) -> String {
    format!("sha256-{}", BASE64_STANDARD.encode(Sha256::digest(text)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_text_of_the_content_is_html() {
        let data = data(&"</script><script>alert(1)</script>\u{2028}<!--".into()).unwrap();
        assert!(
            data.chars()
                .all(|c| c.is_ascii_alphanumeric() || "+/=".contains(c)),
            "{data}"
        );
    }

    #[test]
    fn the_files_of_the_page_fit_into_it() {
        for name in ["policy", "style", "script", "data"] {
            assert_eq!(
                PAGE.matches(&format!("{{{{{name}}}}}")).count(),
                1,
                "{name}"
            );
        }
        let inserted = [STYLE].into_iter().chain(SCRIPTS);
        for text in inserted {
            // Either would end its element, or be taken for a place to fill.
            assert!(!text.contains("</") && !text.contains("{{"), "{text}");
            assert!(!text.contains("http"), "a page loads nothing");
        }
    }
}
