//! Keyed disorder: threshold, stiffness and delay of every contact, as a function of (seed, contact, generation) alone.
//!
//! Method: `ChaCha8`; the key is the seed, the stream is the contact's index, the word position is [`WORDS_PER_DRAW`] ×
//! generation. A threshold that is not positive is drawn again [`REDRAW_STRIDE`] words further on, so that no draw
//! depends on another. Normal deviates come from the inverse of the normal distribution (M. J. Wichura, algorithm AS
//! 241, Appl. Statist. 37, 477, 1988), exponential ones from a logarithm, both without branches, so that loops over
//! them run in vectors; nothing is fused, so all processors give the same bits. Contract: the mapping is pinned by
//! known-answer tests; changing it changes [`RNG_SCHEME`].

use super::Parameters;
use pulp::{Arch, Simd, WithSimd, bytemuck};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Name and version of the mapping from (seed, contact, generation) to a contact; written into every result.
pub const RNG_SCHEME: &str = "chacha8-seed-contact-generation-v1";

/// 32-bit words that one draw takes from its stream: two uniform deviates of 64 bits. A third deviate needs words
/// beyond those of all redraws, or another `RNG_SCHEME`: a wider draw would change every contact.
const WORDS_PER_DRAW: u128 = 4;
/// Generations in one refill. More would take memory and no less time.
const DRAWS_PER_REFILL: u32 = 4;
type Draws = [Draw; DRAWS_PER_REFILL as usize];
/// Distance of the words of a redrawn threshold: beyond those of any generation.
const REDRAW_STRIDE: u128 = 1 << 40;
/// Uniform deviates lie in (0, 1): 53 random bits, shifted by half a step.
const UNIFORM_STEP: f64 = 1.0 / 9_007_199_254_740_992.0;

/// One life of a contact, as drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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
    contact_stiffness: f64,
    reattachment_time: f64,
    /// The features for which the loop over draws is compiled.
    features: Arch,
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
    pub fn new(parameters: &Parameters) -> Self {
        let contacts = parameters.blocks * parameters.contacts_per_block;
        Self {
            generator: ChaCha8Rng::seed_from_u64(parameters.seed),
            mean_threshold: parameters.mean_threshold,
            threshold_deviation: parameters.threshold_deviation,
            contact_stiffness: parameters.contact_stiffness,
            reattachment_time: parameters.reattachment_time,
            features: Arch::new(),
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
        let draw = self.buffered[contact][ahead as usize];
        let mut threshold = draw.threshold;
        if threshold.is_nan() || threshold <= 0.0 {
            threshold = self.final_threshold(contact, generation);
        }
        Contact {
            threshold,
            stiffness: self.contact_stiffness * (threshold / self.mean_threshold).sqrt(),
            reach: (threshold * self.mean_threshold).sqrt() / self.contact_stiffness,
            delay: draw.delay,
        }
    }

    /// Draws the generations of a contact from `first` on. Not inlined in [`Self::draw`], which is called far more
    /// often.
    #[inline(never)]
    fn refill(&mut self, contact: usize, first: u32) {
        self.seek(contact, first, 0);
        let mut words = [[0; 2]; DRAWS_PER_REFILL as usize];
        self.generator
            .fill_bytes(bytemuck::bytes_of_mut(&mut words));
        self.buffered[contact] = self.features.dispatch(SideBySide(self, &words));
        self.buffered_from[contact] = first;
    }

    /// The first threshold of a life that is positive, also in the tails.
    #[cold]
    fn final_threshold(&mut self, contact: usize, generation: u32) -> f64 {
        let mut redraw = 0;
        loop {
            self.seek(contact, generation, redraw);
            let quantile = standard_normal_quantile(uniform(self.generator.next_u64()));
            let threshold = self.threshold(quantile);
            if threshold > 0.0 {
                return threshold;
            }
            redraw += 1;
        }
    }

    #[inline(always)]
    fn threshold(&self, quantile: f64) -> f64 {
        self.mean_threshold + self.threshold_deviation * quantile
    }

    fn seek(&mut self, contact: usize, generation: u32, redraw: u128) {
        // From within a block, a change of stream would compute that block of the new one.
        self.generator.set_word_pos(0);
        self.generator.set_stream(contact as u64);
        self.generator
            .set_word_pos(u128::from(generation) * WORDS_PER_DRAW + redraw * REDRAW_STRIDE);
    }
}

/// [`DRAWS_PER_REFILL`] draws at once, each from two words: one for its threshold, one for its delay. A threshold that is
/// not positive, or not a number, is not final.
struct SideBySide<'a>(&'a Disorder, &'a [[u64; 2]; DRAWS_PER_REFILL as usize]);

