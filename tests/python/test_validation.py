"""The validation against the paper: its statistics on data whose answer is known, and the document that it wrote."""

import re
import subprocess
import sys
import tomllib

import numpy
import pandas
import pytest
from conftest import ROOT
from validation import beyond, claims, document, friction, intervals, kinematics, phase, scaling

import stickslip as module
from stickslip import statistics

PAGE = ROOT / "docs" / "validation.md"


@pytest.mark.parametrize(
    ("eta", "expected"),
    [(1.1, -3.8447), (1.82, -2.6110), (3.64, -1.7732), (10, -1.0664), (100, -0.34617), (1000, -0.11116)],
)
def test_minimum_phase_solves_eq_2(eta, expected):
    assert kinematics.minimum_phase(eta) == pytest.approx(expected, abs=1e-4)


def test_two_peaks_are_found_where_there_are_two_and_one_where_there_is_one():
    generator = numpy.random.default_rng(3)
    one = pandas.Series(generator.normal(0.107, 0.006, 4000))
    two = pandas.concat([one, pandas.Series(generator.normal(0.166, 0.006, 250))])
    assert [round(mode, 2) for mode in intervals.peaks(one)] == [0.11]
    assert [round(mode, 2) for mode in intervals.peaks(two)] == [0.11, 0.17]


