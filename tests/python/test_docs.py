"""The documentation names every parameter and every column, its sweep files run, and its links lead somewhere."""

import json
import re
import shutil

import pyarrow.parquet as pq
import pytest
from conftest import ROOT

PAGES = [*map(ROOT.joinpath, ("README.md", "CHANGELOG.md", "results/README.md")), *sorted((ROOT / "docs").glob("*.md"))]


def name(page):
    return page.relative_to(ROOT).as_posix()


def examples():
    """The sweep files in the documentation: blocks of TOML that have a name."""
    for page in PAGES:
        for number, block in enumerate(re.findall(r"^```toml\n(.*?)^```", page.read_text(), re.M | re.S)):
            if re.search(r"^name\b", block, re.M):
                yield pytest.param(block, id=f"{name(page)}-{number}")


def test_the_model_page_has_every_parameter_with_its_unit(results):
    schema = pq.read_schema(next((results / "tables" / "jobs").glob("*.parquet")))
    parameters = schema.names[schema.names.index("set_id") + 1 : schema.names.index("eta")]
    assert len(parameters) > 10
    lines = (ROOT / "docs" / "model.md").read_text().splitlines()
    for key in parameters:
        rows = [line for line in lines if line.startswith(f"| `{key}` |")]
        assert len(rows) == 1, f"docs/model.md: one row of the table of parameters for `{key}`"
        unit = schema.field(key).metadata[b"unit"].decode()
        assert not unit or f"in {unit}" in rows[0], rows[0]


def test_every_column_is_documented(results):
    written = {file.parent.name: file for file in (results / "tables").glob("*/*.parquet")}
    written |= {file.stem: file for file in (results / "reduced").glob("*.parquet")}
    assert {"slips", "jobs", "precursors", "sets", "histograms", "startup", "backbone", "points"} <= set(written)
    text = "".join(page.read_text() for page in PAGES if page.parent.name == "docs")
    for table, file in written.items():
        for field in pq.read_schema(file):
            assert field.metadata[b"description"], f"{table}.{field.name} has no meaning in its metadata"
            assert f"`{field.name}`" in text, f"{table}.{field.name} is not in docs/"


def test_every_column_of_a_simulation_is_documented(stickslip, tmp_path):
    files = {flag: tmp_path / f"{flag}.parquet" for flag in ("trace", "map", "contacts")}
    flags = [argument for flag, file in files.items() for argument in (f"--{flag}", file)]
    stickslip("simulate", "--set", "N=9", "--time", 0.01, *flags)
    text = (ROOT / "docs" / "results.md").read_text()
    for flag, file in files.items():
        row = next(line for line in text.splitlines() if line.startswith(f"| `--{flag}` |"))
        for field in pq.read_schema(file):
            assert f"`{field.name}`" in row, f"{flag}.{field.name}"


def test_every_field_of_json_output_is_documented(stickslip, results, tmp_path):
    sweep = results.parent / "tiny.toml"
    copy = shutil.copytree(results, tmp_path / "copy")
    outputs = {
        "plan": ("plan", sweep),
        "run": ("run", sweep, "--out", results, "--no-reduce"),
        "status": ("status", results),
        "reduce": ("reduce", results),
        "verify": ("verify", results),
        "compact": ("compact", copy),
        "simulate": ("simulate", "--set", "N=9", "--time", 0.01),
    }
    text = (ROOT / "docs" / "results.md").read_text()
    for command, arguments in outputs.items():
        row = next(line for line in text.splitlines() if line.startswith(f"| `{command}` |"))
        for field in json.loads(stickslip(*arguments, "--json").stdout):
            assert f"`{field}`" in row, f"{command} --json: {field}"


@pytest.mark.parametrize("text", list(examples()))
def test_the_sweep_files_in_the_documentation_can_run(stickslip, tmp_path, text):
    sweep = tmp_path / "example.toml"
    sweep.write_text(text)
    stickslip("plan", sweep)


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text()):
        if not target.startswith(("http://", "https://")):
            assert (page.parent / target).exists(), f"{name(page)} links to {target}"
