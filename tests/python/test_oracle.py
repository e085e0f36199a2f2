"""The independent integrators on contact logs of the program: a good log passes, and each kind of error is found."""

import json
import subprocess
import sys

import pyarrow.compute as compute
import pyarrow.parquet as parquet
import pytest


@pytest.fixture(scope="module")
def log(stickslip, tmp_path_factory):
    """The contact log of a small slider under modulation, ended early."""
    file = tmp_path_factory.mktemp("oracle") / "log.parquet"
    flags = ("--set", "N=9", "--set", "Delta=1e-6", "--set", "frequency=58")
    stickslip("simulate", *flags, "--time", 0.05, "--set", "tolerance=1e-10", "--contacts", file)
    return file


def run(module, *arguments):
    command = [sys.executable, "-m", module, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


def changed(log, change, metadata=None):
    """A copy of a log with other rows, with the same footer unless another is given."""
    table = parquet.read_table(log)
    footer = parquet.read_metadata(log).metadata if metadata is None else metadata
    copy = log.with_name("changed.parquet")
    parquet.write_table(change(table).replace_schema_metadata({b"parameters": footer.get(b"parameters", b"{}")}), copy)
    return copy


def test_the_oracle_and_scipy_confirm_a_log(log):
    replay = run("oracle", log)
    found = json.loads(replay.stdout)
    assert replay.returncode == 0 and found["within_limits"], replay.stdout
    assert found["breaks"] > 100 and found["reattachments"] > 0
    # The tolerance of the run, 1e-10 f_s/k, and some rounding; times as the drive's velocity makes of it.
    assert found["worst_residual"] < 1e-9 and found["worst_time_error"] < 1e-11
    assert found["missed"] == found["unreached"] == []
    check = run("oracle.scipy_check", log, "--breaks", 5)
    assert check.returncode == 0, check.stdout + check.stderr


def test_the_oracle_confirms_a_pulse(stickslip, tmp_path):
    file = tmp_path / "pulse.parquet"
    flags = ("--set", "N=9", "--set", "Delta=1e-6", "--set", "frequency=58", "--set", "pulse_start=0.02")
    stickslip("simulate", *flags, "--set", "pulse_cycles=2", "--time", 0.07, "--set", "tolerance=1e-10", "--contacts", file)
    found = json.loads(run("oracle", file).stdout)
    assert found["within_limits"] and found["breaks"] > 100
    assert found["worst_residual"] < 1e-9 and found["worst_time_error"] < 1e-11
    # It is the pulse that it follows.
    assert run("oracle", file, "--pulse-start", 0.0201).returncode == 1


def test_a_break_that_the_log_leaves_out_is_missed(log):
    def without_first_break(table):
        row = compute.index(table["event"], "break").as_py()
        is_same = compute.and_(*(compute.equal(table[name], table[name][row]) for name in ("block", "contact")))
        is_later = compute.greater_equal(table["time"], table["time"][row])
        return table.filter(compute.invert(compute.and_(is_same, is_later)))

    found = run("oracle", changed(log, without_first_break), "--breaks", 20)
    assert found.returncode == 1, found.stderr
    assert len(json.loads(found.stdout)["missed"]) == 1


def test_the_wrong_drive_is_beyond_the_limits(log):
    found = run("oracle", log, "--V0", 1.000001e-4)
    assert found.returncode == 1
    assert json.loads(found.stdout)["worst_residual"] > 1e-8


def test_a_log_that_cannot_be_replayed_is_rejected_with_the_reason(log):
    def rejected(file, *options):
        found = run("oracle", file, *options)
        assert found.returncode == 2 and str(file) in found.stderr
        return found.stderr

    assert "--ki and --fs" in rejected(log, "--ki", 1e6)
    assert "--N and --Ns" in rejected(log, "--N", 8)
    assert "give --N, --Ns, --M" in rejected(changed(log, lambda table: table, metadata={}))
    unknown = {b"parameters": b'{"gravity": 9.81}'}
    assert "does not know the parameters gravity" in rejected(changed(log, lambda table: table, metadata=unknown))
    assert "cannot be read as a contact log" in rejected(changed(log, lambda table: table.drop_columns(["threshold"])))
    assert "initial attachment" in rejected(changed(log, lambda table: table.slice(0, 9 * 20 - 1)))
