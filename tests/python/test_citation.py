"""CITATION.cff names the version that Cargo.toml has, and the date on which CHANGELOG.md says that it was released."""

import re
import tomllib

from conftest import ROOT


def field(name):
    """A field of the first level of CITATION.cff; None if it is not there."""
    found = re.search(rf"^{name}: *\"?([^\"\n]+)\"?$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    return found and found[1]


def test_the_citation_has_the_fields_of_its_format_and_the_version_of_the_program():
    assert field("cff-version") == "1.2.0"
    assert all(field(name) for name in ("message", "title", "type", "license"))
    manifest = tomllib.loads((ROOT / "Cargo.toml").read_text())
    assert field("version") == manifest["workspace"]["package"]["version"]


def test_the_citation_has_a_date_once_the_version_is_released():
    changelog = (ROOT / "CHANGELOG.md").read_text()
    when = re.search(rf"^## \[{re.escape(field('version'))}\] - (\S+)$", changelog, re.MULTILINE)[1]
    assert field("date-released") == (None if when == "unreleased" else when)
