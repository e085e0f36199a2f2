"""Paired comparisons of two sets, seed by seed."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from conftest import script

compare_sets = script("compare_sets")


def slips(generator, effect, seeds=12, each=20, period=0.01):
    """Slips whose intervals have a part that belongs to the seed, an effect and noise."""
    seed = np.repeat(np.arange(seeds), each)
    own = np.random.default_rng(99).normal(0, 0.01, seeds)[seed]
    interval = 0.11 + own + effect + generator.normal(0, 0.002, seed.size)
    return pd.DataFrame({"seed": seed, "interval": interval, "T": period})


def test_the_difference_of_means_is_that_of_the_paired_t_test():
    generator = np.random.default_rng(1)
    a, b = slips(generator, 0.001), slips(generator, 0)
    found = compare_sets.paired(a, b, "interval")
    means = [rows.groupby("seed")["interval"].mean() for rows in (a, b)]
    test = stats.ttest_rel(*means)
    low, high = test.confidence_interval(0.95)
    # Sums in another order.
    np.testing.assert_allclose(found, (means[0].mean() - means[1].mean(), low, high, 12), rtol=1e-9)
    unpaired = stats.ttest_ind(*means).confidence_interval(0.95)
    assert found.high - found.low < 0.2 * (unpaired.high - unpaired.low), "what belongs to the seed drops out"


def test_only_common_seeds_count():
    generator = np.random.default_rng(2)
    a, b = slips(generator, 0), slips(generator, 0)
    fewer = a[a["seed"] < 7]
    assert compare_sets.paired(fewer, b, "interval") == compare_sets.paired(fewer, b[b["seed"] < 7], "interval")
    with pytest.raises(ValueError, match="1 seeds are common"):
        compare_sets.paired(a[a["seed"] == 0], b, "interval")


@pytest.mark.parametrize("column", ["interval", "locking_index"])
def test_intervals_hold_the_true_difference_in_95_of_100_repetitions(column):
    period, repetitions = 0.01, 300
    # Of Gaussian intervals the locking index is exp(-2 pi^2 sd^2 / T^2).
    spreads = (0.001, 0.0013)
    index = [np.exp(-2 * np.pi**2 * spread**2 / period**2) for spread in spreads]
    truth = {"interval": 0.0005, "locking_index": index[0] - index[1]}[column]
    held = 0
    for repetition in range(repetitions):
        generator = np.random.default_rng(repetition)
        seed = np.repeat(np.arange(16), 20)
        a, b = (
            pd.DataFrame({"seed": seed, "interval": mean + generator.normal(0, spread, seed.size), "T": period})
            for mean, spread in zip((0.1105, 0.11), spreads)
        )
        found = compare_sets.paired(a, b, column)
        held += found.low <= truth <= found.high
    # Standard error 1.3 %.
    assert 0.92 < held / repetitions < 0.98, held / repetitions


def test_sets_of_a_sweep_are_compared_by_their_ids(results):
    sets = pd.read_parquet(results / "reduced" / "sets.parquet").sort_values("Delta", ignore_index=True)
    found = compare_sets.compare(results, sets["set_id"][1], sets["set_id"][0])
    assert set(found) == {"interval", "mean_friction"}, "the locking index needs two modulated sets"
    # As many slips for each seed.
    assert found["interval"].difference == pytest.approx(sets["tau_mean"][1] - sets["tau_mean"][0], rel=1e-9)
    assert found["mean_friction"].difference == pytest.approx(sets["mean_friction"][1] - sets["mean_friction"][0], rel=1e-9)
    assert all(difference.seeds == 5 for difference in found.values())
