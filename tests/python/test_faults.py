"""System calls of the built program fail or kill it, one in each trial, under strace. Whatever fails: no good file is lost,
damaged or moved, the exit code is that of an error of the disk, and the same command then ends with the same bytes.

The tests try one in 41 of the faults; STICKSLIP_FAULTS=1 tries all of them.
"""

import os
import re
import shutil
import subprocess
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

# Tries one in this number of faults.
EVERY = int(os.environ.get("STICKSLIP_FAULTS", 41))

SWEEP = """
name = "tiny"

[model]
N = 1
Ns = 2

[axes]
V0   = [1e-4, 2e-4]
seed = {{ count = {seeds} }}

[record]
slips = 3
discard = 0
max_events = {max_events}
"""

# What each call that uses the disk may fail with.
FAULTS = {
    "openat": ["error=EIO", "error=EACCES", "error=EMFILE", "error=ENOSPC", "signal=KILL"],
    "read": ["error=EIO", "error=ESTALE"],
    "pread64": ["error=EIO", "error=ESTALE"],
    "write": ["error=ENOSPC", "error=EIO", "signal=KILL"],
    "fsync": ["error=EIO", "signal=KILL"],
    "rename": ["error=EIO", "error=ENOSPC", "signal=KILL"],
    "renameat2": ["error=EIO", "signal=KILL"],
    "linkat": ["error=EIO", "error=EMLINK", "signal=KILL"],
    "mkdir": ["error=EIO", "error=ENOSPC", "signal=KILL"],
    "unlink": ["error=EIO", "error=EACCES", "signal=KILL"],
    "unlinkat": ["error=EIO", "error=EACCES", "signal=KILL"],
    "getdents64": ["error=EIO"],
    "statx": ["error=EIO", "error=EACCES"],
    "fstat": ["error=EIO"],
    "flock": ["error=EIO", "error=ENOLCK"],
}
CALLS = ",".join(FAULTS)

DONE, REFUSED, STOPPED, KILLED = 0, 2, 3, -9


def write_sweep(folder, seeds=2, max_events=100_000):
    (folder / "tiny.toml").write_text(SWEEP.format(seeds=seeds, max_events=max_events))


def nothing(folder, call):
    write_sweep(folder)


def whole(folder, call):
    write_sweep(folder)
    call("run tiny.toml --out out")


def smaller(folder, call):
    whole(folder, call)
    write_sweep(folder, seeds=3)


def compacted(folder, call):
    whole(folder, call)
    call("compact out")
    write_sweep(folder, seeds=3)
    call("run tiny.toml --out out")


def failed(folder, call):
    write_sweep(folder, max_events=1)
    call("run tiny.toml --out out", code=1)
    write_sweep(folder)


def damaged(folder, call):
    whole(folder, call)
    part = next((folder / "out/tables/slips").iterdir())
    part.write_bytes(part.read_bytes()[:-9])


# What is there before, and what is done then.
SCENARIOS = {
    "run": (nothing, "run tiny.toml --out out --no-reduce"),
    "extend": (smaller, "run tiny.toml --out out --no-reduce"),
    "compact": (whole, "compact out"),
    "compact again": (compacted, "compact out"),
    "retry": (failed, "run tiny.toml --out out --retry-failed --no-reduce"),
    "repair": (damaged, "verify out --repair"),
    "reduce": (whole, "reduce out"),
    "status": (whole, "status out"),
}


def results(folder):
    """Tables and reduced data, by path."""
    files = [path for name in ("tables", "reduced") for path in (folder / "out" / name).rglob("*") if path.is_file()]
    return {path.relative_to(folder): path.read_bytes() for path in files}


@pytest.fixture(scope="module")
def strace():
    """The program strace, if it may trace."""
    path = shutil.which("strace")
    if path is None or subprocess.run([path, "-o", "/dev/null", "true"], capture_output=True).returncode != 0:
        pytest.skip("needs strace, and to be allowed to trace")
    return path


