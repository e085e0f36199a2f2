"""The committed pictures of sweeps are those that their sweep files give now.

The cheap ones are drawn again. The others take minutes: what they were drawn from must be unchanged, by the checksums
that scripts/reproduce wrote to results/pictures.txt, and if their results exist they are drawn again from these.
"""

import hashlib
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest
from conftest import ROOT

#: Sweeps that take less than 15 s of CPU time.
CHEAP = ("drag", "drag-strong", "locking-contacts", "sliding-velocity")
#: Pictures of a single simulation, which test_redraw.py draws, and of timings, which differ each time.
OTHERS = {"fig1d.png", "fig4b.png", "fig4d.png", "predicted-cost.png", "speed-against-error.png", "weakening-threshold.png"}
#: Custom figures: the flags of `stickslip plot`, a line for each, by sweep.
OWN = dict(re.findall(r'^    \[([\w-]+)\]="(--[^"]*)"', (ROOT / "scripts" / "reproduce").read_text(), re.MULTILINE))


@dataclass(frozen=True)
class Picture:
    """A line of results/pictures.txt: which figure of a sweep a picture is, and checksums of what it was drawn from."""

    name: str
    sweep: str
    figure: str
    png: str
    sweep_file: str
    golden_figures: str

    @property
    def remedy(self):
        return f"{self.name} is out of date: scripts/reproduce {self.sweep} draws it again"

    def assert_drawn(self, folder: Path):
        """The results in a folder have just this picture."""
        assert (folder / self.figure).read_bytes() == (ROOT / "results" / self.name).read_bytes(), self.remedy


LINES = (ROOT / "results" / "pictures.txt").read_text().splitlines()
PICTURES = [Picture(*line.split()) for line in LINES]
SWEEPS = sorted({picture.sweep for picture in PICTURES})


def pictures_of(sweep):
    return [picture for picture in PICTURES if picture.sweep == sweep]


def checksum(data):
    return hashlib.sha256(data).hexdigest()


def without_comments(sweep):
    """The lines of a sweep file that are no comments."""
    lines = (ROOT / "sweeps" / f"{sweep}.toml").read_bytes().splitlines(True)
    return b"".join(line for line in lines if not line.startswith(b"#"))


def golden_figures():
    """The lines of the golden files that hold figures."""
    files = sorted((ROOT / "tests" / "golden").glob("*.txt"))
    return b"".join(line for file in files for line in file.read_bytes().splitlines(True) if b"figures/" in line)


def test_every_picture_is_checked():
    assert {file.name for file in (ROOT / "results").glob("*.png")} == {picture.name for picture in PICTURES} | OTHERS
    assert set(CHEAP) < set(SWEEPS)


@pytest.mark.parametrize("picture", PICTURES, ids=lambda picture: picture.name)
def test_what_a_picture_was_drawn_from_is_unchanged(picture):
    assert checksum((ROOT / "results" / picture.name).read_bytes()) == picture.png, picture.remedy
    assert checksum(without_comments(picture.sweep)) == picture.sweep_file, picture.remedy
    assert checksum(golden_figures()) == picture.golden_figures, picture.remedy


@pytest.mark.parametrize("sweep", CHEAP)
def test_a_cheap_sweep_gives_its_picture_again(stickslip, tmp_path, sweep):
    stickslip("run", ROOT / "sweeps" / f"{sweep}.toml", "--out", tmp_path / "results")
    for picture in pictures_of(sweep):
        picture.assert_drawn(tmp_path / "results")


@pytest.mark.parametrize("sweep", [sweep for sweep in SWEEPS if sweep not in CHEAP])
def test_results_that_are_there_give_their_pictures_again(stickslip, tmp_path, sweep):
    results = ROOT / "results" / sweep
    if not (results / "reduced").exists():
        pytest.skip(f"{results} is not there; scripts/reproduce {sweep} makes it")
    for folder in ("reduced", "run"):
        shutil.copytree(results / folder, tmp_path / folder)
    for flags in OWN.get(sweep, "").split("\n"):
        stickslip("plot", tmp_path, *flags.split())
    for picture in pictures_of(sweep):
        picture.assert_drawn(tmp_path)


def test_the_sketch_is_what_its_script_draws(tmp_path):
    subprocess.run([ROOT / "scripts" / "sketch", tmp_path / "slider.svg"], check=True)
    assert (tmp_path / "slider.svg").read_bytes() == (ROOT / "docs" / "slider.svg").read_bytes(), "run scripts/sketch"
