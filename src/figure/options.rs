//! What a user asks of figures, and cannot have.

/// What was asked of a figure that cannot be drawn so: the flag, and what to do.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct BadOption(pub(super) String);

impl BadOption {
    pub(super) fn new(option: &str, value: &str, problem: &str) -> Self {
        Self(format!("--{option} {value}: {problem}"))
    }
}

/// Longest text that a user gives for a figure, in characters.
const MAX_TEXT: usize = 1000;

pub(super) fn check_text(option: &str, text: &str) -> Result<(), BadOption> {
    let count = text.chars().count();
    if count <= MAX_TEXT {
        return Ok(());
    }
    let start: String = text.chars().take(20).collect();
    let problem = format!("has {count} characters; it may have {MAX_TEXT}");
    Err(BadOption::new(option, &format!("{start}…"), &problem))
}