class Scenario:
    """A directory before, the command, and the results after it."""

    def __init__(self, program, strace, folder, name):
        self.program, self.strace, self.name, self.folder = program, strace, name, folder
        prepare, self.command = SCENARIOS[name]
        self.before = folder / "before"
        self.before.mkdir()
        prepare(self.before, lambda text, code=DONE: self.call(self.before, text, code))
        good = self.copy("good")
        self.call(good, self.command)
        self.after = results(good)

    def copy(self, name):
        return Path(shutil.copytree(self.before, self.folder / name))

    def call(self, folder, text, code=DONE):
        done = subprocess.run([self.program, *text.split()], cwd=folder, capture_output=True, text=True, timeout=60)
        assert done.returncode == code, f"{text}: {done}"

    def traced(self, folder, *options):
        command = [self.strace, "-f", "-qq", *options, self.program, *self.command.split()]
        if self.command.startswith("run"):
            command += ["--threads", "1"]
        return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60)

    def calls(self):
        """How often the main thread makes each call: before it uses the folder, and in all."""
        folder = self.copy("counted")
        log = self.folder / "log"
        self.traced(folder, "-o", log, "-e", f"trace={CALLS}")
        first, count, main = {}, Counter(), None
        has_begun = False
        for line in log.read_text(errors="replace").splitlines():
            thread, call = line.split(maxsplit=1)
            main = main or thread
            has_begun |= "tiny.toml" in call or '"out' in call
            name = re.match(r"\w+", call)
            if thread == main and name:
                count[name[0]] += 1
                if has_begun:
                    first.setdefault(name[0], count[name[0]])
        return {name: range(first[name], count[name] + 1) for name in FAULTS if name in first}

    def trials(self):
        """Every call with its faults."""
        return [
            (call, number, fault)
            for call, numbers in self.calls().items()
            for number in numbers
            for fault in FAULTS[call]
        ]

    def befall(self, call, number, fault):
        """What is wrong after a fault, or nothing."""
        folder = self.copy(f"{call}-{number}-{fault}")
        done = self.traced(folder, "-o", "/dev/null", "-e", f"trace={call}", "-e", f"inject={call}:{fault}:when={number}")
        case = f"{self.name}: {fault} at {call} {number}: exit {done.returncode}, {done.stderr}"
        is_of_sweep = done.returncode == REFUSED and "tiny.toml: cannot be read" in done.stderr
        if done.returncode not in (DONE, STOPPED, KILLED) and not is_of_sweep:
            return case
        if (done.returncode == KILLED) != (fault == "signal=KILL"):
            return case
        problem = self.lost(folder)
        if problem:
            return f"{case}\n{problem}"
        again = subprocess.run([self.program, *self.command.split()], cwd=folder, capture_output=True, text=True, timeout=60)
        if again.returncode != DONE or results(folder) != self.after:
            return f"{case}\nthen {again}, {results(folder).keys()} instead of {self.after.keys()}"
        shutil.rmtree(folder)
        return None

    def lost(self, folder):
        """What is not as it was, or as it is to be."""
        if self.name == "repair":
            return None
        if (folder / "out/run/quarantine").exists():
            return "files were moved"
        if (folder / "out/run/manifest.json").exists():
            verified = subprocess.run(
                [self.program, "verify", "out"], cwd=folder, capture_output=True, text=True, timeout=60
            )
            if verified.returncode != DONE:
                return f"{verified}"
        if "compact" not in self.name:
            before, now = results(self.before), results(folder)
            if any(now.get(path) not in (data, self.after.get(path)) for path, data in before.items()):
                return "files are lost or changed"
        return None


@pytest.mark.parametrize("name", SCENARIOS)
def test_whatever_call_fails_nothing_good_is_lost_and_the_command_can_be_given_again(
    program, strace, tmp_path, name
):
    scenario = Scenario(program, strace, tmp_path, name)
    trials = scenario.trials()
    assert len(trials) > 100, f"{len(trials)} trials"
    chosen = trials[:: EVERY]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        problems = [problem for problem in pool.map(lambda trial: scenario.befall(*trial), chosen) if problem]
    print(f"{name}: {len(chosen)} of {len(trials)} faults")
    assert not problems, f"{len(problems)} of {len(chosen)}:\n" + "\n\n".join(problems[:10])
