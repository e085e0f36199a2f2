//! Keyed disorder: threshold, stiffness and delay of every contact, as a function of (seed, contact, generation) alone.
//!
//! Method: `ChaCha8`; the key is the seed, the stream is the contact's index, the word position is [`WORDS_PER_DRAW`] ×
//! generation. A threshold that is not positive is drawn again [`REDRAW_STRIDE`] words further on, so that no draw
//! depends on another. Normal deviates come from the inverse of the normal distribution (M. J. Wichura, algorithm AS
//! 241, Appl. Statist. 37, 477, 1988), exponential ones from a logarithm, with `libm`'s functions: the same bits on
//! every machine. Contract: the mapping is pinned by known-answer tests; changing it changes [`RNG_SCHEME`].

use super::Parameters;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::array;

/// Name and version of the mapping from (seed, contact, generation) to a contact; written into every result.
pub const RNG_SCHEME: &str = "chacha8-seed-contact-generation-v1";

/// 32-bit words that one draw takes from its stream: two uniform deviates of 64 bits.
const WORDS_PER_DRAW: u128 = 4;
/// Generations in one refill of 64 words, the four blocks that the generator makes at a time.
const DRAWS_PER_REFILL: u32 = 16;
type Draws = [Draw; DRAWS_PER_REFILL as usize];
/// Draws that are computed side by side.
const SIDE_BY_SIDE: usize = 4;
/// Distance of the words of a redrawn threshold: beyond those of any generation.
const REDRAW_STRIDE: u128 = 1 << 40;
/// Uniform deviates lie in (0, 1): 53 random bits, shifted by half a step.
const UNIFORM_STEP: f64 = 1.0 / 9_007_199_254_740_992.0;

/// One life of a contact, as drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Threshold `f_i`, in N.
    pub threshold: f64,
    /// Stiffness `k_i = k sqrt(f_i/f_s)`, in N/m.
    pub stiffness: f64,
    /// Reach `f_i/k_i`, in m: the elongation at which it breaks.
    pub reach: f64,
    /// Delay `t_r` between the breaking of the previous life and the start of this one, in s. Not used by generation 0.
    pub delay: f64,
}

/// The source of all contacts of one job.
#[derive(Clone, Debug)]
pub struct Disorder {
    generator: ChaCha8Rng,
    mean_threshold: f64,
    threshold_deviation: f64,
    mean_stiffness: f64,
    reattachment_time: f64,
    /// [`DRAWS_PER_REFILL`] generations of each contact, drawn side by side, and the first of them.
    buffered: Vec<Draws>,
    buffered_from: Vec<u32>,
}

/// Threshold in N and delay in s of one life.
#[derive(Clone, Copy, Debug, Default)]
struct Draw {
    threshold: f64,
    delay: f64,
}

impl Disorder {
    /// The disorder of a set of parameters.
    pub fn new(parameters: &Parameters) -> Self {
        let contacts = parameters.blocks * parameters.contacts_per_block;
        Self {
            generator: ChaCha8Rng::seed_from_u64(parameters.seed),
            mean_threshold: parameters.mean_threshold,
            threshold_deviation: parameters.threshold_deviation,
            mean_stiffness: parameters.contact_stiffness,
            reattachment_time: parameters.reattachment_time,
            buffered: vec![Draws::default(); contacts],
            buffered_from: vec![u32::MAX; contacts],
        }
    }

    /// The given life of a contact; `contact` counts through all blocks, `block · N_s + i`.
    pub fn draw(&mut self, contact: usize, generation: u32) -> Contact {
        let ahead = generation % DRAWS_PER_REFILL;
        if self.buffered_from[contact] != generation - ahead {
            self.refill(contact, generation - ahead);
        }
        let Draw { threshold, delay } = self.buffered[contact][ahead as usize];
        Contact {
            threshold,
            stiffness: self.mean_stiffness * (threshold / self.mean_threshold).sqrt(),
            reach: (threshold * self.mean_threshold).sqrt() / self.mean_stiffness,
            delay,
        }
    }