impl WithSimd for SideBySide<'_> {
    type Output = Draws;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Draws {
        let Self(disorder, words) = self;
        let mut draws = Draws::default();
        for i in 0..draws.len() {
            let [for_threshold, for_delay] = words[i].map(|word| uniform(u64::from_le(word)));
            draws[i] = Draw {
                threshold: disorder.threshold(quantile_outside_tails(for_threshold)),
                delay: -disorder.reattachment_time * logarithm(for_delay),
            };
        }
        draws
    }
}

/// A uniform deviate in (0, 1) from 64 random bits, never 0 and never 1: the last one would be rounded up to 1.
#[inline(always)]
#[expect(clippy::cast_precision_loss, reason = "53 bits are exact")]
fn uniform(word: u64) -> f64 {
    (((word >> 11) as f64 + 0.5) * UNIFORM_STEP).min(1.0 - UNIFORM_STEP)
}

/// `libm::log` of a positive normal number, to the last bit: its algorithm (FreeBSD's `e_log.c`) without branches.
#[inline(always)]
fn logarithm(x: f64) -> f64 {
    const EVEN: [f64; 3] = [
        0.399_999_999_994_094_2,
        0.222_221_984_321_497_84,
        0.153_138_376_992_093_73,
    ];
    const ODD: [f64; 4] = [
        0.666_666_666_666_673_5,
        0.285_714_287_436_623_9,
        0.181_835_721_616_180_5,
        0.147_981_986_051_165_86,
    ];
    const LN_2: [f64; 2] = [0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10];
    const ROOT_OF_HALF: u64 = 0x3fe6_a09e << 32;
    // x = (1 + f) 2^exponent, where 1 + f goes from sqrt(1/2), but for its lower bits, to its double.
    let scaled = x.to_bits() + (1_f64.to_bits() - ROOT_OF_HALF);
    let exponent = f64::from((scaled >> 52) as i32 - 1023);
    let f = f64::from_bits((scaled & ((1 << 52) - 1)) + ROOT_OF_HALF) - 1.0;
    let half_square = 0.5 * f * f;
    let s = f / (2.0 + f);
    let z = s * s;
    let w = z * z;
    let series = z * polynomial(&ODD, w) + w * polynomial(&EVEN, w);
    s * (half_square + series) + exponent * LN_2[1] - half_square + f + exponent * LN_2[0]
}

/// A quantile of the standard normal distribution, to about 1e-16 (AS 241, PPND16); not a number in its tails.
#[inline(always)]
#[expect(clippy::excessive_precision, reason = "coefficients as published")]
fn quantile_outside_tails(probability: f64) -> f64 {
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
    let offset = probability - 0.5;
    let central = offset
        * ratio(
            &CENTRAL_NUMERATOR,
            &CENTRAL_DENOMINATOR,
            0.180_625 - offset * offset,
        );
    let depth = depth(probability);
    let middle = ratio(&MIDDLE_NUMERATOR, &MIDDLE_DENOMINATOR, depth - 1.6).copysign(offset);
    let outer = if depth <= 5.0 { middle } else { f64::NAN };
    if offset.abs() <= 0.425 {
        central
    } else {
        outer
    }
}

/// A quantile of the standard normal distribution, also in the tails.
#[expect(clippy::excessive_precision, reason = "coefficients as published")]
pub fn standard_normal_quantile(probability: f64) -> f64 {
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
    let quantile = quantile_outside_tails(probability);
    if quantile.is_nan() {
        ratio(&TAIL_NUMERATOR, &TAIL_DENOMINATOR, depth(probability) - 5.0)
            .copysign(probability - 0.5)
    } else {
        quantile
    }
}

/// r of AS 241, how far into a tail a probability is.
#[inline(always)]
fn depth(probability: f64) -> f64 {
    (-logarithm(probability.min(1.0 - probability))).sqrt()
}

#[inline(always)]
fn ratio(numerator: &[f64; 8], denominator: &[f64; 8], at: f64) -> f64 {
    polynomial(numerator, at) / polynomial(denominator, at)
}

#[inline(always)]
fn polynomial<const COUNT: usize>(coefficients: &[f64; COUNT], at: f64) -> f64 {
    coefficients[..COUNT - 1]
        .iter()
        .rev()
        .fold(coefficients[COUNT - 1], |sum, c| sum * at + c)
}

