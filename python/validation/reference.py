"""Reference results for other codes, in tests/reference: ``python -m validation.reference``; docs/other-programs.md.

    make                     computes them, with Taylor steps; takes ten minutes
    entry SOLVER FOLDER      the same tables by a solver of this program, with few and other seeds
    compare FOLDER           holds the tables of a code against them; ends with 1 if they differ
"""

import argparse
import sys
import tempfile
from pathlib import Path

import pandas

import stickslip

HERE = Path(__file__).parents[2] / "tests" / "reference"
SOLVERS = {
    "grid": {"method": "event-driven", "resolve": "grid"},
    "taylor": {"method": "event-driven", "resolve": "taylor", "tolerance": 1e-6},
    "fixed-step": {"method": "fixed-step", "dt": 1e-6},
}
#: A slider of 20 contacts, of which every event is told.
SMALL = {"N": 5, "Ns": 4, "Delta": 1e-6, "frequency": 58, "max_time": 0.1}
#: The sets of Fig. 2d to 2f, and five points of Fig. 3 at V0 = 1e-4 m/s and Δ = 1 µm.
AXES = {
    "fig2": {"zip": [{"dfs": [6.9e-3, 0, 6.9e-3, 6.9e-3], "Delta": [0, 0, 1e-6, 1e-6], "frequency": [29, 29, 29, 58]}]},
    "fig3": {"Delta": [1e-6], "eta": [0.6, 1.2, 2.4, 4.8, 9.6]},
}
STATISTICS = {"fig2": ["tau_mean", "tau_50", "tau_sd"], "fig3": ["tau_mean", "resultant_length", "phase_mean"]}
SEEDS = 400
FEW_SEEDS = 24
PARAMETERS = ["V0", "Delta", "frequency", "dfs"]
EVENT = ["block", "contact", "generation", "event"]
#: Standard errors within which all 27 differences lie in 95 of 100 comparisons: 0.05 / 27 of a normal distribution.
LARGEST = 3.1


def contacts(**solver: str | float) -> pandas.DataFrame:
    """Every contact event of the small slider."""
    return stickslip.simulate(**SMALL, **solver, contacts=True).contacts().to_pandas()


def statistics(seeds: range, **solver: str | float) -> pandas.DataFrame:
    """One row for each statistic of each set, with its 95 % interval."""
    rows = []
    for figure, axes in AXES.items():
        sweep = {"name": figure, "axes": axes | {"seed": list(seeds)}, "record": {"slips": 30}, "solver": solver}
        with tempfile.TemporaryDirectory() as folder:
            sets = stickslip.run(sweep, folder, progress=False, reduce=False).sets().to_pandas()
        for statistic in STATISTICS[figure]:
            columns = {statistic: "value", f"{statistic}_low": "low", f"{statistic}_high": "high"}
            found = sets[[*PARAMETERS, *columns]].rename(columns=columns)
            rows.append(found.assign(figure=figure, statistic=statistic))
    return pandas.concat(rows)[["figure", *PARAMETERS, "statistic", "value", "low", "high"]]


def write(folder: Path, contacts: pandas.DataFrame, statistics: pandas.DataFrame) -> None:
    """The two tables of a code."""
    folder.mkdir(parents=True, exist_ok=True)
    contacts.to_csv(folder / "contacts.csv", index=False)
    statistics.to_csv(folder / "statistics.csv", index=False, float_format="%.7g")


def both(folder: Path, table: str, keys: list[str]) -> tuple[pandas.DataFrame, int]:
    """The rows that the reference and a code have, and how many the reference has."""
    own, theirs = (pandas.read_csv(at / f"{table}.csv") for at in (HERE, folder))
    return own.merge(theirs, on=keys, suffixes=("", "_theirs")), len(own)


def compare(folder: Path) -> bool:
    """Says how far the tables of a code are from the reference, and whether all statistics are there and agree."""
    events, count = both(folder, "contacts", EVENT)
    error = (events["time_theirs"] - events["time"]).abs()
    print(f"contacts: {len(events)} of {count} events, off by {error.median():.1e} s (median), {error.max():.1e} s (most)")
    sets, count = both(folder, "statistics", ["figure", *PARAMETERS, "statistic"])
    width = {end: sets[f"high{end}"] - sets[f"low{end}"] for end in ("", "_theirs")}
    error = (width[""] ** 2 + width["_theirs"] ** 2) ** 0.5 / (2 * 1.96)
    sets["off"] = (sets["value_theirs"] - sets["value"]) / error
    most = sets.loc[sets["off"].abs().idxmax()]
    where = ", ".join(f"{key} = {most[key]:.4g}" for key in PARAMETERS if pandas.notna(most[key]))
    print(
        f"statistics: {len(sets)} of {count}, off by {most['off']:+.1f} standard errors at most: {most['statistic']} of "
        f"{most['figure']} at {where} is {most['value_theirs']:.5g}, not {most['value']:.5g}"
    )
    return len(sets) == count and abs(most["off"]) <= LARGEST


def main() -> int:
    """Computes, or compares."""
    parser = argparse.ArgumentParser("validation.reference", description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("what", nargs="+", metavar="COMMAND")
    match parser.parse_args().what:
        case ["make"]:
            exact = SOLVERS["taylor"] | {"tolerance": 1e-12}
            write(HERE, contacts(**exact), statistics(range(SEEDS), **SOLVERS["taylor"]))
        case ["entry", solver, folder] if solver in SOLVERS:
            seeds = range(SEEDS, SEEDS + FEW_SEEDS)
            write(Path(folder), contacts(**SOLVERS[solver]), statistics(seeds, **SOLVERS[solver]))
        case ["compare", folder]:
            return int(not compare(Path(folder)))
        case _:
            parser.error("must be make, entry grid|taylor|fixed-step FOLDER, or compare FOLDER")
    return 0


if __name__ == "__main__":
    sys.exit(main())
