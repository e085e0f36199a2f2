"""A sweep of 64 jobs of equal cost, so of 64 parts, and what must hold of its results however many processes shared it."""

import json
import re
from collections import Counter
from pathlib import Path

SWEEP = """
name = "shared"

[model]
N  = {blocks}
V0 = 2e-5

[axes]
seed = {{ count = 64 }}

[record]
slips = {slips}
"""

PARTS = 64

# A number of blocks with which ten slips of all jobs take some 0.7 s of CPU time.
BLOCKS = 100

PAGE = Path(__file__).resolve().parents[2] / "docs" / "clusters.md"


def write_sweep(file: Path, blocks: int, slips: int) -> Path:
    """Writes the sweep; its cost goes with the number of blocks and slips."""
    file.write_text(SWEEP.format(blocks=blocks, slips=slips))
    return file


def screens(section: str) -> list[str]:
    """The commands of each screen in a section of the page on clusters."""
    text = PAGE.read_text().split(f"\n## {section}\n")[1].split("\n## ")[0]
    found = re.findall(r"```sh\n(.*?)```", text, re.DOTALL)
    assert found, f"{PAGE}: the section {section} has no screen"
    return found


def prepare_screen(screen: str, folder: Path, slips: int) -> str:
    """Writes the sweep that a screen names into a folder; the commands to run there, which write nowhere else."""
    (folder / "sweeps").mkdir(parents=True)
    write_sweep(folder / "sweeps" / "fig3.toml", BLOCKS, slips)
    return screen.replace("/scratch/", f"{folder}/scratch/")


def done_parts(results: Path) -> int:
    return len(list(results.glob("tables/jobs/part-*")))


def logged(results: Path) -> list[list[dict]]:
    """The events in the log of each process that ran jobs."""
    logs = [[json.loads(line) for line in log.read_text().splitlines()] for log in results.glob("run/log/*.jsonl")]
    return [events for events in logs if any(event["event"] == "part_committed" for event in events)]


def claimed(results: Path, host: str) -> set[str]:
    """The parts that processes of a host have claimed, in a run that has not ended."""
    claims = results.glob("run/claims/part-*")
    return {claim.stem for claim in claims if claim.read_text().startswith(f"worker-{host}-")}


def committed(results: Path, host: str) -> set[str]:
    """Those of them that are done."""
    return claimed(results, host) & {file.stem for file in results.glob("tables/jobs/*")}


def abandoned(results: Path, host: str) -> set[str]:
    """Those of them that are not done."""
    return claimed(results, host) - {file.stem for file in results.glob("tables/jobs/*")}


def contents(results: Path) -> dict[str, bytes]:
    """The bytes of all that is not of the run itself: tables, reduced data and figures."""
    files = [file for file in results.rglob("*") if file.is_file()]
    names = [file.relative_to(results) for file in files]
    return {str(name): file.read_bytes() for name, file in zip(names, files) if name.parts[0] != "run"}


def assert_same(shared: Path, local: Path):
    """The results have the bytes of a local run with one process."""
    found, expected = contents(shared), contents(local)
    assert sorted(found) == sorted(expected)
    assert [name for name in found if found[name] != expected[name]] == []


def assert_each_part_ran_once(results: Path, workers: int, killed: int = 0):
    """No part was run twice, all are in the logs, and at least this many processes had a share.

    A process that was killed may have committed its last part without a word of it in its log.
    """
    logs = logged(results)
    runs = Counter(event["part"] for events in logs for event in events if event["event"] == "part_committed")
    assert {part: count for part, count in runs.items() if count > 1} == {}
    assert done_parts(results) - killed <= len(runs) <= done_parts(results)
    assert len(logs) >= workers
