//! The parameters of the model: one validated struct, each field described once; and some of them as columns of a row.
//!
//! Source: Capozza et al., PRL 107, 024301 (2011), Fig. 1 for the defaults. Every place that names a parameter (sweep
//! files, flags, table columns, the documentation) goes through [`Symbol`].

use super::fields::fields;
use super::theory::{eta, to_twelve_digits, typical_interval};
use crate::columns::{Column, Row};
use crate::value::{Value, words};
use std::f64::consts::TAU;
use std::marker::PhantomData;
use std::ops::Deref;

words! {
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    pub enum BreakOn {
        /// When the magnitude of its force reaches the threshold, pulled forward or backward.
        #[default]
        Magnitude = "magnitude",
        /// Only when a force against forward motion reaches the threshold.
        Tension = "tension",
    }
}

fields! {
    /// All that defines one realisation of the model. Quantities are SI.
    ///
    /// The defaults are those of Fig. 1, without modulation. Construct by changing fields, then call
    /// [`Parameters::validated`]; everything downstream expects validated, canonical values.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Parameters by Symbol but unknown {
        N("N", "N") blocks: usize = 70, "", SIZE, "number of blocks";
        Ns("Ns", "N_s") contacts_per_block: usize = 20, "", SIZE and "N * Ns <= 1e7", "contacts per block";
        M("M", "M") slider_mass: f64 = 11.5, "kg", POSITIVE, "slider mass";
        K("K", "K") slider_stiffness: f64 = 1e8, "N/m", POSITIVE,
            "slider stiffness; neighbours are joined by (N-1) K";
        Kd("Kd", "K_d") drive_stiffness: f64 = 4e7, "N/m", POSITIVE, "stiffness of the driving spring";
        Ki("ki", "k") contact_stiffness: f64 = 5e6, "N/m", POSITIVE, "mean contact stiffness, <k_i>";
        Fs("fs", "f_s") mean_threshold: f64 = 1.37, "N", POSITIVE, "mean contact threshold";
        Dfs("dfs", "Δf_s") threshold_deviation: f64 = 6.9e-3, "N", NOT_NEGATIVE and "dfs <= fs",
            "standard deviation of the contact thresholds";
        TauR("tau_r", "τ_r") reattachment_time: f64 = 0.005, "s", POSITIVE, "mean reattachment delay";
        Gamma("gamma", "γ") damping_rate: f64 = 6462.0, "1/s", NOT_NEGATIVE, "damping rate";
        V0("V0", "V0") drive_velocity: f64 = 1e-4, "m/s", POSITIVE and "not so low that slips are over 1e100 s apart",
            "drive velocity";
        Delta("Delta", "Δ", "Amplitude") modulation_amplitude: f64 = 0.0, "m", NOT_NEGATIVE,
            "amplitude of the modulation, 0 is off";
        T("T", "T") modulation_period: Option<f64> = None, "s", POSITIVE and "given when Delta > 0",
            "period of the modulation";
        TTo("T_to", "T_to") turning_period: Option<f64> = None, "s",
            POSITIVE and "given only with Delta > 0 and ramp_time > 0",
            "period at the turning point of the ramp; null: not ramped";
        DeltaTo("Delta_to", "Δ_to") turning_amplitude: Option<f64> = None, "m",
            NOT_NEGATIVE and "given only with Delta > 0 and ramp_time > 0",
            "amplitude at the turning point of the ramp; null: not ramped";
        RampTime("ramp_time", "", "Duration of the ramp") ramp_time: f64 = 0.0, "s",
            NOT_NEGATIVE and "at most 1e9 T and 1e9 T_to, above 0 only with T_to or Delta_to",
            "duration of the ramp to T_to and Delta_to, and of that back; 0 is off";
        PulseStart("pulse_start", "t_p", "Start of the pulse") pulse_start: Option<f64> = None, "s", NOT_NEGATIVE and "given only with Delta > 0 and without a ramp",
            "start of the modulation as a pulse; null: it lasts";
        PulseCycles("pulse_cycles", "", "Periods of the pulse") pulse_cycles: Option<u64> = None, "", COUNT and "given only with pulse_start",
            "periods of the pulse, 1 if not given";
        FN("FN", "F_N") normal_force: f64 = 4000.0, "N", POSITIVE, "normal force, enters reported ratios only";
        L("L", "L") slider_length: f64 = 0.15, "m", POSITIVE,
            "slider length, enters positions and front speeds only";
        BreakOn("break_on") break_on: BreakOn = BreakOn::Magnitude, "", WORD and "magnitude of either sign", "when a contact breaks";
        Seed("seed") seed: u64 = 0, "", COUNT_OR_ZERO, "realisation of the disorder";
    }
}

