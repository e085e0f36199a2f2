"""Imports run one way, between folders and between files: as src/lib.rs says."""

import re
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = [ROOT / "src", ROOT / "crates/physics/src", ROOT / "python/src"]


def resolved(source: Path, path: list[str]) -> Path | None:
    """The file that a path from the root of a crate names: of its first segments, those that are modules."""
    found = None
    folder = source
    for segment in path:
        here = [folder / f"{segment}.rs", folder / segment / "mod.rs"]
        if not (files := [file for file in here if file.exists()]):
            break
        found, folder = files[0], folder / segment
    return found


def sources(source: Path) -> set[Path]:
    """All files that are not of tests alone."""
    of_tests = {"tests", "documented"}
    return {file for file in source.rglob("*.rs") if of_tests.isdisjoint(file.relative_to(source).with_suffix("").parts)}


def imports(source: Path, file: Path) -> set[Path]:
    """The files that one names outside its tests."""
    text = re.sub(r"//.*", "", file.read_text())
    if (tests := re.search(r"#\[cfg\(test\)\]\n(?:pub(?:\(\w+\))? )?mod tests \{", text)) is not None:
        text = text[: tests.start()]
    own = list(file.relative_to(source).with_suffix("").parts)
    module = own[:-1] if own[-1] in ("mod", "lib", "main") else own
    named = set()
    for start, path in re.findall(r"\b(crate|(?:super::)*super)::(\w+(?:::\w+)*)", text):
        base = [] if start == "crate" else module[: len(module) - start.count("super")]
        named.add(resolved(source, base + path.split("::")))
    return named - {None, file}


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: str(source.relative_to(ROOT)))
def test_no_files_import_each_other_in_a_circle(source: Path):
    """But for each `mod.rs`, which may know its children, as they may know it."""
    files = {file for file in sources(source) if file.name != "mod.rs"}
    graph = {file: imports(source, file) & files for file in files}
    assert any(graph.values())
    list(TopologicalSorter(graph).static_order())


def test_no_folders_import_each_other_in_a_circle():
    source = ROOT / "src"
    folder = lambda file: file.relative_to(source).with_suffix("").parts[0]
    folders: dict[str, set[str]] = {}
    for file in sources(source):
        others = {folder(other) for other in imports(source, file)} - {folder(file), "lib"}
        folders.setdefault(folder(file), set()).update(others)
    order = list(TopologicalSorter(folders).static_order())
    assert order.index("table") < order.index("sweep") < order.index("results") < order.index("reduce") < order.index("run")
