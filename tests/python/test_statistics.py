"""Statistics on data whose answer is known, and paired comparisons of two sets."""

import json

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from stickslip import statistics
from stickslip.tables import Sweep


def slips(generator, effect, seeds=12, each=20):
    """Slips whose intervals have a part that belongs to the seed, an effect and noise."""
    seed = np.repeat(np.arange(seeds), each)
    own = np.random.default_rng(99).normal(0, 0.01, seeds)[seed]
    return pd.DataFrame({"seed": seed, "interval": 0.11 + own + effect + generator.normal(0, 0.002, seed.size)})


def covers(estimate, truth):
    return estimate.low <= truth <= estimate.high


def assert_95_percent(covered):
    """The share of intervals that cover the truth is 95 % within three standard errors."""
    assert abs(np.mean(covered) - 0.95) < 3 * np.sqrt(0.95 * 0.05 / len(covered)), np.mean(covered)


@pytest.mark.parametrize("flag", [False, True])
def test_the_interval_of_a_share_is_open_within_0_and_1_where_all_rows_agree(flag):
    found = statistics.share(pd.Series([flag] * 105), pd.RangeIndex(105))
    ends = stats.binomtest(105 * flag, 105).proportion_ci(0.95)
    # The exact interval, which Wilson's nearly is.
    assert [found.low, found.high] == pytest.approx([ends.low, ends.high], abs=0.002)


def test_intervals_of_shares_take_in_that_rows_of_a_unit_agree():
    generator = np.random.default_rng(5)
    unit = pd.Series(np.repeat(np.arange(24), 10))
    draws = (generator.random(unit.size) < np.repeat(generator.beta(1, 4, 24), 10) for _ in range(300))
    found = [statistics.share(pd.Series(flags), unit) for flags in draws]
    assert all(0 <= one.low < one.high <= 1 for one in found)
    assert_95_percent([covers(one, 0.2) for one in found])


def test_an_estimate_lies_between_limits_if_its_interval_does_and_is_undecided_if_that_holds_one():
    one = statistics.Estimate(0.5, 0.4, 0.6, 9)
    assert [one.lies(above=limit) for limit in (0.3, 0.5, 0.7)] == [True, None, False]
    assert [one.lies(below=limit) for limit in (0.3, 0.5, 0.7)] == [False, None, True]
    assert [one.lies(above=0.3, below=limit) for limit in (0.35, 0.5, 0.7)] == [False, None, True]


def test_the_root_of_a_square_that_is_negative_by_chance_keeps_its_error():
    root = statistics.Estimate(-0.01, -0.05, 0.03, 9).root()
    assert [root.value, root.low, root.high] == pytest.approx([0, 0, 0.2])


def test_the_difference_of_means_is_that_of_the_paired_t_test():
    generator = np.random.default_rng(1)
    a, b = slips(generator, 0.001), slips(generator, 0)
    found = statistics.difference(a, b, "interval")
    means = [rows.groupby("seed")["interval"].mean() for rows in (a, b)]
    low, high = stats.ttest_rel(*means).confidence_interval(0.95)
    # Sums in another order.
    assert [found.value, found.low, found.high] == pytest.approx(
        [means[0].mean() - means[1].mean(), low, high], rel=1e-9
    )
    assert found.units == 12
    unpaired = stats.ttest_ind(*means).confidence_interval(0.95)
    assert found.high - found.low < 0.2 * (unpaired.high - unpaired.low), "what belongs to the seed drops out"


def test_only_common_seeds_count():
    generator = np.random.default_rng(2)
    a, b = slips(generator, 0), slips(generator, 0)
    fewer = a[a["seed"] < 7]
    assert statistics.difference(fewer, b, "interval") == statistics.difference(fewer, b[b["seed"] < 7], "interval")
    with pytest.raises(ValueError, match="1 values of seed are common"):
        statistics.difference(a[a["seed"] == 0], b, "interval")


@pytest.mark.parametrize("statistic", [pd.Series.mean, statistics.locking_index])
def test_intervals_of_differences_cover_the_truth_as_often_as_they_claim(statistic):
    # Of Gaussian periods the locking index is exp(-2 pi^2 sd^2).
    means, spreads = (11.05, 11), (0.1, 0.13)
    truths = means if statistic is pd.Series.mean else np.exp(-2 * np.pi**2 * np.square(spreads))
    seed = np.repeat(np.arange(16), 20)

    def covered(repetition):
        generator = np.random.default_rng(repetition)
        sets = [
            pd.DataFrame({"seed": seed, "periods": generator.normal(mean, spread, seed.size)})
            for mean, spread in zip(means, spreads)
        ]
        return covers(statistics.difference(*sets, "periods", statistic), truths[0] - truths[1])

    assert_95_percent([covered(repetition) for repetition in range(300)])


def test_jackknife_intervals_cover_the_truth_as_often_as_they_claim():
    """Slips share an offset of their seed: an interval that took slips as independent would cover half as often."""
    generator = np.random.default_rng(1)
    seed = np.arange(8).repeat(30)

    def covered():
        x = 5 + generator.normal(size=8)[seed] + generator.normal(size=seed.size)
        return covers(statistics.jackknife(lambda rows: rows["x"].mean(), pd.DataFrame({"seed": seed, "x": x})), 5)

    assert_95_percent([covered() for _ in range(400)])


def test_the_locking_index_of_a_set_is_that_of_its_slips(results):
    sweep = Sweep(results)
    reduced = sweep.reduced("sets").set_index("set_id")["locking_index"].dropna()
    found = sweep.slips().dropna(subset="periods").groupby("set_id")["tau_over_T"].apply(statistics.locking_index)
    assert len(reduced) == 1
    # The same sums in another order.
    pd.testing.assert_series_equal(found, reduced, rtol=1e-12, check_names=False)


def test_the_jackknife_is_that_of_the_reduction(stickslip, tmp_path):
    """Friction has a value a job: nothing of it is unseen, and it has no ends."""
    directories = []
    for name, stiffness in (("a", 4e7), ("b", 3e7)):
        sweep, directory = tmp_path / f"{name}.toml", tmp_path / name
        sweep.write_text(
            f'name = "{name}"\n[model]\nN = 5\nKd = {stiffness}\n[axes]\nseed = {{ count = 9 }}\n[record]\nslips = 6\n'
        )
        stickslip("run", sweep, "--out", directory)
        directories.append(directory)
    jobs = [Sweep(directory).table("jobs") for directory in directories]
    reduced = Sweep(directories[0]).sets().iloc[0]
    found = statistics.jackknife(statistics.over_time, jobs[0])
    assert [found.value, found.low, found.high] == pytest.approx(
        [reduced["mean_friction"], reduced["mean_friction_low"], reduced["mean_friction_high"]], rel=1e-9
    )
    (row,) = json.loads(stickslip("show", *directories, "--json").stdout)["sets"]
    found = statistics.friction_difference(jobs[1], jobs[0])
    ends = [row[f"mean_friction_difference{end}"] for end in ("", "_low", "_high")]
    assert [found.value, found.low, found.high] == pytest.approx(ends, rel=1e-6)