def test_the_envelope_of_phases_above_phi_min_has_its_exponent():
    generator = numpy.random.default_rng(4)
    etas = numpy.geomspace(2, 1000, 20).repeat(400)
    lowest = numpy.array([kinematics.minimum_phase(eta) for eta in etas])
    frame = pandas.DataFrame(
        {"eta": etas, "phase": lowest * (1 - generator.random(etas.size)), "set_id": numpy.arange(etas.size) // 40}
    )
    frame = frame.assign(first=frame["phase"])
    *_, agrees = phase.envelope(frame)
    assert agrees
    for exponent in (-1 / 3, -2 / 3):
        other = frame["phase"] * frame["eta"] ** (exponent + 0.5)
        *_, agrees = phase.envelope(frame.assign(phase=other, first=other))
        assert not agrees, exponent


@pytest.mark.parametrize("eta", [0.3, 0.8, 1.5, 20])
def test_slips_at_random_loads_have_a_uniform_load_phase(eta):
    ranks = numpy.linspace(0.05, 0.95, 19)
    phases = kinematics.random_load_phases(eta, ranks)
    load = phases + eta * numpy.cos(phases)
    assert numpy.diff(load) == pytest.approx(numpy.diff(load).mean(), rel=1e-3)


def test_the_mean_excess_has_the_error_that_sets_have_if_they_err_alike():
    ends = {"resultant_excess": [0.1, 0.2], "resultant_excess_low": [0.0, 0.0], "resultant_excess_high": [0.2, 0.5]}
    assert kinematics.excess_text(pandas.DataFrame(ends), "resultant") == "0.15 (0.00–0.35); 0.00 to 0.50"


class Tables:
    """Results of a sweep: the same slips and sets whatever the directory."""

    def __init__(self, slips, sets):
        self.slips, self.sets = lambda: slips, lambda: sets

    def __call__(self, directory):
        return self


def phases_against(phases_of):
    """The verdict on statement 5 of slips at phases that a function of η and random ranks gives."""
    generator = numpy.random.default_rng(8)
    etas = numpy.geomspace(1.2, 1000, 16)
    slips = pandas.DataFrame({"eta": etas.repeat(400), "set_id": numpy.arange(etas.size * 400) // 10, "tau_r": 5e-3})
    slips["T"] = numpy.where(slips["set_id"] % 2, 0.1, 2e-3)
    slips["phase"] = numpy.concatenate([phases_of(eta, generator.random(400)) for eta in etas])
    slips = slips.assign(T_onset=slips["T"], onset=0.0, nucleation=-1e-9)
    sets = pandas.DataFrame({"eta": 2.0, "V0": [1e-6, 1e-4] * 30, "resultant_length_low": 0.7})
    sets = sets.assign(resultant_excess=0.01, resultant_excess_low=-0.01, resultant_excess_high=0.03)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(phase, "Sweep", Tables(slips, sets))
        return phase.phase(ROOT)


def test_slips_at_random_loads_above_phi_min_meet_the_criteria_of_statement_5():
    assert all(phases_against(kinematics.random_load_phases).agrees)


@pytest.mark.parametrize(
    ("other", "failed"),
    [
        (lambda eta, ranks: kinematics.random_load_phases(eta, ranks) - 0.4, "almost no slip below"),
        (lambda eta, ranks: 0.6 * kinematics.random_load_phases(eta, ranks), "the backbone is"),
        (lambda eta, ranks: -ranks * eta ** (-1 / 3), "φ ∝"),
        (lambda eta, ranks: 0.6 * kinematics.random_load_phases(eta, ranks), "slips appear with"),
        (lambda eta, ranks: kinematics.random_load_phases(eta, ranks) + 0.4, "φ saturates"),
    ],
)
def test_slips_of_another_law_fail_the_criterion(other, failed):
    verdicts = {row["claim: criterion"]: row["agrees"] for row in phases_against(other).checks}
    (agrees,) = (word for claim, word in verdicts.items() if claim.startswith(f"5. {failed}"))
    assert agrees == "**no**"


@pytest.mark.parametrize("length", [0, 0.2])
def test_the_influence_on_load_phases_is_found_though_its_directions_cancel(length):
    generator = numpy.random.default_rng(6)
    seed = numpy.repeat(numpy.arange(16), 30)
    control = pandas.DataFrame({"seed": seed, "Delta": 0.0, "V0": 1e-5, "onset": generator.uniform(0, 1e4, seed.size)})
    sets = [control]
    for number in range(6):
        at_direction = generator.random(seed.size) < length
        phases = numpy.where(at_direction, 2 * numpy.pi * number / 6, generator.uniform(-3.14159, 3.14159, seed.size))
        sets.append(pandas.DataFrame({"seed": seed, "Delta": 1e-6, "V0": 1e-5, "eta": 1e-6, "T": 1 + number / 7, "phase": phases}))
    (found,) = phase.influence(pandas.concat(sets)).values()
    assert found.low <= length <= found.high
    assert (found.low > 0.1) == (length > 0)
    assert found.high < length + 0.15


def test_a_check_is_undecided_where_an_interval_holds_its_limit():
    section = document.Section("title", "source")
    for agrees, word in (((True, True), "yes"), ((False,), "**no**"), ((None,), "undecided"), ((True, None), "in part")):
        section.check("", "criterion", "measured", *agrees)
        assert section.checks[-1]["agrees"] == word
    words = {(True,): "holds", (True, False): "holds in part", (None,): "is undecided", (None, False): "does not hold"}
    for agrees, word in words.items():
        assert document.Section("title", "source", agrees=list(agrees)).summary()["verdict"] == word


def test_phases_under_phi_min_are_those_on_falling_load_of_any_period():
    eta = pandas.Series([20.0] * 5)
    lowest, top = kinematics.load_window(20)
    phases = pandas.Series([lowest - 0.2, lowest + 0.01, top + 0.1, top + 0.2, top + 0.2 - 6 * numpy.pi])
    assert list(kinematics.under_minimum(phases, eta, 0.15)) == [True, False, False, True, True]


def test_start_up_ends_with_the_last_slip_that_differs_from_the_later_ones():
    generator = numpy.random.default_rng(7)
    slips = pandas.DataFrame({"set_id": "a", "slip": numpy.tile(numpy.arange(40), 60)})
    slips = slips.assign(interval=generator.normal(0.11, 0.01, len(slips)), drop=generator.normal(100, 1, len(slips)))
    slips.loc[slips["slip"] == 0, "interval"] = numpy.nan
    slips.loc[slips["slip"] < 4, "interval"] += 0.02
    p = beyond.startup(slips)
    assert list(p.index[p < 0.05]) == [1, 2, 3]
    assert (beyond.startup(slips[slips["slip"] < 20]) == 1).all()


def test_breaks_grow_as_the_contacts_of_the_slider():
    small, large = (scaling.per_slip(20_000, N=blocks, Ns=20, tolerance=1e-3) for blocks in (35, 70))
    assert 1.5 < large["breaks"] / small["breaks"] < 2.5
    assert 20 * 70 < large["breaks"] < 20 * 20 * 70


def test_curves_are_below_a_level_from_their_last_crossing_on():
    assert friction.first_below([(0, 5), (1, -20), (2, 0), (3, -20)], -10) == pytest.approx(2.5)


@pytest.mark.parametrize(
    ("holds", "expected"),
    [("0110101", "2 to 4; 8; 12"), ("1100000", "0 to 2"), ("0000000", "none"), ("1111111", "0 to 12")],
)
def test_stretches_of_periods_leave_out_the_gaps(holds, expected):
    periods = numpy.arange(len(holds)) * 2e-3
    assert beyond.stretches(pandas.Series([held == "1" for held in holds], index=periods)) == expected


@pytest.mark.parametrize("power", [0, -1, -2])
def test_the_slope_of_weakening_is_that_of_what_sets_it(power):
    """Of friction that falls with Δ, 2π f Δ or (2π f)² Δ."""
    frequencies, amplitudes = [29.0, 58.0, 116.0], numpy.geomspace(1e-8, 1e-4, 81)
    grid = pandas.MultiIndex.from_product([frequencies, amplitudes, [1, 2]], names=["frequency", "Delta", "seed"])
    jobs = grid.to_frame(index=False)
    strength = jobs["Delta"] / (2e-6 * (jobs["frequency"] / 58) ** power)
    jobs["mean_friction"] = 286 * (1 - 0.2 * strength.clip(upper=4))
    still = pandas.DataFrame({"frequency": 0.0, "Delta": 0.0, "seed": [1, 2], "mean_friction": 286.0})
    jobs = pandas.concat([still, jobs]).assign(averaged_time=1.0)
    assert claims.slope(jobs) == pytest.approx(power, abs=0.02)
    assert claims.thresholds(jobs)[58.0] == pytest.approx(2e-6, rel=0.01)


def test_a_threshold_that_only_a_velocity_sets_spans_nothing_as_a_velocity(tmp_path):
    amplitudes = {f: statistics.Estimate(1 / f, 0.9 / f, 1.1 / f, units=16) for f in (29.0, 58.0, 116.0)}
    assert claims.draw_thresholds(amplitudes, tmp_path / "drawn.png") == pytest.approx([4, 1, 4])
    assert (tmp_path / "drawn.png").read_bytes().startswith(b"\x89PNG")


def test_missing_results_are_named_with_the_command_that_makes_them(tmp_path):
    command = [sys.executable, "-m", "validation", tmp_path, "--to", tmp_path / "validation.md"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2
    assert "sweeps/fig2.toml" in done.stderr
    assert not (tmp_path / "validation.md").exists()


#: The sweeps whose results the document needs.
SWEEPS = (
    "choices choices-startup correlation drag drag-strong energies fig2 fig3 fig4 friction friction-drives locking-contacts"
    " locking-disorder locking-drive-alone locking-map locking-size locking-staircase locking-stiff-drive stochasticity"
    " tide triggering weakening"
).split()


def short(sweep):
    """The sweep with coarse ranges, half of long lists, and few seeds and slips; pairs of seeds need three."""
    for key, axis in sweep["axes"].items():
        if isinstance(axis, list) and len(axis) > 6:
            sweep["axes"][key] = axis[::2]
        elif "points" in axis:
            axis["points"] = min(axis["points"], 13 if key == "eta" else 6)
    sweep["axes"]["seed"]["count"] = min(sweep["axes"]["seed"]["count"], 3)
    if "slips" in sweep["record"] and "max_time" not in sweep["record"]:
        sweep["record"]["slips"] = min(sweep["record"]["slips"], 6)
    return sweep


def test_every_section_is_written_from_real_tables(stickslip, tmp_path):
    for name in SWEEPS:
        sweep = tomllib.loads((ROOT / "sweeps" / f"{name}.toml").read_text())
        module.run(short(sweep), tmp_path / name, progress=False)
    (tmp_path / "eq1").mkdir()
    early = ("--set", "dfs=0", "--set", "max_time=0.063")
    stickslip("simulate", *early, "--profile", tmp_path / "eq1" / "profile.parquet")
    command = [sys.executable, "-m", "validation", tmp_path, "--to", tmp_path / "validation.md"]
    subprocess.run(command, cwd=ROOT, check=True)
    written, committed = (tmp_path / "validation.md").read_text(), PAGE.read_text()
    assert re.findall(r"^##+ .*", written, re.M) == re.findall(r"^##+ .*", committed, re.M)
    assert not re.findall(r"^[|-] .*\bnan\b.*", written, re.M)


def test_the_document_holds_every_section_and_no_number_is_missing():
    text = PAGE.read_text()
    verdicts, sections = text.split("\n## ", 1)
    for number in range(1, 13):
        assert f"| {number}. " in verdicts
        assert f"- {number}: " in sections
    assert "## Beyond the paper" in text
    assert not re.search(r"\bnan\b|\binf\b", text)
    for picture in re.findall(r"\((\.\./results/[^)]+\.png)\)", text):
        assert (ROOT / "docs" / picture).exists(), picture


def test_each_verdict_is_of_one_kind():
    verdicts = PAGE.read_text().split("\n## ")[0]
    rows = re.findall(r"^\| (\d+)\. [^|]*\| ([^|]*) \|", verdicts, re.M)
    kinds = (r"holds", r"holds in part.*", r"holds for .*", r"holds; .*", r"restates .*")
    assert len(rows) == 12
    for number, verdict in rows:
        assert sum(bool(re.fullmatch(kind, verdict)) for kind in kinds) == 1, f"{number}: {verdict}"


def test_sentences_begin_on_lines_of_their_own_and_long_ones_are_wrapped():
    assert document.paragraph("One.", "Two three.", width=5) == "One.\nTwo\nthree."
    section = document.Section("title", "source")
    section.item("Four.", "word " * 30)
    assert [len(line) for line in section.markdown().splitlines()[-3:]] == [7, 116, 36]
    text = PAGE.read_text()
    assert all(len(line) <= document.WIDTH for line in text.splitlines() if not line.startswith("|"))
