//! The parameters of the model: one validated struct, one symbol table.
//!
//! Source: Capozza et al., PRL 107, 024301 (2011), Fig. 1 for the defaults. Every place that names a parameter (sweep
//! files, flags, table columns, the documentation) goes through [`Symbol`], so that a key, its unit and its meaning are
//! written once.

use super::theory::eta;
use std::f64::consts::TAU;
use std::fmt;
use std::str::FromStr;

/// When a contact breaks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum BreakOn {
    /// When the magnitude of its force reaches the threshold, pulled forward or backward.
    #[default]
    Magnitude,
    /// Only when a force against forward motion reaches the threshold.
    Tension,
}

impl BreakOn {
    /// The word used in files and flags.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Magnitude => "magnitude",
            Self::Tension => "tension",
        }
    }
}

impl FromStr for BreakOn {
    type Err = ();

    fn from_str(word: &str) -> Result<Self, ()> {
        match word {
            "magnitude" => Ok(Self::Magnitude),
            "tension" => Ok(Self::Tension),
            _ => Err(()),
        }
    }
}

/// All that defines one realisation of the model. Quantities are SI.
///
/// The defaults are those of Fig. 1, without modulation. Construct by changing fields, then call
/// [`Parameters::validated`]; everything downstream expects validated, canonical values.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    /// Number of blocks N. 1 to 100,000.
    pub blocks: usize,
    /// Contacts per block `N_s`. 1 to 100,000; `N · N_s` at most 10 million.
    pub contacts_per_block: usize,
    /// Slider mass M, in kg. > 0. A block has M/N.
    pub slider_mass: f64,
    /// Slider stiffness K, in N/m. > 0. Neighbouring blocks are joined by (N-1) K.
    pub slider_stiffness: f64,
    /// Stiffness `K_d` of the driving spring, in N/m. > 0.
    pub drive_stiffness: f64,
    /// Mean contact stiffness k, in N/m. > 0.
    pub contact_stiffness: f64,
    /// Mean contact threshold `f_s`, in N. > 0.
    pub mean_threshold: f64,
    /// Standard deviation `Δf_s` of the contact thresholds, in N. 0 (identical contacts) up to `f_s`.
    pub threshold_deviation: f64,
    /// Mean reattachment delay `τ_r`, in s. > 0.
    pub reattachment_time: f64,
    /// Damping rate γ, in 1/s. >= 0.
    pub damping_rate: f64,
    /// Drive velocity `V_0`, in m/s. > 0.
    pub drive_velocity: f64,
    /// Amplitude Δ of the modulation, in m. >= 0; 0 is off.
    pub modulation_amplitude: f64,
    /// Period T of the modulation, in s. Some value > 0 exactly when Δ > 0.
    pub modulation_period: Option<f64>,
    /// Period `T_to` at the turning point of the ramp, in s. > 0; none: the period is not ramped.
    pub turning_period: Option<f64>,
    /// Amplitude `Δ_to` at the turning point of the ramp, in m. >= 0; none: the amplitude is not ramped.
    pub turning_amplitude: Option<f64>,
    /// Duration of the ramp's way to its turning point, and of its way back, in s. Above 0 exactly when one of the two is ramped.
    pub ramp_time: f64,
    /// Normal force `F_N`, in N. > 0. Enters reported ratios only.
    pub normal_force: f64,
    /// Slider length L, in m. > 0. Enters positions and front speeds only.
    pub slider_length: f64,
    /// When a contact breaks.
    pub break_on: BreakOn,
    /// Realisation of the disorder. At most 2^53 - 1, so that every reader holds it exactly.
    pub seed: u64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            blocks: 70,
            contacts_per_block: 20,
            slider_mass: 11.5,
            slider_stiffness: 1e8,
            drive_stiffness: 4e7,
            contact_stiffness: 5e6,
            mean_threshold: 1.37,
            threshold_deviation: 6.9e-3,
            reattachment_time: 0.005,
            damping_rate: 6462.0,
            drive_velocity: 1e-4,
            modulation_amplitude: 0.0,
            modulation_period: None,
            turning_period: None,
            turning_amplitude: None,
            ramp_time: 0.0,
            normal_force: 4000.0,
            slider_length: 0.15,
            break_on: BreakOn::Magnitude,
            seed: 0,
        }
    }
}

