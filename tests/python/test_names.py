"""What comments, code and documentation name is there: tests, files, columns, and the steps of docs/development.md."""

import json
import re
from functools import cache

import pytest
from conftest import ROOT

SOURCES = {
    path: path.read_text()
    for folder in ("src", "crates", "python", "tests", "benches", "scripts")
    for path in sorted((ROOT / folder).rglob("*"))
    if path.is_file() and path.suffix in ("", ".rs", ".py", ".js")
}
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "results" / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
#: A name of several words.
NAME = r"[a-z]{2}\w*_\w*[a-z0-9]"


def name(path):
    return path.relative_to(ROOT).as_posix()


def comments(path):
    """The comments of a source file."""
    mark = r"//" if path.suffix in (".rs", ".js") else r"#"
    return "\n".join(re.findall(rf"(?:^|\s){mark}.*", SOURCES[path]))


@cache
def code():
    """All words of code, without comments."""
    words = set()
    for path, text in SOURCES.items():
        mark = r"//" if path.suffix in (".rs", ".js") else r"#"
        words |= set(re.findall(r"\w+", re.sub(rf"(^|\s){mark}.*", "", text)))
    return words


@cache
def columns():
    """Every column of a table, by docs/tables.md, which a test compares with the code."""
    found = set()
    for names in re.findall(r"^- (`.*?)(?: \(|:)", (ROOT / "docs" / "tables.md").read_text(), re.M):
        for column, has_interval in re.findall(r"`(\w+)`( ±)?", names):
            found |= {column, f"{column}_low", f"{column}_high"} if has_interval else {column}
    return found


def keys(schema):
    """All keys that a JSON Schema allows."""
    if isinstance(schema, dict):
        return set(schema.get("properties", {})) | {key for part in schema.values() for key in keys(part)}
    return {key for part in schema for key in keys(part)} if isinstance(schema, list) else set()


def test_every_test_and_function_that_a_comment_names_exists():
    for path in SOURCES:
        # Shorter words may be formulas, such as f_s.
        for word in re.findall(r"\b[a-z0-9]+(?:_[a-z0-9]+){3,}\b", comments(path)):
            assert word in code(), f"{name(path)}: a comment names {word}"


def test_every_file_that_a_comment_or_a_page_names_exists():
    texts = {path: comments(path) for path in SOURCES} | {page: page.read_text() for page in DOCUMENTS}
    for path, text in texts.items():
        for file in re.findall(r"\b(?:crates/physics/)?(?:src|tests|docs|sweeps|scripts|python|benches)/[\w./-]*\w\.(?:rs|py|md|toml|json|js)\b", text):
            assert any((folder / file).exists() for folder in (ROOT, path.parent)), f"{name(path)} names {file}"


def test_every_column_that_the_code_names_by_a_string_exists():
    known = columns() | keys(json.loads((ROOT / "docs" / "sweep.schema.json").read_text()))
    # Keys of footers.
    known |= set(re.findall(r"`(\w+)`", (ROOT / "docs" / "results.md").read_text()))
    found = 0
    for path, text in SOURCES.items():
        if path.suffix != ".rs" or not name(path).startswith("src/") or "/tests/" in name(path):
            continue
        text = text.partition("#[cfg(test)]\nmod tests")[0]
        # Columns of accuracy.json, and fields of JSON, which are named where they are made.
        made = set(re.findall(r'(\w+): (?:f64|u64|Option)|as "(\w+)"|"(\w+)"(?::|\] =)', text))
        allowed = known | {one for names in made for one in names}
        # Attributes name functions, features and fields.
        for word in re.findall(rf'"({NAME})"', re.sub(r"#!?\[[^\]]*\]", "", text)):
            found += 1
            assert word in allowed, f"{name(path)} names the column {word}"
    assert found > 100


@pytest.mark.parametrize("page", DOCUMENTS, ids=name)
def test_every_name_in_code_font_on_a_page_exists(page):
    for word in re.findall(rf"`({NAME})`", page.read_text()):
        # Words of an enum are written so.
        variant = "".join(part.capitalize() for part in word.split("_"))
        assert word in columns() or {word, variant} & code(), f"{name(page)} names {word}"


#: Of Rust, and a command.
OF_THE_LANGUAGE = {"Option", "None", "show"}


def declaration(word):
    """What declares a name in Rust or Python: an item, a method, a macro or its call, a value, a row of `fields!`."""
    name = word.rpartition("::")[2]
    if name.endswith("!"):
        return rf"macro_rules! {name[:-1]}\b|\b{name} *[({{]"
    items = "fn|struct|enum|trait|type|const|static|mod|def|class"
    return rf"\b(?:{items}) {name}\b|(?m:^{name}(?:: [^=]+)? = )|\w\(\"{name}\""


RECIPES = re.findall(r"^- \*\*(.*?):\*\* ((?:.*\n)(?:  .*\n)*)", (ROOT / "docs" / "development.md").read_text(), re.M)


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe[0])
def test_the_steps_of_a_recipe_name_what_is_there(recipe):
    """Every file of a recipe exists, and every name is declared in one of its files, or in the file of a folder."""
    assert len(RECIPES) == 11
    files = []
    for word in re.findall(r"`([^`]+)`", recipe[1]):
        if "/" in word or word == "sweeps":
            assert (ROOT / word).exists(), f"{word} is not there"
            files.append(ROOT / word)
        elif re.fullmatch(r"(?:\w+::)?\w+!?", word) and word not in OF_THE_LANGUAGE:
            around = [ROOT / file for file in re.findall(r"`([^`]+/[^`]+)`", recipe[1])]
            texts = [one.read_text() for file in around for one in ([file] if file.is_file() else file.glob("*.rs"))]
            assert any(re.search(declaration(word), text) for text in texts), f"none of these files declares {word}"
    assert files
