"""The documentation names every field of JSON, its commands and sweep files run, its links lead somewhere."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from conftest import ROOT

PAGES = [
    *map(ROOT.joinpath, ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "results/README.md", "crates/physics/README.md")),
    *sorted((ROOT / "docs").glob("*.md")),
]


def name(page):
    return page.relative_to(ROOT).as_posix()


def examples():
    """The sweep files in the documentation: blocks of TOML that have a name."""
    for page in PAGES:
        for number, block in enumerate(re.findall(r"^```toml\n(.*?)^```", page.read_text(), re.M | re.S)):
            if re.search(r"^name\b", block, re.M):
                yield pytest.param(block, id=f"{name(page)}-{number}")


def test_every_column_has_its_meaning_in_its_metadata(results):
    for file in [*results.glob("tables/*/*.parquet"), *results.glob("reduced/*.parquet")]:
        for field in pq.read_schema(file):
            assert field.metadata[b"description"] and b"unit" in field.metadata, f"{file}: {field.name}"


def test_every_field_of_json_output_is_documented(stickslip, results, tmp_path):
    sweep = results.parent / "tiny.toml"
    outputs = {
        "plan": ("plan", sweep),
        "run": ("run", sweep, "--out", results, "--no-reduce"),
        "status": ("status", results),
        "reduce": ("reduce", results),
        "show": ("show", results),
        "verify": ("verify", results),
        "export": ("export", results, "--out", tmp_path / "exported"),
        "simulate": ("simulate", "--set", "N=9", "--time", 0.01),
    }
    text = (ROOT / "docs" / "commands.md").read_text()
    for command, arguments in outputs.items():
        row = next(line for line in text.splitlines() if line.startswith(f"| `{command}` |"))
        fields = json.loads(stickslip(*arguments, "--json").stdout)
        assert "Its `format` increases" in text and fields.pop("format") > 0, command
        of_jobs = pq.read_schema(next(results.glob("tables/jobs/*.parquet"))).names
        described = of_jobs if "columns of [`jobs`](tables.md#jobs)" in row else []
        for field in fields:
            assert field in described or f"`{field}`" in row, f"{command} --json: {field}"


@pytest.mark.parametrize("text", list(examples()))
def test_the_sweep_files_in_the_documentation_can_run(stickslip, tmp_path, text):
    sweep = tmp_path / "example.toml"
    sweep.write_text(text)
    stickslip("plan", sweep)


def test_the_tutorial_runs_as_written(program, tmp_path):
    (tmp_path / "stickslip").symlink_to(program.resolve())
    environment = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    duckdb = "import duckdb, sys; rows = duckdb.sql(sys.argv[1]).fetchall(); assert len(rows) == 3, rows"
    shells = {"sh": ["bash", "-euc"], "python": [sys.executable, "-c"], "sql": [sys.executable, "-c", duckdb]}
    tutorial = (ROOT / "docs" / "guide.md").read_text().partition("\n## Write a sweep\n")[0]
    blocks = re.findall(r"^```(\w+)\n(.*?)^```", tutorial, re.M | re.S)
    assert {language for language, _ in blocks} == {"toml", "text", *shells}
    printed = ""
    for language, block in blocks:
        if language == "toml":
            (tmp_path / "tour.toml").write_text(block)
        elif language == "text":
            # Predictions depend on the number of cores.
            lines = [line for line in block.splitlines() if "predicted" not in line and line != "..."]
            assert [line for line in lines if line not in printed] == []
        else:
            command = [*shells[language], block]
            done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300)
            assert done.returncode == 0, f"{block}\n{done.stdout}\n{done.stderr}"
            printed += done.stdout
    for picture in ("results/tour/figures/tau-histograms.png", "trace.png"):
        shown = ROOT / "docs" / f"tutorial-{Path(picture).name}"
        if os.environ.get("UPDATE_DOCS"):
            shown.write_bytes((tmp_path / picture).read_bytes())
        assert shown.read_bytes() == (tmp_path / picture).read_bytes(), f"UPDATE_DOCS=1 draws {shown.name} again"


def test_the_sweep_in_the_readme_runs_as_written(program, tmp_path):
    (tmp_path / "stickslip").symlink_to(program.resolve())
    environment = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    section = re.search(r"## A sweep of your own\n(.*?)^## ", (ROOT / "README.md").read_text(), re.M | re.S)[1]
    blocks = re.findall(r"^```(\w+)\n(.*?)^```", section, re.M | re.S)
    assert [language for language, _ in blocks] == ["toml", "sh", "python"]
    (tmp_path / "tour.toml").write_text(blocks[0][1])
    for command in (["bash", "-euc", blocks[1][1]], [sys.executable, "-c", blocks[2][1]]):
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    assert (tmp_path / "results" / "tour" / "report.html").exists()


def test_the_readme_installs_first_what_needs_no_download():
    text = (ROOT / "README.md").read_text()
    installs = [line.strip() for line in re.findall(r"^(?:cargo|pip) install.*?(?=  #|$)", text, re.M)]
    assert installs[0] == "cargo install --path . --locked"
    # test_module runs the first of these, scripts/test-release the last.
    assert installs[1:] == ["pip install .", "pip install '.[examples]'", "pip install --no-index --find-links dist stickslip"]


def commands(page):
    """The commands of `stickslip` on a page, in blocks and in lines, with values for what stands for one."""
    text = page.read_text()
    blocks = "".join(re.findall(r"^```sh\n(.*?)^```", text, re.M | re.S)).replace("\\\n", " ")
    found = re.findall(r"^(?:exec )?stickslip (.*?)(?: -- .*| [>#] .*)?$", blocks, re.M)
    found += re.findall(r"`stickslip ([^`]+)`", text)
    found += re.findall(r"^    stickslip (.*?)(?:   .*)?$", text, re.M)
    return [command.replace("SHELL", "bash") for command in found if not command.startswith("COMMAND")]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_commands_in_the_documentation_can_be_given(program, page):
    for command in commands(page):
        # With --help, what precedes it is parsed, and nothing is done.
        done = subprocess.run([program, *shlex.split(command), "--help"], capture_output=True, text=True, timeout=60)
        assert done.returncode == 0 and done.stdout, f"{name(page)}: stickslip {command}\n{done.stderr}"
    for script in re.findall(r"\bscripts/[\w-]+", page.read_text()):
        assert os.access(ROOT / script, os.X_OK), f"{name(page)} names {script}"


RECIPES = re.findall(r"`stickslip (run [^`]*-o [^`]*)`", (ROOT / "docs" / "guide.md").read_text())


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.rpartition("/")[2])
def test_recipes_end_with_a_figure(program, tmp_path, recipe):
    assert len(RECIPES) == 7
    # As it stands, but with few contacts and slips.
    small = ["--set", "Ns=3", "--set", "slips=4"]
    small += [] if "N=" in recipe.replace("Kd=", "") else ["--set", "N=5"]
    # Pulses come after more slips.
    small = ["--set", "Ns=5", "--set", "N=10"] if "triggering" in recipe else small
    small += [] if "-edge" in recipe or "-precise" in recipe else ["--axis", "seed=count:2"]
    done = subprocess.run([program, *shlex.split(recipe), *small], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert "⟨τ⟩" in done.stdout
    assert list((tmp_path / "results").glob("*/figures/*.png")), done.stdout


def test_the_readme_has_the_commands_for_the_figure_and_the_tests():
    text = (ROOT / "README.md").read_text()
    assert "scripts/fig3" in text
    assert "scripts/test " in text
    assert "10.1103/PhysRevLett.107.024301" in text
    assert len(commands(ROOT / "docs" / "guide.md")) > 8


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_lines_outside_tables_have_at_most_120_characters(page):
    for number, line in enumerate(page.read_text().splitlines(), 1):
        assert len(line) <= 120 or line.startswith("|"), f"{name(page)}:{number}: {len(line)} characters"


def anchors(page):
    """The anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)[^)]*\)", page.read_text()):
        path, _, anchor = target.partition("#")
        if path.startswith(("http://", "https://")):
            continue
        linked = page.parent / path if path else page
        assert linked.exists(), f"{name(page)} links to {target}"
        assert not anchor or anchor in anchors(linked), f"{name(page)} links to {target}"


def test_pages_named_in_sources_exist():
    folders = ("src", "crates", "scripts", "sweeps", "python", "tests")
    files = [
        file for folder in folders for file in (ROOT / folder).rglob("*") if file.suffix in ("", ".rs", ".py", ".toml")
    ]
    assert len(files) > 100
    for file in files:
        if file.is_file() and "__pycache__" not in file.parts:
            for page in re.findall(r"docs/[\w-]+\.md", file.read_text(errors="replace")):
                assert (ROOT / page).exists(), f"{name(file)} names {page}"