    /// Draws the generations of a contact from `first` on. Not inlined in [`Self::draw`], which is called far more
    /// often.
    #[inline(never)]
    fn refill(&mut self, contact: usize, first: u32) {
        self.seek(contact, first, 0);
        let words: [[u64; 2]; DRAWS_PER_REFILL as usize] =
            array::from_fn(|_| array::from_fn(|_| self.generator.next_u64()));
        let mut generation = first;
        let mut draws = Draws::default();
        for (draws, words) in
            draws.as_chunks_mut::<SIDE_BY_SIDE>().0.iter_mut().zip(words.as_chunks::<SIDE_BY_SIDE>().0)
        {
            let quantiles = standard_normal_quantiles(words.map(|[for_threshold, _]| uniform(for_threshold)));
            for ((draw, quantile), [_, for_delay]) in draws.iter_mut().zip(quantiles).zip(words) {
                let threshold = self.threshold(contact, generation, quantile);
                *draw = Draw { threshold, delay: -self.reattachment_time * libm::log(uniform(*for_delay)) };
                generation += 1;
            }
        }
        self.buffered[contact] = draws;
        self.buffered_from[contact] = first;
    }

    /// The threshold for a quantile of its distribution, or for one that is drawn again.
    fn threshold(&mut self, contact: usize, generation: u32, mut quantile: f64) -> f64 {
        let mut redraw = 0;
        loop {
            let threshold = self.mean_threshold + self.threshold_deviation * quantile;
            if threshold > 0.0 {
                return threshold;
            }
            redraw += 1;
            self.seek(contact, generation, redraw);
            [quantile] = standard_normal_quantiles([uniform(self.generator.next_u64())]);
        }
    }

    fn seek(&mut self, contact: usize, generation: u32, redraw: u128) {
        self.generator.set_stream(contact as u64);
        self.generator.set_word_pos(u128::from(generation) * WORDS_PER_DRAW + redraw * REDRAW_STRIDE);
    }
}

/// A uniform deviate in (0, 1) from 64 random bits, never 0 and never 1: the last one would be rounded up to 1.
#[expect(clippy::cast_precision_loss, reason = "53 bits are exact")]
fn uniform(word: u64) -> f64 {
    (((word >> 11) as f64 + 0.5) * UNIFORM_STEP).min(1.0 - UNIFORM_STEP)
}

/// Quantiles of the standard normal distribution, to about 1e-16 (AS 241, PPND16). Most lie in the central part, where
/// all are taken first, side by side.
#[expect(clippy::excessive_precision, reason = "coefficients as published")]
fn standard_normal_quantiles<const COUNT: usize>(probabilities: [f64; COUNT]) -> [f64; COUNT] {
    const CENTRAL_NUMERATOR: [f64; 8] = [
        3.387_132_872_796_366_608_0,
        1.331_416_678_917_843_774_5e2,
        1.971_590_950_306_551_442_7e3,
        1.373_169_376_550_946_112_5e4,
        4.592_195_393_154_987_145_7e4,
        6.726_577_092_700_870_085_3e4,
        3.343_057_558_358_812_810_5e4,
        2.509_080_928_730_122_672_7e3,
    ];
    const CENTRAL_DENOMINATOR: [f64; 8] = [
        1.0,
        4.231_333_070_160_091_125_2e1,
        6.871_870_074_920_579_083_0e2,
        5.394_196_021_424_751_107_7e3,
        2.121_379_430_158_659_586_7e4,
        3.930_789_580_009_271_061_0e4,
        2.872_908_573_572_194_267_4e4,
        5.226_495_278_852_854_561_0e3,
    ];
    let offsets = probabilities.map(|probability| probability - 0.5);
    let central = offsets.map(|offset| 0.180_625 - offset * offset);
    let numerators = polynomials(&CENTRAL_NUMERATOR, central);
    let denominators = polynomials(&CENTRAL_DENOMINATOR, central);
    array::from_fn(|i| {
        if offsets[i].abs() <= 0.425 {
            offsets[i] * (numerators[i] / denominators[i])
        } else {
            outer_quantile(probabilities[i]).copysign(offsets[i])
        }
    })
}

