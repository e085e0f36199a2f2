"""docs/development.md has a reason for every crate, and for every one that is there twice; the lock file is always used."""

import re
import tomllib
from collections import Counter

from conftest import ROOT

# Calls that need the crates.
CARGO = re.compile(r"\bcargo (build|clippy|doc|run|test)\b")


def named_crates(title):
    """Crates in the first column of the table that follows a sentence."""
    page = (ROOT / "docs/development.md").read_text()
    table = page.split(title)[1].split("|---|---|\n")[1].split("\n\n")[0]
    return {name for row in table.splitlines() for name in re.findall(r"`([^`]+)`", row.split("|")[1])}


def test_every_crate_has_a_reason():
    manifests = [tomllib.loads((ROOT / path).read_text()) for path in ("Cargo.toml", "src/physics/Cargo.toml", "python/Cargo.toml")]
    sections = [section for manifest in manifests for section in (manifest, *manifest.get("target", {}).values())]
    kinds = ("dependencies", "dev-dependencies", "build-dependencies")
    crates = {name for section in sections for kind in kinds for name in section.get(kind, {})}
    assert named_crates("Each crate is there") == crates - {"stickslip", "stickslip-physics"}


def test_every_crate_that_is_there_twice_has_a_reason():
    packages = tomllib.loads((ROOT / "Cargo.lock").read_text())["package"]
    counts = Counter(package["name"] for package in packages)
    assert named_crates("Some are in the tree twice") == {name for name, count in counts.items() if count > 1}


def test_scripts_use_the_lock_file():
    calls = [
        (script.name, line.strip())
        for script in (ROOT / "scripts").iterdir()
        for line in script.read_text().splitlines()
        if CARGO.search(line) and not line.lstrip().startswith(("#", "echo"))
    ]
    assert len(calls) >= 5, calls
    assert [call for call in calls if "--locked" not in call[1]] == []
