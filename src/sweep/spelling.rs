//! What was probably meant by an unknown word.

/// The hint for an unknown word: the nearest known one, or all.
pub(super) fn hint(word: &str, known: &[&str]) -> String {
    match nearest(word, known) {
        Some(candidate) => format!("did you mean {candidate}?"),
        None => format!("allowed are {}", known.join(", ")),
    }
}

/// The known word that was probably meant by an unknown one.
pub fn nearest<'k>(word: &str, known: &[&'k str]) -> Option<&'k str> {
    let distance =
        |candidate: &str| strsim::levenshtein(&word.to_lowercase(), &candidate.to_lowercase());
    // Half of a short word, two letters of a long one.
    let max = (word.chars().count() / 2).min(2);
    let known = known.iter().copied();
    let near = known.filter(|candidate| distance(candidate) <= max);
    near.min_by_key(|candidate| distance(candidate))
}