#[cfg(test)]
mod tests {
    use super::*;
    #[cfg(target_arch = "x86_64")]
    use pulp::x86::{V3, V4};

    #[test]
    fn quantiles_of_the_normal_distribution_are_those_of_its_tables() {
        for (probability, quantile) in [
            (0.5, 0.0),
            (0.25, -0.674_489_750_196_081_7),
            (0.001, -3.090_232_306_167_813_5),
            (1e-20, -9.262_340_089_798_408),
            (0.975, 1.959_963_984_540_054),
        ] {
            let difference: f64 = standard_normal_quantile(probability) - quantile;
            assert!(
                difference.abs() <= 4e-15 * (1.0 + quantile.abs()),
                "{probability}: off by {difference}"
            );
        }
    }

    #[test]
    fn uniform_deviates_reach_neither_end() {
        for word in [0, 1, u64::MAX - 1, u64::MAX] {
            let deviate = uniform(word);
            assert!(
                deviate > 0.0 && deviate < 1.0 && standard_normal_quantile(deviate).is_finite(),
                "{word}: {deviate}"
            );
        }
    }

    #[test]
    fn draws_are_pinned_to_the_last_bit() {
        // A change here gives every job other contacts: raise RNG_SCHEME.
        let narrow = Parameters::default();
        let redrawn = Parameters {
            threshold_deviation: 1.37,
            seed: 3,
            ..Parameters::default()
        };
        // The last is redrawn.
        let keys = [
            (&narrow, 0, 0),
            (&narrow, 1399, 15),
            (&narrow, 1399, 16),
            (&narrow, 7, 17),
            (&redrawn, 6, 1),
        ];
        let bits = keys.map(|(parameters, contact, generation)| {
            let contact = Disorder::new(parameters).draw(contact, generation);
            [
                contact.threshold,
                contact.stiffness,
                contact.reach,
                contact.delay,
            ]
            .map(f64::to_bits)
        });
        let pinned = [
            [
                0x3ff5_fb15_6d47_2e54,
                0x4153_1994_40f2_868e,
                0x3e92_69ce_b9f0_eba8,
                0x3f6f_485e_9bb4_2685,
            ],
            [
                0x3ff5_db51_5717_5ca4,
                0x4153_0bc2_1e8a_9536,
                0x3e92_5c7b_c811_4861,
                0x3f72_2c59_16c5_f810,
            ],
            [
                0x3ff5_e885_9bd7_f168,
                0x4153_1182_08b2_0361,
                0x3e92_6206_c892_ad8d,
                0x3f79_b099_f85f_d3b5,
            ],
            [
                0x3ff5_efb6_689f_7db6,
                0x4153_14a2_de73_82fa,
                0x3e92_650a_d473_cc76,
                0x3f7f_04b1_9168_090a,
            ],
            [
                0x400e_db10_6478_2565,
                0x4160_0067_0233_0740,
                0x3e9e_da49_c2ff_9f19,
                0x3f6e_9107_75d1_543c,
            ],
        ];
        assert_eq!(bits, pinned);
    }

    /// The life of a contact from its definition: one number after the other, with branches.
    fn draw_alone(parameters: &Parameters, contact: usize, generation: u32) -> [u64; 2] {
        let mut generator = ChaCha8Rng::seed_from_u64(parameters.seed);
        generator.set_stream(contact as u64);
        let mut uniform_at = |position: u128| {
            generator.set_word_pos(u128::from(generation) * 4 + position);
            uniform(generator.next_u64())
        };
        let threshold = (0..100)
            .map(|redraw| standard_normal_quantile(uniform_at(redraw << 40)))
            .map(|quantile| parameters.mean_threshold + parameters.threshold_deviation * quantile)
            .find(|threshold| *threshold > 0.0);
        let delay = -parameters.reattachment_time * libm::log(uniform_at(2));
        [threshold.unwrap(), delay].map(f64::to_bits)
    }

