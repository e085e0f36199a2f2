//! stub
use super::*;
pub(super) fn run(
    _p: &Parameters,
    _dt: f64,
    _l: Limits<'_>,
    _o: &mut dyn Observer,
) -> Result<Summary, SimulationError> {
    todo!()
}
