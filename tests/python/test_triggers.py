"""What pulses did, computed again from the slips that the program wrote."""

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import brentq

SWEEP = """
name = "pulses"
[model]
N = 10
Ns = 5
frequency = 58
[axes]
pulse_start = { linear = [0.5, 0.56], points = 20 }
pulse_cycles = [1, 3]
Delta = [1e-15, 1e-6]
seed = { count = 24 }
[record]
time = 0.75
control = true
"""


@pytest.fixture(scope="module")
def tables(stickslip, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pulses")
    (folder / "pulses.toml").write_text(SWEEP)
    stickslip("run", folder / "pulses.toml", "--out", folder / "out")
    stickslip("export", folder / "out", "--out", folder / "csv", "--format", "csv")
    return {name: pd.read_csv(folder / "csv" / f"{name}.csv") for name in ("slips", "sets", "triggers")}


def drive(row, time):
    """How far the driven end has moved at some times, in m."""
    within = (time >= row["pulse_start"]) & (time <= row["pulse_start"] + row["pulse_cycles"] * row["T"])
    lift = row["Delta"] * (1 - np.cos(2 * np.pi * (time - row["pulse_start"]) / row["T"]))
    return row["V0"] * time + np.where(within, lift, 0)


def first_passage(row, time):
    """When the driven end first gets as far as it would at a time without the pulse: where a dense walk sees it."""
    start, level = row["pulse_start"], row["V0"] * time
    walk = np.linspace(start, min(time, start + row["pulse_cycles"] * row["T"]), 20_001)
    beyond = drive(row, walk) >= level
    if not beyond.any():
        return time
    first = int(beyond.argmax())
    return brentq(lambda t: float(drive(row, t)) - level, walk[first - 1], walk[first], xtol=1e-15)


def expected(row, control, run, tau_control, noise):
    """The columns of a row that are not parameters, from the slips of its control and its own."""
    start, end = row["pulse_start"], row["pulse_start"] + row["pulse_cycles"] * row["T"]
    found = dict.fromkeys(
        "control_interval place advance advance_drive next_advance triggered triggered_drive excluded".split(), None
    )
    found |= {"tau_control": tau_control, "noise": noise}
    number = int((control["onset"] <= start).sum())
    if number == len(control):
        return found | {"excluded": "after the last slip"}
    if number == 0:
        return found | {"excluded": "before the first slip"}
    last, free = control.iloc[number - 1], control.iloc[number]
    if start < last["nucleation"] + last["duration"] or free["nucleation"] <= start:
        return found | {"excluded": "within a slip"}
    if number >= len(run):
        return found | {"excluded": "after the last slip"}
    passage, interval = first_passage(row, free["onset"]), free["onset"] - last["onset"]
    next_onset = run["onset"].iloc[number]
    if number + 1 < min(len(run), len(control)):
        found["next_advance"] = control["onset"].iloc[number + 1] - run["onset"].iloc[number + 1]
    return found | {
        "control_interval": interval,
        "place": (start - last["onset"]) / interval,
        "advance": free["onset"] - next_onset,
        "advance_drive": free["onset"] - passage,
        "triggered": bool(next_onset <= end < free["onset"]),
        "triggered_drive": bool(passage <= end < free["onset"]),
    }


def test_every_column_follows_from_the_slips(tables):
    slips, sets, triggers = tables["slips"], tables["sets"], tables["triggers"]
    assert len(triggers) == 20 * 2 * 2 * 24
    control_id = sets.loc[sets["Delta"] == 0, "set_id"].item()
    of_job = dict(list(slips.sort_values("slip").groupby(["set_id", "seed"])))
    tau_control = slips.loc[slips["set_id"] == control_id, "interval"].mean()
    noise = triggers.loc[triggers["Delta"] < 1e-12, "advance"].abs().max()
    parameters = sets.set_index("set_id")
    for _, row in triggers.iterrows():
        of_set = parameters.loc[row["set_id"]]
        for name in ("N", "Ns", "V0", "Delta", "T", "pulse_start", "pulse_cycles", "gamma"):
            assert row[name] == of_set[name], name
        control, run = of_job[control_id, row["seed"]], of_job[row["set_id"], row["seed"]]
        for name, value in expected(row, control, run, tau_control, noise).items():
            if value is None:
                assert pd.isna(row[name]), (name, row)
            elif isinstance(value, float):
                # Means and times in another order; the tangent of a drive that barely gets there.
                assert row[name] == pytest.approx(value, rel=1e-9, abs=1e-9), (name, row)
            else:
                assert row[name] == value, (name, row)
        before = control[control["nucleation"] + control["duration"] < row["pulse_start"] - 1e-3]
        same = ["onset", "nucleation", "duration", "peak_force", "drop", "slip_distance", "size"]
        assert (before[same].to_numpy() == run[same].iloc[: len(before)].to_numpy()).all(), "before the pulse"
    # Each rule was tried: some of the slips that pulses make have their onset just before them.
    seen = triggers[triggers["advance"].notna()]
    next_onset = seen["pulse_start"] + (1 - seen["place"]) * seen["control_interval"] - seen["advance"]
    assert (next_onset < seen["pulse_start"]).any() and seen["triggered"].any() and triggers["excluded"].notna().any()