/// Largest number of contacts; a job holds about 350 bytes for each.
const MAX_CONTACTS: usize = 10_000_000;
/// Longest time between slips, in s: far beyond it, times and rates leave the range of doubles, and nothing ever
/// breaks.
const MAX_INTERVAL: f64 = 1e100;
/// Longest ramp, in periods: each is one cycle to be stepped over.
const MAX_RAMPED_PERIODS: f64 = 1e9;

/// A value that a parameter cannot take.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{} = {value}: must be {}", .symbol.key(), .symbol.description().requirement())]
pub struct ParameterError {
    pub symbol: Symbol,
    /// The refused value, as given.
    pub value: String,
}

impl Symbol {
    /// Whether it belongs to the modulation: without it, it is at its default.
    pub const fn is_of_modulation(self) -> bool {
        use Symbol::{Delta, DeltaTo, PulseCycles, PulseStart, RampTime, T, TTo};
        matches!(
            self,
            Delta | T | DeltaTo | TTo | RampTime | PulseStart | PulseCycles
        )
    }
}

impl Parameters {
    /// Sets one parameter. Whole reals are accepted for counts and whole numbers for reals.
    pub fn set(&mut self, symbol: Symbol, value: Value<'_>) -> Result<(), ParameterError> {
        self.put(symbol, value).ok_or_else(|| ParameterError {
            symbol,
            value: value.to_string(),
        })
    }

    /// Checks every range and rule and brings the values into canonical form: without modulation there is no period, a
    /// pulse has periods, and no zero is negative.
    pub fn validated(mut self) -> Result<Self, ParameterError> {
        for symbol in Symbol::ALL {
            if self.unknown.contains(&symbol) {
                continue;
            }
            let value = self.get(symbol);
            let refuse = || ParameterError {
                symbol,
                value: value.to_string(),
            };
            self.set(symbol, symbol.checked(value).ok_or_else(refuse)?)?;
        }
        self.check_rules()?;
        if !self.is_modulated() {
            self.modulation_period = None;
        }
        if self.pulse_start.is_some() {
            self.pulse_cycles.get_or_insert(1);
        }
        Ok(self)
    }

    /// Whether the drive oscillates, be it by an amplitude that is not known.
    pub fn is_modulated(&self) -> bool {
        self.modulation_amplitude > 0.0 || self.unknown.contains(&Symbol::Delta)
    }

    /// Checks the rules between parameters, each of which is in its range.
    pub fn check_rules(&self) -> Result<(), ParameterError> {
        let is_modulated = self.modulation_amplitude > 0.0;
        let can_ramp = is_modulated && self.ramp_time > 0.0;
        let contacts = self.blocks * self.contacts_per_block;
        let rules = [
            (Symbol::Ns, contacts <= MAX_CONTACTS),
            (Symbol::Dfs, self.threshold_deviation <= self.mean_threshold),
            (Symbol::V0, typical_interval(self) <= MAX_INTERVAL),
            (Symbol::T, self.modulation_period.is_some() || !is_modulated),
            (Symbol::TTo, self.turning_period.is_none() || can_ramp),
            (
                Symbol::DeltaTo,
                self.turning_amplitude.is_none() || can_ramp,
            ),
            (Symbol::RampTime, self.ramp_time <= self.max_ramp_time()),
            (
                Symbol::PulseStart,
                self.pulse_start.is_none() || (is_modulated && self.ramp_time == 0.0),
            ),
            (
                Symbol::PulseCycles,
                self.pulse_start.is_some() || self.pulse_cycles.is_none(),
            ),
        ];
        match rules.into_iter().find(|(_, holds)| !holds) {
            None => Ok(()),
            Some((symbol, _)) => Err(ParameterError {
                symbol,
                value: self.get(symbol).to_string(),
            }),
        }
    }

    /// The longest that a ramp between these periods and amplitudes may take each way, in s; 0 if nothing is ramped.
    fn max_ramp_time(&self) -> f64 {
        if self.turning_period.is_none() && self.turning_amplitude.is_none() {
            return 0.0;
        }
        let shortest = [self.modulation_period, self.turning_period]
            .into_iter()
            .flatten()
            .fold(f64::INFINITY, f64::min);
        (MAX_RAMPED_PERIODS * shortest).min(f64::MAX)
    }