/// A parameter under its symbol in the paper, which is its key in files, flags and tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs, reason = "each is described in `Symbol::description`")]
pub enum Symbol {
    N,
    Ns,
    M,
    K,
    Kd,
    SmallK,
    Fs,
    Dfs,
    TauR,
    Gamma,
    V0,
    Delta,
    T,
    TTo,
    DeltaTo,
    RampTime,
    FN,
    L,
    BreakOn,
    Seed,
}

/// Key, unit, meaning and allowed range of one [`Symbol`].
#[derive(Clone, Copy, Debug)]
pub struct Description {
    /// Key in files, flags and tables.
    pub key: &'static str,
    /// SI unit; empty for a pure number or a word.
    pub unit: &'static str,
    /// One line, without a full stop.
    pub meaning: &'static str,
    /// The allowed values, as an error message names them.
    pub allowed: &'static str,
}

const fn describe(key: &'static str, unit: &'static str, meaning: &'static str, allowed: &'static str) -> Description {
    Description { key, unit, meaning, allowed }
}

const POSITIVE: &str = "a finite number > 0";
const NOT_NEGATIVE: &str = "a finite number >= 0";
const TURNING_PERIOD: &str = "a finite number > 0, given only with Delta > 0 and ramp_time > 0";
const TURNING_AMPLITUDE: &str = "a finite number >= 0, given only with Delta > 0 and ramp_time > 0";
const RAMP_TIME: &str = "a finite number >= 0, at most 1e9 T and 1e9 T_to, above 0 only with T_to or Delta_to";

/// Largest number of blocks, and of contacts per block.
const MOST_PER_AXIS: usize = 100_000;
/// Largest number of contacts; a job holds about 350 bytes for each.
const MOST_CONTACTS: usize = 10_000_000;
/// Longest ramp, in periods: each is one cycle to be stepped over.
const MOST_RAMPED_PERIODS: f64 = 1e9;
/// Largest integer that a double, and so every reader of a table, holds exactly.
const MOST_SEED: u64 = (1 << 53) - 1;

impl Symbol {
    /// Every symbol, in the order of tables and documentation.
    pub const ALL: [Self; 20] = [
        Self::N,
        Self::Ns,
        Self::M,
        Self::K,
        Self::Kd,
        Self::SmallK,
        Self::Fs,
        Self::Dfs,
        Self::TauR,
        Self::Gamma,
        Self::V0,
        Self::Delta,
        Self::T,
        Self::TTo,
        Self::DeltaTo,
        Self::RampTime,
        Self::FN,
        Self::L,
        Self::BreakOn,
        Self::Seed,
    ];

    /// Key, unit, meaning and range.
    #[must_use]
    pub const fn description(self) -> Description {
        match self {
            Self::N => describe("N", "", "number of blocks", "a whole number from 1 to 100000"),
            Self::Ns => describe("Ns", "", "contacts per block", "a whole number from 1 to 100000, N * Ns <= 1e7"),
            Self::M => describe("M", "kg", "slider mass", POSITIVE),
            Self::K => describe("K", "N/m", "slider stiffness; neighbours are joined by (N-1) K", POSITIVE),
            Self::Kd => describe("Kd", "N/m", "stiffness of the driving spring", POSITIVE),
            Self::SmallK => describe("k", "N/m", "mean contact stiffness", POSITIVE),
            Self::Fs => describe("fs", "N", "mean contact threshold", POSITIVE),
            Self::Dfs => {
                describe("dfs", "N", "standard deviation of the contact thresholds", "a finite number, 0 <= dfs <= fs")
            }
            Self::TauR => describe("tau_r", "s", "mean reattachment delay", POSITIVE),
            Self::Gamma => describe("gamma", "1/s", "damping rate", NOT_NEGATIVE),
            Self::V0 => describe("V0", "m/s", "drive velocity", POSITIVE),
            Self::Delta => describe("Delta", "m", "amplitude of the modulation, 0 is off", NOT_NEGATIVE),
            Self::T => describe("T", "s", "period of the modulation", "a finite number > 0, given when Delta > 0"),
            Self::TTo => {
                describe("T_to", "s", "period at the turning point of the ramp; null: not ramped", TURNING_PERIOD)
            }
            Self::DeltaTo => describe(
                "Delta_to",
                "m",
                "amplitude at the turning point of the ramp; null: not ramped",
                TURNING_AMPLITUDE,
            ),
            Self::RampTime => describe(
                "ramp_time",
                "s",
                "duration of the ramp to T_to and Delta_to, and of that back; 0 is off",
                RAMP_TIME,
            ),
            Self::FN => describe("FN", "N", "normal force, enters reported ratios only", POSITIVE),
            Self::L => describe("L", "m", "slider length, enters positions and front speeds only", POSITIVE),
            Self::BreakOn => {
                describe("break_on", "", "when a contact breaks", "\"magnitude\" (either sign) or \"tension\"")
            }
            Self::Seed => describe("seed", "", "realisation of the disorder", "a whole number from 0 to 2^53 - 1"),
        }
    }

