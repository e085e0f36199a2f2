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
from conftest import tree

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
}
CALLS = ",".join(FAULTS)

DONE, REFUSED, STOPPED, KILLED = 0, 2, 3, -9


def write_sweep(folder, seeds=2, max_events=100_000):
    (folder / "tiny.toml").write_text(SWEEP.format(seeds=seeds, max_events=max_events))


def nothing(folder, call):
    write_sweep(folder)


def whole(folder, call):
    write_sweep(folder)
    call(folder, "run tiny.toml --out out")


def smaller(folder, call):
    whole(folder, call)
    write_sweep(folder, seeds=3)


def failed(folder, call):
    write_sweep(folder, max_events=1)
    call(folder, "run tiny.toml --out out", 1)
    write_sweep(folder)


def damaged(folder, call):
    whole(folder, call)
    part = next((folder / "out/tables/slips").iterdir())
    part.write_bytes(part.read_bytes()[:-9])


# What is there before, and what is done then.
SCENARIOS = {
    "run": (nothing, "run tiny.toml --out out --no-reduce"),
    "extend": (smaller, "run tiny.toml --out out --no-reduce"),
    "export": (whole, "export out --out exported"),
    "retry": (failed, "run tiny.toml --out out --retry-failed --no-reduce"),
    "repair": (damaged, "verify out --repair"),
    "reduce": (whole, "reduce out"),
    "status": (whole, "status out"),
}


def results(folder):
    """Tables, reduced data and an export, by path."""
    return {path: data for path, data in tree(folder).items() if re.match("out/(tables|reduced)/|exported/[a-z]", path)}


@pytest.fixture(scope="module")
def strace():
    path = shutil.which("strace")
    if path is None or subprocess.run([path, "-o", "/dev/null", "true"], capture_output=True).returncode != 0:
        pytest.skip("needs strace, and to be allowed to trace")
    return path


class Scenario:
    """A directory before, the command, and the results after it."""

    def __init__(self, program, strace, folder, name):
        self.program, self.strace, self.name, self.folder = program, strace, name, folder
        prepare, command = SCENARIOS[name]
        self.command = f"{command} --threads 1" if command.startswith("run") else command
        self.before = folder / "before"
        self.before.mkdir()
        prepare(self.before, self.succeed)
        good = self.copy("good")
        self.succeed(good, self.command, DONE, STOPPED)
        self.after = results(good)

    def copy(self, name):
        return Path(shutil.copytree(self.before, self.folder / name))

    def call(self, folder, text, *tracer):
        command = [*tracer, self.program, *text.split()]
        return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60)

    def succeed(self, folder, text, *codes):
        done = self.call(folder, text)
        assert done.returncode in (codes or [DONE]), done

    def traced(self, folder, *options):
        return self.call(folder, self.command, self.strace, "-f", "-qq", *options)

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
        calls = self.calls().items()
        return [(call, number, fault) for call, numbers in calls for number in numbers for fault in FAULTS[call]]

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
        # An export is there as a whole or not at all; the next one needs a free name.
        shutil.rmtree(folder / "exported", ignore_errors=True)
        again = self.call(folder, self.command)
        if again.returncode not in (DONE, STOPPED) or results(folder) != self.after:
            return f"{case}\nthen {again}, {results(folder).keys()} instead of {self.after.keys()}"
        shutil.rmtree(folder)
        return None

    def lost(self, folder):
        """What is not as it was, or as it is to be."""
        if self.name == "repair":
            return None
        if (folder / "out/run/quarantine").exists():
            return "files were moved"
        if (folder / "out/run/extension-000.json").exists():
            verified = self.call(folder, "verify out")
            if verified.returncode not in (DONE, STOPPED):
                return f"{verified}"
        before, now = results(self.before), results(folder)
        if any(now.get(path) not in (before.get(path), self.after.get(path)) for path in before | now):
            return "files are lost, changed or not whole"
        return None


@pytest.mark.parametrize("name", SCENARIOS)
def test_whatever_call_fails_nothing_good_is_lost_and_the_command_can_be_given_again(program, strace, tmp_path, name):
    scenario = Scenario(program, strace, tmp_path, name)
    trials = scenario.trials()
    assert len(trials) > 100, f"{len(trials)} trials"
    chosen = trials[::EVERY]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        problems = [problem for problem in pool.map(lambda trial: scenario.befall(*trial), chosen) if problem]
    print(f"{name}: {len(chosen)} of {len(trials)} faults")
    assert not problems, f"{len(problems)} of {len(chosen)}:\n" + "\n\n".join(problems[:10])