    /// Mass of one block m = M/N, in kg.
    pub fn block_mass(&self) -> f64 {
        self.slider_mass / self.blocks as f64
    }

    /// Stiffness `K_int = (N-1) K` between neighbouring blocks, in N/m.
    pub fn coupling_stiffness(&self) -> f64 {
        (self.blocks - 1) as f64 * self.slider_stiffness
    }

    /// Stiffness `K_s = k N_s` of the intact contacts of one block, in N/m.
    pub fn block_contact_stiffness(&self) -> f64 {
        self.contact_stiffness * self.contacts_per_block as f64
    }

    /// Contact reach `f_s/k`, in m: how far a block moves until a mean contact breaks. The scale of every tolerance.
    pub fn contact_reach(&self) -> f64 {
        self.mean_threshold / self.contact_stiffness
    }

    /// Angular frequency 2π/T of the modulation, in rad/s; 0 when it is off.
    pub fn modulation_frequency(&self) -> f64 {
        self.modulation_period.map_or(0.0, |period| TAU / period)
    }

    /// The largest angular frequency of the modulation on its ramp, in rad/s; 0 when it is off, or a pulse: steps before
    /// one are those without.
    pub fn largest_modulation_frequency(&self) -> f64 {
        if self.pulse_start.is_some() {
            return 0.0;
        }
        self.turning_period
            .map_or(0.0, |period| TAU / period)
            .max(self.modulation_frequency())
    }

    /// The frequency of the modulation in Hz, to twelve digits. `None` without modulation.
    pub fn frequency(&self) -> Option<f64> {
        self.modulation_period
            .map(|period| to_twelve_digits(1.0 / period))
    }

    /// η of the modulation, see [`eta`](super::theory::eta).
    pub fn eta(&self) -> f64 {
        eta(
            self.modulation_frequency(),
            self.modulation_amplitude,
            self.drive_velocity,
        )
    }

    /// The same in another realisation.
    pub fn with_seed(&self, seed: u64) -> Self {
        Self {
            seed,
            ..self.clone()
        }
    }

    /// These parameters without modulation, in canonical form: see [`Symbol::is_of_modulation`].
    pub fn without_modulation(&self) -> Self {
        let default = Self::default();
        let mut same = self.clone();
        for symbol in Symbol::ALL
            .into_iter()
            .filter(|symbol| symbol.is_of_modulation())
        {
            same.put(symbol, default.get(symbol));
        }
        same
    }

    /// Wave crossing time `t_c = N sqrt(m/K_int)`, in s: no front spans a longer gap between breaks. For one block, its
    /// period 2π sqrt(m/(`K_s` + `K_d`)).
    pub fn wave_crossing_time(&self) -> f64 {
        if self.blocks == 1 {
            TAU * (self.block_mass() / (self.block_contact_stiffness() + self.drive_stiffness))
                .sqrt()
        } else {
            self.blocks as f64 * (self.block_mass() / self.coupling_stiffness()).sqrt()
        }
    }
}

/// Which parameters stand in a row.
pub trait Selection {
    /// Their symbols, in order.
    const SYMBOLS: &'static [Symbol];
}

/// Some of the parameters as columns, under their keys and with their units and meanings. Read back, the others have
/// their defaults; what is null and may not be so is not known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selected<S> {
    pub all: Parameters,
    selection: PhantomData<S>,
}

impl<S> Selected<S> {
    pub const fn new(all: Parameters) -> Self {
        Self {
            all,
            selection: PhantomData,
        }
    }
}

impl<S> Deref for Selected<S> {
    type Target = Parameters;

    fn deref(&self) -> &Parameters {
        &self.all
    }
}

impl<S: Selection> Row for Selected<S> {
    fn columns_as(_: Column) -> Vec<Column> {
        let columns = S::SYMBOLS.iter();
        columns.map(|symbol| symbol.description().column).collect()
    }