    /// Key in files, flags and tables.
    #[must_use]
    pub const fn key(self) -> &'static str {
        self.description().key
    }

    /// Whether it says how the modulation is ramped.
    #[must_use]
    pub const fn is_ramp(self) -> bool {
        matches!(self, Self::TTo | Self::DeltaTo | Self::RampTime)
    }

    /// The symbol with this key.
    #[must_use]
    pub fn from_key(key: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|symbol| symbol.key() == key)
    }
}

/// The value of a parameter outside the struct: in a file, on an axis, in a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// A count or a seed.
    Count(u64),
    /// A quantity in SI units.
    Real(f64),
    /// The rule for breaking.
    BreakOn(BreakOn),
    /// A period that is not there because the modulation is off, or the end of a ramp that is not there.
    Absent,
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count(count) => write!(f, "{count}"),
            Self::Real(real) => write!(f, "{}", Shortest(*real)),
            Self::BreakOn(rule) => write!(f, "{}", rule.word()),
            Self::Absent => write!(f, "none"),
        }
    }
}

/// A double in the shortest decimal form that reads back to the same bits, with an exponent where that is shorter.
pub(crate) struct Shortest(pub f64);

impl fmt::Display for Shortest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let magnitude = self.0.abs();
        if self.0 != 0.0 && (!(1e-3..1e6).contains(&magnitude)) && self.0.is_finite() {
            write!(f, "{:e}", self.0)
        } else {
            write!(f, "{}", self.0)
        }
    }
}

/// A value that a parameter cannot take.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{} = {value}: must be {}", .symbol.key(), .symbol.description().allowed)]
pub struct ParameterError {
    /// The parameter.
    pub symbol: Symbol,
    /// The refused value, as given.
    pub value: String,
}

impl Parameters {
    /// The value behind a symbol.
    #[must_use]
    pub fn get(&self, symbol: Symbol) -> Value {
        match symbol {
            Symbol::N => Value::Count(self.blocks as u64),
            Symbol::Ns => Value::Count(self.contacts_per_block as u64),
            Symbol::M => Value::Real(self.slider_mass),
            Symbol::K => Value::Real(self.slider_stiffness),
            Symbol::Kd => Value::Real(self.drive_stiffness),
            Symbol::SmallK => Value::Real(self.contact_stiffness),
            Symbol::Fs => Value::Real(self.mean_threshold),
            Symbol::Dfs => Value::Real(self.threshold_deviation),
            Symbol::TauR => Value::Real(self.reattachment_time),
            Symbol::Gamma => Value::Real(self.damping_rate),
            Symbol::V0 => Value::Real(self.drive_velocity),
            Symbol::Delta => Value::Real(self.modulation_amplitude),
            Symbol::T => self.modulation_period.map_or(Value::Absent, Value::Real),
            Symbol::TTo => self.turning_period.map_or(Value::Absent, Value::Real),
            Symbol::DeltaTo => self.turning_amplitude.map_or(Value::Absent, Value::Real),
            Symbol::RampTime => Value::Real(self.ramp_time),
            Symbol::FN => Value::Real(self.normal_force),
            Symbol::L => Value::Real(self.slider_length),
            Symbol::BreakOn => Value::BreakOn(self.break_on),
            Symbol::Seed => Value::Count(self.seed),
        }
    }