/// Magnitude of a quantile that lies outside the central part.
#[expect(clippy::excessive_precision, reason = "coefficients as published")]
fn outer_quantile(probability: f64) -> f64 {
    const MIDDLE_NUMERATOR: [f64; 8] = [
        1.423_437_110_749_683_577_34,
        4.630_337_846_156_545_295_90,
        5.769_497_221_460_691_405_50,
        3.647_848_324_763_204_605_04,
        1.270_458_252_452_368_382_58,
        2.417_807_251_774_506_117_70e-1,
        2.272_384_498_926_918_458_33e-2,
        7.745_450_142_783_414_076_40e-4,
    ];
    const MIDDLE_DENOMINATOR: [f64; 8] = [
        1.0,
        2.053_191_626_637_758_821_87,
        1.676_384_830_183_803_849_40,
        6.897_673_349_851_000_045_50e-1,
        1.481_039_764_274_800_745_90e-1,
        1.519_866_656_361_645_719_66e-2,
        5.475_938_084_995_344_946_00e-4,
        1.050_750_071_644_416_843_24e-9,
    ];
    const TAIL_NUMERATOR: [f64; 8] = [
        6.657_904_643_501_103_777_20,
        5.463_784_911_164_114_369_90,
        1.784_826_539_917_291_335_80,
        2.965_605_718_285_048_912_30e-1,
        2.653_218_952_657_612_309_30e-2,
        1.242_660_947_388_078_438_60e-3,
        2.711_555_568_743_487_578_15e-5,
        2.010_334_399_292_288_132_65e-7,
    ];
    const TAIL_DENOMINATOR: [f64; 8] = [
        1.0,
        5.998_322_065_558_879_376_90e-1,
        1.369_298_809_227_358_053_10e-1,
        1.487_536_129_085_061_485_25e-2,
        7.868_691_311_456_132_591_00e-4,
        1.846_318_317_510_054_681_80e-5,
        1.421_511_758_316_445_888_70e-7,
        2.044_263_103_389_939_785_64e-15,
    ];
    let ratio = |numerator: &[f64; 8], denominator: &[f64; 8], x: f64| {
        let ([numerator], [denominator]) = (polynomials(numerator, [x]), polynomials(denominator, [x]));
        numerator / denominator
    };
    let depth = (-libm::log(probability.min(1.0 - probability))).sqrt();
    if depth <= 5.0 {
        ratio(&MIDDLE_NUMERATOR, &MIDDLE_DENOMINATOR, depth - 1.6)
    } else {
        ratio(&TAIL_NUMERATOR, &TAIL_DENOMINATOR, depth - 5.0)
    }
}