    fn cells(&self, give: &mut dyn FnMut(Value<'_>)) {
        for &symbol in S::SYMBOLS {
            give(self.all.get(symbol));
        }
    }

    fn from_cells<'a>(_: &str, next: &mut dyn FnMut() -> Value<'a>) -> Result<Self, String> {
        let mut parameters = Parameters::default();
        for &symbol in S::SYMBOLS {
            match next() {
                Value::Null if !symbol.description().nullable => parameters.unknown.push(symbol),
                value => parameters
                    .set(symbol, value)
                    .map_err(|error| error.to_string())?,
            }
        }
        parameters
            .validated()
            .map(Self::new)
            .map_err(|error| error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_distinct_and_read_back() {
        for symbol in Symbol::ALL {
            assert_eq!(Symbol::from_key(symbol.key()), Some(symbol));
        }
    }

    #[test]
    fn every_value_survives_a_round_trip_through_its_symbol() {
        let original = Parameters {
            modulation_amplitude: 1e-6,
            modulation_period: Some(0.01),
            turning_period: Some(0.02),
            turning_amplitude: Some(0.0),
            ramp_time: 4.0,
            ..Parameters::default()
        };
        let mut copy = Parameters {
            seed: 9,
            blocks: 3,
            ..Parameters::default()
        };
        for symbol in Symbol::ALL {
            copy.set(symbol, original.get(symbol)).unwrap();
        }
        assert_eq!(copy, original);
    }

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        let refused = |symbol: Symbol, value: f64| {
            let mut parameters = Parameters::default();
            match parameters.set(symbol, Value::Real(value)) {
                Err(error) => error.symbol,
                Ok(()) => parameters.validated().expect_err("must be refused").symbol,
            }
        };
        for symbol in Symbol::ALL
            .into_iter()
            .filter(|&symbol| symbol != Symbol::BreakOn)
        {
            for value in [f64::NAN, f64::INFINITY, -1.0] {
                assert_eq!(refused(symbol, value), symbol, "{symbol:?} = {value}");
            }
        }
        for symbol in [
            Symbol::N,
            Symbol::Ns,
            Symbol::M,
            Symbol::V0,
            Symbol::T,
            Symbol::TauR,
        ] {
            assert_eq!(refused(symbol, 0.0), symbol);
        }
        assert_eq!(refused(Symbol::N, 1.5), Symbol::N);
        assert_eq!(refused(Symbol::N, 1e6), Symbol::N);
        assert_eq!(refused(Symbol::Dfs, 1.4), Symbol::Dfs);
        assert_eq!(refused(Symbol::Delta, 1e-6), Symbol::T);
        for velocity in [5e-324, 1e-310, 1e-308, 1e-106] {
            assert_eq!(refused(Symbol::V0, velocity), Symbol::V0);
        }
    }

    #[test]
    fn half_a_ramp_is_refused_by_name() {
        let ramp = Parameters {
            modulation_amplitude: 1e-6,
            modulation_period: Some(0.03),
            turning_period: Some(0.04),
            turning_amplitude: Some(0.0),
            ramp_time: 10.0,
            ..Parameters::default()
        };
        let refused =
            |parameters: Parameters| parameters.validated().expect_err("must be refused").symbol;
        assert_eq!(ramp.clone().validated().unwrap(), ramp);
        assert_eq!(
            refused(Parameters {
                modulation_amplitude: 0.0,
                ..ramp.clone()
            }),
            Symbol::TTo
        );
        assert_eq!(
            refused(Parameters {
                ramp_time: 0.0,
                ..ramp.clone()
            }),
            Symbol::TTo
        );
        assert_eq!(
            refused(Parameters {
                turning_period: None,
                ramp_time: 0.0,
                ..ramp.clone()
            }),
            Symbol::DeltaTo
        );
        assert_eq!(
            refused(Parameters {
                turning_period: Some(0.0),
                ..ramp.clone()
            }),
            Symbol::TTo
        );
        assert_eq!(
            refused(Parameters {
                turning_period: Some(0.9e-8),
                ..ramp.clone()
            }),
            Symbol::RampTime
        );
        assert_eq!(
            refused(Parameters {
                turning_period: None,
                turning_amplitude: None,
                ..ramp
            }),
            Symbol::RampTime
        );
    }

    #[test]
    fn without_modulation_the_period_is_irrelevant() {
        let with = Parameters {
            modulation_period: Some(0.5),
            ..Parameters::default()
        }
        .validated()
        .unwrap();
        let minus_zero = Parameters {
            modulation_amplitude: -0.0,
            ..Parameters::default()
        }
        .validated()
        .unwrap();
        assert_eq!(with, Parameters::default());
        assert_eq!(minus_zero.modulation_amplitude.to_bits(), 0);
    }
}