    /// Sets one parameter. Whole reals are accepted for counts and whole numbers for reals.
    ///
    /// # Errors
    /// When the kind of value does not fit the symbol. The range is checked by [`Parameters::validated`].
    pub fn set(&mut self, symbol: Symbol, value: Value) -> Result<(), ParameterError> {
        let refuse = || ParameterError { symbol, value: value.to_string() };
        let real = || match value {
            Value::Real(real) => Ok(real),
            #[expect(clippy::cast_precision_loss, reason = "a count this large is refused as a real anyway")]
            Value::Count(count) => Ok(count as f64),
            _ => Err(refuse()),
        };
        let count = || match value {
            Value::Count(count) => Ok(count),
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked by the guard")]
            Value::Real(real) if real >= 0.0 && real <= MOST_SEED as f64 && real.fract() == 0.0 => Ok(real as u64),
            _ => Err(refuse()),
        };
        let real_or_absent = || if value == Value::Absent { Ok(None) } else { real().map(Some) };
        let size = || usize::try_from(count()?).map_err(|_| refuse());
        match symbol {
            Symbol::N => self.blocks = size()?,
            Symbol::Ns => self.contacts_per_block = size()?,
            Symbol::M => self.slider_mass = real()?,
            Symbol::K => self.slider_stiffness = real()?,
            Symbol::Kd => self.drive_stiffness = real()?,
            Symbol::SmallK => self.contact_stiffness = real()?,
            Symbol::Fs => self.mean_threshold = real()?,
            Symbol::Dfs => self.threshold_deviation = real()?,
            Symbol::TauR => self.reattachment_time = real()?,
            Symbol::Gamma => self.damping_rate = real()?,
            Symbol::V0 => self.drive_velocity = real()?,
            Symbol::Delta => self.modulation_amplitude = real()?,
            Symbol::T => self.modulation_period = real_or_absent()?,
            Symbol::TTo => self.turning_period = real_or_absent()?,
            Symbol::DeltaTo => self.turning_amplitude = real_or_absent()?,
            Symbol::RampTime => self.ramp_time = real()?,
            Symbol::FN => self.normal_force = real()?,
            Symbol::L => self.slider_length = real()?,
            Symbol::BreakOn => match value {
                Value::BreakOn(rule) => self.break_on = rule,
                _ => return Err(refuse()),
            },
            Symbol::Seed => self.seed = count()?,
        }
        Ok(())
    }

    /// Checks every range and brings the values into canonical form: without modulation there is no period, and no
    /// negative zero.
    ///
    /// # Errors
    /// Names the first parameter that is out of range, its value and what is allowed.
    pub fn validated(mut self) -> Result<Self, ParameterError> {
        let can_ramp = self.modulation_amplitude != 0.0 && self.ramp_time != 0.0;
        for symbol in Symbol::ALL {
            let value = self.get(symbol);
            let allowed = match (symbol, value) {
                (Symbol::N, _) => (1..=MOST_PER_AXIS).contains(&self.blocks),
                (Symbol::Ns, _) => {
                    (1..=MOST_PER_AXIS).contains(&self.contacts_per_block)
                        && self.blocks * self.contacts_per_block <= MOST_CONTACTS
                }
                (Symbol::Seed, Value::Count(seed)) => seed <= MOST_SEED,
                (Symbol::Dfs, Value::Real(real)) => real >= 0.0 && real <= self.mean_threshold,
                (Symbol::Gamma | Symbol::Delta, Value::Real(real)) => real >= 0.0 && real.is_finite(),
                (Symbol::DeltaTo, Value::Real(real)) => real >= 0.0 && real.is_finite() && can_ramp,
                (Symbol::TTo, Value::Real(real)) => real > 0.0 && real.is_finite() && can_ramp,
                (Symbol::RampTime, Value::Real(real)) => real >= 0.0 && real <= self.longest_ramp(),
                (_, Value::Real(real)) => real > 0.0 && real.is_finite(),
                (Symbol::T, Value::Absent) => self.modulation_amplitude == 0.0,
                _ => true,
            };
            if !allowed {
                return Err(ParameterError { symbol, value: value.to_string() });
            }
        }
        if self.modulation_amplitude == 0.0 {
            self.modulation_period = None;
        }
        // Adding zero turns -0.0 into 0.0: equal parameters must have equal bits.
        self.modulation_amplitude += 0.0;
        self.turning_amplitude = self.turning_amplitude.map(|amplitude| amplitude + 0.0);
        self.ramp_time += 0.0;
        self.damping_rate += 0.0;
        self.threshold_deviation += 0.0;
        Ok(self)
    }

    /// The longest that a ramp between these periods and amplitudes may take each way, in s; 0 if nothing is ramped.
    fn longest_ramp(&self) -> f64 {
        if self.turning_period.is_none() && self.turning_amplitude.is_none() {
            return 0.0;
        }
        let shortest =
            [self.modulation_period, self.turning_period].into_iter().flatten().fold(f64::INFINITY, f64::min);
        (MOST_RAMPED_PERIODS * shortest).min(f64::MAX)
    }

