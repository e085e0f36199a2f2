"""The validation against the paper: its statistics on data whose answer is known, and the document that it wrote."""

import re
import subprocess
import sys

import numpy
import pandas
import pytest
from conftest import ROOT

from stickslip_analysis.validation import beyond, document, friction, intervals, phase


@pytest.mark.parametrize(
    ("eta", "expected"),
    [(1.1, -3.8447), (1.82, -2.6110), (3.64, -1.7732), (10, -1.0664), (100, -0.34617), (1000, -0.11116)],
)
def test_minimum_phase_solves_eq_2(eta, expected):
    assert phase.minimum_phase(eta) == pytest.approx(expected, abs=1e-4)


def test_two_peaks_are_found_where_there_are_two_and_one_where_there_is_one():
    generator = numpy.random.default_rng(3)
    one = pandas.Series(generator.normal(0.107, 0.006, 4000))
    two = pandas.concat([one, pandas.Series(generator.normal(0.166, 0.006, 250))])
    assert [round(mode, 2) for mode in intervals.peaks(one)] == [0.11]
    assert [round(mode, 2) for mode in intervals.peaks(two)] == [0.11, 0.17]


def test_the_envelope_of_phases_above_phi_min_has_its_exponent():
    generator = numpy.random.default_rng(4)
    etas = numpy.geomspace(2, 1000, 20).repeat(400)
    lowest = numpy.array([phase.minimum_phase(eta) for eta in etas])
    frame = pandas.DataFrame(
        {"eta": etas, "phase": lowest * (1 - generator.random(etas.size)), "set_id": numpy.arange(etas.size) // 40}
    )
    *_, agrees = phase.envelope(frame)
    assert agrees
    *_, agrees = phase.envelope(frame.assign(phase=-(frame["eta"] ** -0.8)))
    assert not agrees


def test_curves_are_below_a_level_from_their_last_crossing_on():
    assert friction.first_below([(0, 5), (1, -20), (2, 0), (3, -20)], -10) == pytest.approx(2.5)


@pytest.mark.parametrize(
    ("holds", "expected"),
    [("0110101", "2 to 4; 8; 12"), ("1100000", "0 to 2"), ("0000000", "none"), ("1111111", "0 to 12")],
)
def test_stretches_of_periods_leave_out_the_gaps(holds, expected):
    periods = numpy.arange(len(holds)) * 2e-3
    assert beyond.stretches(pandas.Series([held == "1" for held in holds], index=periods)) == expected


def test_missing_results_are_named_with_the_command_that_makes_them(tmp_path):
    command = [sys.executable, "-m", "stickslip_analysis.validation", tmp_path, "--to", tmp_path / "validation.md"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2
    assert "sweeps/fig2.toml" in done.stderr
    assert not (tmp_path / "validation.md").exists()


def test_the_document_holds_every_section_and_no_number_is_missing():
    text = (ROOT / "docs" / "validation.md").read_text()
    for number in range(1, 10):
        assert f"### {number}. " in text
    assert "## Beyond the paper" in text
    assert not re.search(r"\bnan\b|\binf\b", text)
    for picture in re.findall(r"\((\.\./results/[^)]+\.png)\)", text):
        assert (ROOT / "docs" / picture).exists(), picture


def test_sentences_begin_on_lines_of_their_own_and_long_ones_are_wrapped():
    assert document.paragraph("One.", "Two three.", width=5) == "One.\nTwo\nthree."
    section = document.Section("title", "source")
    section.item("Four.", "word " * 30)
    assert [len(line) for line in section.markdown().splitlines()[-3:]] == [7, 116, 36]
    text = (ROOT / "docs" / "validation.md").read_text()
    assert all(len(line) <= document.WIDTH for line in text.splitlines() if not line.startswith("|"))