/// A polynomial at several arguments side by side.
fn polynomials<const COUNT: usize>(coefficients: &[f64; 8], at: [f64; COUNT]) -> [f64; COUNT] {
    coefficients.iter().rev().fold([0.0; COUNT], |sums, c| array::from_fn(|i| sums[i] * at[i] + c))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_the_normal_distribution_are_those_of_its_tables() {
        for (probability, quantile) in [
            (0.5, 0.0),
            (0.25, -0.674_489_750_196_081_7),
            (0.001, -3.090_232_306_167_813_5),
            (1e-20, -9.262_340_089_798_408),
            (0.975, 1.959_963_984_540_054),
        ] {
            let difference: f64 = standard_normal_quantiles([probability])[0] - quantile;
            assert!(difference.abs() <= 4e-15 * (1.0 + quantile.abs()), "{probability}: off by {difference}");
        }
    }

    #[test]
    fn uniform_deviates_reach_neither_end() {
        for word in [0, 1, u64::MAX - 1, u64::MAX] {
            let deviate = uniform(word);
            assert!(
                deviate > 0.0 && deviate < 1.0 && standard_normal_quantiles([deviate])[0].is_finite(),
                "{word}: {deviate}"
            );
        }
    }

    #[test]
    fn draws_are_pinned_to_the_last_bit() {
        // A change here gives every job other contacts: raise RNG_SCHEME.
        let narrow = Parameters::default();
        let redrawn = Parameters { threshold_deviation: 1.37, seed: 3, ..Parameters::default() };
        // The last is redrawn.
        let keys = [(&narrow, 0, 0), (&narrow, 1399, 15), (&narrow, 1399, 16), (&narrow, 7, 17), (&redrawn, 6, 1)];
        let bits = keys.map(|(parameters, contact, generation)| {
            let contact = Disorder::new(parameters).draw(contact, generation);
            [contact.threshold, contact.stiffness, contact.reach, contact.delay].map(f64::to_bits)
        });
        let pinned = [
            [0x3ff5_fb15_6d47_2e54, 0x4153_1994_40f2_868e, 0x3e92_69ce_b9f0_eba8, 0x3f6f_485e_9bb4_2685],
            [0x3ff5_db51_5717_5ca4, 0x4153_0bc2_1e8a_9536, 0x3e92_5c7b_c811_4861, 0x3f72_2c59_16c5_f810],
            [0x3ff5_e885_9bd7_f168, 0x4153_1182_08b2_0361, 0x3e92_6206_c892_ad8d, 0x3f79_b099_f85f_d3b5],
            [0x3ff5_efb6_689f_7db6, 0x4153_14a2_de73_82fa, 0x3e92_650a_d473_cc76, 0x3f7f_04b1_9168_090a],
            [0x400e_db10_6478_2565, 0x4160_0067_0233_0740, 0x3e9e_da49_c2ff_9f19, 0x3f6e_9107_75d1_543c],
        ];
        assert_eq!(bits, pinned);
    }

    #[test]
    fn a_draw_does_not_depend_on_the_order_of_draws() {
        let parameters = Parameters { threshold_deviation: 0.4, seed: 3, ..Parameters::default() };
        let mut forward = Disorder::new(&parameters);
        let mut backward = Disorder::new(&parameters);
        let keys: Vec<(usize, u32)> = (0..60_u32).map(|i| (i as usize * 7 % 1400, i * 13 % 50)).collect();
        let first: Vec<Contact> = keys.iter().map(|&(c, g)| forward.draw(c, g)).collect();
        let mut second: Vec<Contact> = keys.iter().rev().map(|&(c, g)| backward.draw(c, g)).collect();
        second.reverse();
        assert_eq!(first, second);
    }

    #[test]
    fn moments_are_those_of_the_model() {
        let parameters = Parameters { threshold_deviation: 0.1, ..Parameters::default() };
        let mut disorder = Disorder::new(&parameters);
        let draws: Vec<Contact> =
            (0..1400).flat_map(|c| (0..100).map(move |g| (c, g))).map(|(c, g)| disorder.draw(c, g)).collect();
        let count = draws.len() as f64;
        let mean = |of: &dyn Fn(&Contact) -> f64| draws.iter().map(of).sum::<f64>() / count;
        let threshold = mean(&|c| c.threshold);
        let deviation = mean(&|c| (c.threshold - threshold).powi(2)).sqrt();
        // Four standard errors of each estimate.
        assert!((threshold - 1.37).abs() < 4.0 * 0.1 / count.sqrt());
        assert!((deviation - 0.1).abs() < 4.0 * 0.1 / (2.0 * count).sqrt());
        assert!((mean(&|c| c.delay) - 0.005).abs() < 4.0 * 0.005 / count.sqrt());
        let contact = draws[17];
        assert!((contact.stiffness * contact.reach - contact.threshold).abs() < 1e-15 * 4.0);
    }

    #[test]
    fn thresholds_that_are_not_positive_are_drawn_again() {
        let parameters = Parameters { threshold_deviation: 1.37, ..Parameters::default() };
        let mut disorder = Disorder::new(&parameters);
        let smallest = (0..1400).map(|c| disorder.draw(c, 0).threshold).fold(f64::INFINITY, f64::min);
        assert!(smallest > 0.0);
    }
}
