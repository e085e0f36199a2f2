"""Compares two parameter sets of a sweep seed by seed.

    .venv/bin/python scripts/compare_sets.py results/fig2 SET_ID SET_ID

A seed is the same disorder in every set, so what two sets owe to it drops out of their difference, and what is left tells
smaller effects than two separate intervals. Prints the differences, first set minus second, of the mean interval in s, the
locking index and the mean friction in N, each with a 95 % confidence interval. The ids are those of reduced/sets.parquet.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats


class Difference(NamedTuple):
    """A difference, the ends of its confidence interval, and the number of seeds that both sets have."""

    difference: float
    low: float
    high: float
    seeds: int


def sums(rows, column):
    """By seed: number and sum of a column; of "locking_index", sum of exp(2 pi i interval / T)."""
    values = rows[column] if column != "locking_index" else np.exp(2j * np.pi * (rows["interval"] / rows["T"] % 1))
    return values.dropna().groupby(rows["seed"]).agg(["size", "sum"])


def paired(slips_a, slips_b, column, confidence=0.95):
    """Difference a - b of the mean of a column over the seeds that both have, or of their locking index |<exp(2 pi i
    interval / T)>| if the column is "locking_index". Takes rows of the slips table, or of the jobs table for "mean_friction".

    The interval is Student's t for the jackknife over seeds (Efron and Stein, Ann. Stat. 9, 586 (1981)). With as many rows
    for each seed, that of a mean is the paired t-test's. Slips of a seed may be correlated: seeds are the units.
    """
    a, b = (sums(rows, column) for rows in (slips_a, slips_b))
    seeds = a.index.intersection(b.index)
    if len(seeds) < 2:
        raise ValueError(f"{column}: {len(seeds)} seeds are common to both sets; at least 2 are needed: raise `seed` in the sweep file")

    def statistic(of):
        mean = of["sum"] / of["size"]
        return np.abs(mean) if column == "locking_index" else mean

    def without_each(of):
        of = of.loc[seeds]
        return statistic(of.sum()), statistic(of.sum() - of)

    (whole_a, parts_a), (whole_b, parts_b) = without_each(a), without_each(b)
    parts, n = parts_a - parts_b, len(seeds)
    error = np.sqrt((n - 1) * ((parts - parts.mean()) ** 2).mean())
    half = stats.t.ppf(0.5 + confidence / 2, n - 1) * error
    difference = whole_a - whole_b
    return Difference(*map(float, (difference, difference - half, difference + half)), n)


def compare(results, set_a, set_b):
    """Differences by column between two sets of a results folder."""
    tables = {name: pd.read_parquet(Path(results) / "tables" / name) for name in ("slips", "jobs")}
    columns = {"interval": "slips", "locking_index": "slips", "mean_friction": "jobs"}
    found = {}
    for column, name in columns.items():
        rows = [tables[name][tables[name]["set_id"] == set_id] for set_id in (set_a, set_b)]
        if column != "locking_index" or all(some["T"].notna().any() for some in rows):
            found[column] = paired(*rows, column)
    return found


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    for column, found in compare(*sys.argv[1:]).items():
        print(f"{column:14} {found.difference:12.6g}   {found.low:.6g} to {found.high:.6g}   {found.seeds} seeds")