    #[test]
    fn draws_side_by_side_are_those_of_each_alone_on_every_processor() {
        #[cfg(target_arch = "x86_64")]
        let more = [V3::try_new().map(Arch::V3), V4::try_new().map(Arch::V4)]
            .into_iter()
            .flatten();
        #[cfg(not(target_arch = "x86_64"))]
        let more = [Arch::new()];
        let f_s = Parameters::default().mean_threshold;
        for features in [Arch::Scalar].into_iter().chain(more) {
            for threshold_deviation in [
                Parameters::default().threshold_deviation,
                0.4 * f_s,
                f_s,
                1.37 * f_s,
            ] {
                let parameters = Parameters {
                    threshold_deviation,
                    seed: 5,
                    ..Parameters::default()
                };
                let mut disorder = Disorder {
                    features,
                    ..Disorder::new(&parameters)
                };
                for (contact, generation) in
                    (0..1400).flat_map(|contact| [0, 1, 17, 40].map(|g| (contact, g)))
                {
                    let Contact {
                        threshold, delay, ..
                    } = disorder.draw(contact, generation);
                    assert_eq!(
                        [threshold, delay].map(f64::to_bits),
                        draw_alone(&parameters, contact, generation),
                        "{features:?}: deviation {threshold_deviation}, contact {contact}, generation {generation}"
                    );
                }
            }
            // The ends of each part of the distribution, which no draw may meet.
            let words = [
                0,
                1 << 11,
                1 << 16,
                1 << 27,
                0x1333_3333_3333_3000,
                1 << 62,
                (1 << 63) - 1,
                1 << 63,
            ];
            let words = words.map(|word: u64| [word, !word]);
            let disorder = Disorder::new(&Parameters::default());
            let (refills, _) = words.as_flattened().as_chunks();
            let draws = refills.iter().flat_map(|refill| {
                let words = refill.map(|word: u64| [word.to_le(); 2]);
                let draws = features.dispatch(SideBySide(&disorder, &words));
                refill.iter().copied().zip(draws)
            });
            for (word, Draw { threshold, delay }) in draws {
                let alone = disorder.threshold(standard_normal_quantile(uniform(word)));
                let in_tail = depth(uniform(word)) > 5.0;
                assert!(
                    if in_tail {
                        threshold.is_nan()
                    } else {
                        threshold == alone
                    },
                    "{features:?}, {word}: {threshold}"
                );
                assert_eq!(
                    delay,
                    -disorder.reattachment_time * libm::log(uniform(word)),
                    "{features:?}, {word}"
                );
            }
        }
    }

    #[test]
    fn the_logarithm_is_that_of_libm() {
        let mut generator = ChaCha8Rng::seed_from_u64(0);
        let drawn = (0..300_000)
            .map(|_| generator.next_u64())
            .flat_map(|word| [word, word >> (word % 53)]);
        let drawn = drawn.map(uniform).flat_map(|x| [x, x.min(1.0 - x)]);
        // Around powers of two and where the exponent changes: by single bits of the lower half too.
        let ends = (0..54).flat_map(|k| {
            [1.0, 0.5_f64.sqrt(), f64::from_bits(0x3fe6_a09e << 32)]
                .map(|x| x * 0.5_f64.powi(k))
                .into_iter()
        });
        let ends =
            ends.flat_map(|x| (0..4000).map(move |ulp| f64::from_bits(x.to_bits() + 2000 - ulp)));
        for x in drawn
            .chain(ends)
            .chain([UNIFORM_STEP / 2.0, 1.0 - UNIFORM_STEP, 0.5])
        {
            assert_eq!(logarithm(x).to_bits(), libm::log(x).to_bits(), "{x:e}");
        }
    }

    #[test]
    fn a_draw_does_not_depend_on_the_order_of_draws() {
        let parameters = Parameters {
            threshold_deviation: 0.4,
            seed: 3,
            ..Parameters::default()
        };
        let mut forward = Disorder::new(&parameters);
        let mut backward = Disorder::new(&parameters);
        let keys: Vec<(usize, u32)> = (0..60_u32)
            .map(|i| (i as usize * 7 % 1400, i * 13 % 50))
            .collect();
        let first: Vec<Contact> = keys.iter().map(|&(c, g)| forward.draw(c, g)).collect();
        let mut second: Vec<Contact> = keys
            .iter()
            .rev()
            .map(|&(c, g)| backward.draw(c, g))
            .collect();
        second.reverse();
        assert_eq!(first, second);
    }

    #[test]
    fn moments_are_those_of_the_model() {
        let parameters = Parameters {
            threshold_deviation: 0.1,
            ..Parameters::default()
        };
        let mut disorder = Disorder::new(&parameters);
        let draws: Vec<Contact> = (0..1400)
            .flat_map(|c| (0..100).map(move |g| (c, g)))
            .map(|(c, g)| disorder.draw(c, g))
            .collect();
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
        let parameters = Parameters {
            threshold_deviation: 1.37,
            ..Parameters::default()
        };
        let mut disorder = Disorder::new(&parameters);
        let smallest = (0..1400)
            .map(|c| disorder.draw(c, 0).threshold)
            .fold(f64::INFINITY, f64::min);
        assert!(smallest > 0.0);
    }
}
