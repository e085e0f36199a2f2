"""scripts/gather puts directories together in which shards of one sweep ran: with the bytes of a single run, also if it was
killed at any step before, and never from another sweep."""

import os
import shutil
import subprocess

import pytest
from conftest import ROOT, SWEEP, results_in, tree

TABLES = ("slips", "precursors", "jobs")
PARTS = 6

# In the place of a program that the script calls: at the call of that number it kills the script, before its work or half
# through it.
DEADLY = """#!/bin/sh
echo >> "$CALLS"
if [ "$(wc -l < "$CALLS")" = "$DEADLY" ]; then
    [ "{name}" != cp ] || head -c 99 "$1" > "$2"
    kill -9 $PPID $$
fi
exec {program} "$@"
"""


@pytest.fixture(scope="module")
def shards(stickslip, tmp_path_factory):
    """A sweep, the directory of a run of its own, and those of its two shards."""
    folder = tmp_path_factory.mktemp("shards")
    sweep = folder / "tiny.toml"
    sweep.write_text(SWEEP.format(seeds=PARTS // 2))
    stickslip("run", sweep, "--out", folder / "whole")
    assert {table.name for table in (folder / "whole" / "tables").iterdir()} == set(TABLES), "all tables that can be recorded"
    for number, name in enumerate(("first", "second"), 1):
        stickslip("run", sweep, "--out", folder / name, "--shard", f"{number}/2", "--no-reduce")
    return folder


@pytest.fixture
def gather(tmp_path):
    """Runs the script; it is killed at a call of a program, if it is given its number."""
    (tmp_path / "bin").mkdir()
    for name in ("cmp", "mkdir", "cp", "mv", "rm"):
        (tmp_path / "bin" / name).write_text(DEADLY.format(name=name, program=shutil.which(name)))
        (tmp_path / "bin" / name).chmod(0o755)

    def run(*directories, deadly=0):
        (tmp_path / "calls").write_text("")
        environment = {"PATH": f"{tmp_path}/bin:{os.environ['PATH']}", "CALLS": f"{tmp_path}/calls", "DEADLY": str(deadly)}
        command = [ROOT / "scripts" / "gather", *directories]
        return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)

    return run


def test_shards_put_together_have_the_bytes_of_one_run(stickslip, shards, gather, tmp_path):
    target = shutil.copytree(shards / "first", tmp_path / "target")
    done = gather(target, shards / "second")
    assert done.returncode == 0, done.stderr
    stickslip("verify", target)
    assert tree(target / "tables") == tree(shards / "whole" / "tables")
    stickslip("run", target)
    assert results_in(target) == results_in(shards / "whole")


def test_a_copy_that_is_killed_at_any_step_leaves_whole_parts_and_can_be_repeated(stickslip, shards, gather, tmp_path):
    whole, kills = tree(shards / "whole" / "tables"), 0
    for deadly in range(1, 1000):
        target = shutil.copytree(shards / "first", tmp_path / f"target-{deadly}")
        done = gather(target, shards / "second", deadly=deadly)
        found = tree(target / "tables")
        assert found.items() <= whole.items(), "files of parts alone, and whole"
        parts = {path.removeprefix("jobs/") for path in found if path.startswith("jobs/")}
        assert {f"{table}/{part}" for table in TABLES for part in parts} <= found.keys(), "no part without its slips"
        if done.returncode == 0:
            break
        assert done.returncode == -9, done
        kills += 1
        assert gather(target, shards / "second").returncode == 0
        assert tree(target / "tables") == whole
        stickslip("run", target, "--no-reduce")
        assert list((target / "run" / "staging").glob("worker-*")) == []
    # Each file is copied and moved; the last step of all ends the script.
    assert kills > 2 * len(TABLES) * PARTS // 2


def test_a_directory_of_another_sweep_is_refused(stickslip, shards, gather, tmp_path):
    first, extended = (shutil.copytree(shards / "first", tmp_path / name) for name in ("first", "extended"))
    other, nothing, sweep = (tmp_path / name for name in ("other", "nothing", "tiny.toml"))
    sweep.write_text(SWEEP.format(seeds=PARTS // 2 + 1))
    for directory in (other, extended):
        stickslip("run", sweep, "--out", directory, "--no-reduce")
    for target, source in ((first, other), (first, extended), (extended, first), (first, nothing), (nothing, first)):
        before = tree(target)
        done = gather(target, shards / "second", source)
        assert done.returncode == 2 and "is not of the sweep" in done.stderr
        assert tree(target) == before
    assert not nothing.exists()


def test_a_part_that_has_lost_its_slips_is_not_copied(shards, gather, tmp_path):
    source = shutil.copytree(shards / "second", tmp_path / "source")
    shutil.rmtree(source / "tables" / "slips")
    target = shutil.copytree(shards / "first", tmp_path / "target")
    assert gather(target, source).returncode != 0
    assert tree(target / "tables") == tree(shards / "first" / "tables")