    /// Mass of one block m = M/N, in kg.
    #[must_use]
    pub fn block_mass(&self) -> f64 {
        self.slider_mass / self.blocks as f64
    }

    /// Stiffness `K_int = (N-1) K` between neighbouring blocks, in N/m.
    #[must_use]
    pub fn coupling_stiffness(&self) -> f64 {
        (self.blocks - 1) as f64 * self.slider_stiffness
    }

    /// Stiffness `K_s = k N_s` of the intact contacts of one block, in N/m.
    #[must_use]
    pub fn block_contact_stiffness(&self) -> f64 {
        self.contact_stiffness * self.contacts_per_block as f64
    }

    /// Contact reach `f_s/k`, in m: how far a block moves until a mean contact breaks. The scale of every tolerance.
    #[must_use]
    pub fn contact_reach(&self) -> f64 {
        self.mean_threshold / self.contact_stiffness
    }

    /// Angular frequency 2π/T of the modulation, in rad/s; 0 when it is off.
    #[must_use]
    pub fn modulation_frequency(&self) -> f64 {
        self.modulation_period.map_or(0.0, |period| TAU / period)
    }

    /// The largest angular frequency of the modulation on its ramp, in rad/s; 0 when it is off.
    #[must_use]
    pub fn largest_modulation_frequency(&self) -> f64 {
        self.turning_period.map_or(0.0, |period| TAU / period).max(self.modulation_frequency())
    }

    /// η of the modulation, see [`eta`](super::theory::eta).
    #[must_use]
    pub fn eta(&self) -> f64 {
        eta(self.modulation_frequency(), self.modulation_amplitude, self.drive_velocity)
    }

    /// Wave crossing time `t_c = N sqrt(m/K_int)`, in s: no front spans a longer gap between breaks. For one block, its
    /// period 2π sqrt(m/(`K_s` + `K_d`)).
    #[must_use]
    pub fn wave_crossing_time(&self) -> f64 {
        if self.blocks == 1 {
            TAU * (self.block_mass() / (self.block_contact_stiffness() + self.drive_stiffness)).sqrt()
        } else {
            self.blocks as f64 * (self.block_mass() / self.coupling_stiffness()).sqrt()
        }
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
        let mut copy = Parameters { seed: 9, blocks: 3, ..Parameters::default() };
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
        for symbol in Symbol::ALL.into_iter().filter(|&symbol| symbol != Symbol::BreakOn) {
            for value in [f64::NAN, f64::INFINITY, -1.0] {
                assert_eq!(refused(symbol, value), symbol, "{symbol:?} = {value}");
            }
        }
        for symbol in [Symbol::N, Symbol::Ns, Symbol::M, Symbol::V0, Symbol::T, Symbol::TauR] {
            assert_eq!(refused(symbol, 0.0), symbol);
        }
        assert_eq!(refused(Symbol::N, 1.5), Symbol::N);
        assert_eq!(refused(Symbol::N, 1e6), Symbol::N);
        assert_eq!(refused(Symbol::Dfs, 1.4), Symbol::Dfs);
        assert_eq!(refused(Symbol::Delta, 1e-6), Symbol::T);
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
        let refused = |parameters: Parameters| parameters.validated().expect_err("must be refused").symbol;
        assert_eq!(ramp.clone().validated().unwrap(), ramp);
        assert_eq!(refused(Parameters { modulation_amplitude: 0.0, ..ramp.clone() }), Symbol::TTo);
        assert_eq!(refused(Parameters { ramp_time: 0.0, ..ramp.clone() }), Symbol::TTo);
        assert_eq!(refused(Parameters { turning_period: None, ramp_time: 0.0, ..ramp.clone() }), Symbol::DeltaTo);
        assert_eq!(refused(Parameters { turning_period: Some(0.0), ..ramp.clone() }), Symbol::TTo);
        assert_eq!(refused(Parameters { turning_period: Some(0.9e-8), ..ramp.clone() }), Symbol::RampTime);
        assert_eq!(refused(Parameters { turning_period: None, turning_amplitude: None, ..ramp }), Symbol::RampTime);
    }

    #[test]
    fn without_modulation_the_period_is_irrelevant() {
        let with = Parameters { modulation_period: Some(0.5), ..Parameters::default() }.validated().unwrap();
        let minus_zero = Parameters { modulation_amplitude: -0.0, ..Parameters::default() }.validated().unwrap();
        assert_eq!(with, Parameters::default());
        assert_eq!(minus_zero.modulation_amplitude.to_bits(), 0);
    }
}
