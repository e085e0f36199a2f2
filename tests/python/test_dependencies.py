"""Cargo.toml has a reason for every crate, and for every one that is there twice, and deny.toml for every known risk; the
lock file is always used."""

import json
import re
import subprocess
import tomllib
from collections import Counter

from conftest import ROOT

# Calls that need the crates.
CARGO = re.compile(r"\bcargo (build|clippy|doc|run|test)\b")
MANIFESTS = [ROOT / path / "Cargo.toml" for path in ("", "crates/physics", "crates/workspace-hack", "python")]
OWN = ("stickslip", "stickslip-physics")
DENY = tomllib.loads((ROOT / "deny.toml").read_text())


def test_every_crate_has_a_reason():
    section, reason, crates = "", "", 0
    for manifest in MANIFESTS:
        for line in manifest.read_text().splitlines():
            crate = re.match(r"([\w-]+) = ", line)
            if line.startswith("["):
                section = line
            elif crate and "dependencies]" in section and crate[1] not in OWN:
                crates += 1
                assert reason, f"{manifest}: {crate[1]} has no comment above it"
            # A comment above a section is that of its first crate.
            reason = line if line.startswith("#") or (line.startswith("[") and reason) else ""
    assert crates > 40


def test_every_crate_that_is_there_twice_has_a_reason():
    packages = tomllib.loads((ROOT / "Cargo.lock").read_text())["package"]
    counts = Counter(package["name"] for package in packages)
    twice = re.search(r"# In the tree twice: ((?:.*\n)+?)\[", (ROOT / "Cargo.toml").read_text())[1]
    # In brackets is what wants them.
    named = set(re.findall(r"`([^`]+)`", re.sub(r"\([^)]*\)", "", twice)))
    assert named == {name for name, count in counts.items() if count > 1}


def test_every_risk_on_record_is_still_there():
    locked = {package["name"] for package in tomllib.loads((ROOT / "Cargo.lock").read_text())["package"]}
    for risk in DENY["advisories"]["ignore"]:
        crate = risk["reason"].split()[0]
        assert re.fullmatch(r"RUSTSEC-\d{4}-\d{4}", risk["id"]) and "Ends with" in risk["reason"], risk
        assert crate in locked, f"{crate} is gone from Cargo.lock: take {risk['id']} out of deny.toml"


def is_allowed(expression, licences):
    """Whether an SPDX expression holds with these licences; an old one has a slash for `OR`."""
    operators = {"AND": "and", "OR": "or"}
    term = re.compile(r"[\w.-]+( WITH [\w.-]+)?")
    return eval(term.sub(lambda found: operators.get(found[0], str(found[0] in licences)), expression.replace("/", " OR ")))


def test_all_licences_are_allowed_and_all_that_are_allowed_are_needed():
    command = ["cargo", "metadata", "--format-version=1", "--locked"]
    packages = json.loads(subprocess.check_output(command, cwd=ROOT))["packages"]
    licences = {package["name"]: package["license"] or "none" for package in packages}
    allowed = set(DENY["licenses"]["allow"])
    assert len(licences) > 100
    assert [item for item in licences.items() if not is_allowed(item[1], allowed)] == []
    needless = [each for each in allowed if all(is_allowed(found, allowed - {each}) for found in licences.values())]
    assert needless == [], "take them out of deny.toml"


def test_users_get_ranges_of_python_packages_and_tests_one_version_each():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    pins = [re.fullmatch(r"([\w-]+)==[\d.]+", package) for package in extras["test"]]
    packages = [package for package in extras["analysis"] + extras["examples"] if package != "stickslip[analysis]"]
    ranges = [re.fullmatch(r"([\w-]+)>=[\d.]+", package) for package in packages]
    assert all(pins) and all(ranges), extras
    # The test of the notebook needs no page to open it in.
    assert {package[1] for package in ranges} - {package[1] for package in pins} == {"jupyterlab"}


def test_tests_do_not_move_the_module_of_a_pip_install_at_the_same_time():
    """maturin moves what it has built from release to maturin, in the folder of Cargo's, and back."""
    script = (ROOT / "scripts" / "python-packages").read_text()
    setting, command = "export CARGO_BUILD_BUILD_DIR CARGO_TARGET_DIR", "maturin develop"
    assert "CARGO_TARGET_DIR=$CARGO_BUILD_BUILD_DIR/module" in script and -1 < script.find(setting) < script.find(command)


def test_scripts_use_the_lock_file():
    calls = [
        (script.name, line.strip())
        for script in (ROOT / "scripts").iterdir()
        for line in script.read_text().splitlines()
        if CARGO.search(line) and not line.lstrip().startswith(("#", "echo"))
    ]
    assert len(calls) >= 5, calls
    assert [call for call in calls if "--locked" not in call[1]] == []


def test_every_crate_is_built_once_for_tests_and_module():
    def built(kinds, package):
        command = ["cargo", "tree", "--locked", "--prefix=none", "--format={p} {f}", f"--edges={kinds}", f"--package={package}"]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
        return {line.removesuffix(" (*)") for line in done.stdout.splitlines()}

    def several(features):
        crates = Counter(tuple(line.split()[:2]) for line in features)
        assert len(crates) > 100
        return {name for (name, _), count in crates.items() if count > 1}

    together = built("normal,build,dev", "stickslip") | built("normal,build", "stickslip-python")
    assert several(together) == set(), "each with several sets of features"
    # What is published does not know the crate of shared features, so a plain build has these once more.
    shared = {"arrow-array", "arrow-data", "arrow-schema", "clap", "clap_builder"}
    shared |= {"getrandom", "linux-raw-sys", "once_cell", "rustix", "syn"}
    assert several(together | built("normal,build", "stickslip")) == shared


def test_only_tests_and_the_module_know_the_crate_of_shared_features():
    """It is not published, so what is published must not need it: a dependency for tests, by path alone, is left out."""
    manifests = {name: tomllib.loads((ROOT / name / "Cargo.toml").read_text()) for name in ("", "crates/physics", "python")}
    users = {
        (name, section)
        for name, manifest in manifests.items()
        for section in ("dependencies", "dev-dependencies", "build-dependencies")
        if "workspace-hack" in manifest.get(section, {})
    }
    assert users == {("", "dev-dependencies"), ("python", "dependencies")}
    assert manifests[""]["dev-dependencies"]["workspace-hack"].keys() == {"path"}
