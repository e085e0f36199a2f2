"""The documentation as scripts/docs builds it: it opens from disk, every link leads somewhere, and search finds."""

import ast
import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from conftest import ROOT

PICTURES = [*ROOT.glob("results/*.png"), *ROOT.glob("docs/*.png"), *ROOT.glob("docs/*.svg")]
LOADED = {"img": "src", "link": "href", "script": "src"}


class Page(HTMLParser):
    """The anchors of a page, its links, and what it loads."""

    def __init__(self, path):
        super().__init__()
        self.path, self.anchors, self.links, self.loaded = path, set(), [], []
        self.feed(path.read_text())

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.anchors.add(attributes.get("id"))
        if tag == "a" and "href" in attributes:
            self.links.append(attributes["href"])
        if attributes.get(LOADED.get(tag)):
            self.loaded.append(attributes[LOADED[tag]])

    def inner(self):
        """The files and anchors within the site that it links to and loads."""
        for link in map(urlsplit, self.links + self.loaded):
            if not link.scheme:
                yield (self.path.parent / unquote(link.path)).resolve() if link.path else self.path, unquote(link.fragment)


def build(root):
    return subprocess.run([root / "scripts" / "docs"], capture_output=True, text=True, timeout=600)


@pytest.fixture(scope="module")
def site():
    done = build(ROOT)
    assert done.returncode == 0, done.stdout + done.stderr
    return ROOT / "target" / "site"


@pytest.fixture(scope="module")
def pages(site):
    return {path: Page(path) for path in site.rglob("*.html")}


@pytest.fixture
def show(browser, site):
    def show(page):
        browser.driver.get((site / page).as_uri())
        browser.wait("document.readyState === 'complete'")

    return show


def documents():
    """The pages that people read, not those of code."""
    return ["index.html", *sorted(f"docs/{page.stem}.html" for page in ROOT.glob("docs/*.md")), "docs/python.html"]


def test_every_link_leads_to_a_file_and_to_an_anchor_in_it(pages):
    dead = [
        f"{page.path}: {file}#{anchor}"
        for page in pages.values()
        for file, anchor in page.inner()
        if not file.exists() or (anchor and anchor not in pages[file].anchors)
    ]
    assert dead == []
    assert sum(1 for page in pages.values() for _ in page.inner()) > 2000


def test_every_page_is_reached_from_the_home_page(site, pages):
    reached, ahead = set(), [site / "index.html"]
    while ahead:
        file = ahead.pop()
        if file in pages and file not in reached:
            reached.add(file)
            ahead += [linked for linked, _ in pages[file].inner()]
    assert reached == set(pages)
    assert {(site / document) for document in documents()} < reached


def test_nothing_comes_from_the_network(browser, site, show, pages):
    for page in pages.values():
        assert [source for source in page.loaded if urlsplit(source).scheme or source.startswith("//")] == [], page.path
    for style in site.rglob("*.css"):
        assert re.findall(r"(?:url\(|@import)\s*[\"']?(?:https?:)?//", style.read_text()) == [], style
    for document in documents():
        show(document)
        loaded = browser.run("return performance.getEntriesByType('resource').map(({ name }) => name)")
        assert [source for source in loaded if not source.startswith(("file:", "data:", "blob:"))] == [], document


def test_every_picture_stands_in_the_gallery_with_the_command_that_draws_it(browser, site, show):
    show("results/gallery.html")
    items = browser.run(
        """return [...document.querySelectorAll("article li:has(img)")].map((item) => ({
            source: item.querySelector("img").src, width: item.querySelector("img").naturalWidth,
            commands: [...item.querySelectorAll("code")].map((code) => code.innerText) }));"""
    )
    gallery = {Path(unquote(urlsplit(item["source"]).path)).relative_to(site).as_posix(): item for item in items}
    assert set(gallery) == {picture.relative_to(ROOT).as_posix() for picture in PICTURES} and len(items) == len(gallery)
    reproduce = (ROOT / "scripts" / "reproduce").read_text()
    for picture, item in gallery.items():
        assert item["width"] > 300, picture
        if not item["commands"]:
            assert Path(picture).parent.name == "docs" and any(Path(picture).name in page.read_text() for page in ROOT.glob("docs/*.md"))
            continue
        script, _, name = item["commands"][0].partition(" ")
        assert script in ("python", "scripts/predicted-cost", "scripts/reproduce", "scripts/sketch", "stickslip"), picture
        if script == "scripts/reproduce":
            assert (ROOT / "sweeps" / f"{name}.toml").exists(), picture
            drawn = re.search(rf'\[{name}\]="([^"]+)"', reproduce)
            assert Path(picture).stem in ([one.partition(":")[2] for one in drawn[1].split()] if drawn else [name])


def test_pictures_in_pages_load(browser, show):
    for document in documents():
        show(document)
        assert browser.run("return [...document.images].filter((image) => !image.naturalWidth).map(({ src }) => src)") == []


@pytest.mark.parametrize("word, page", [("resultant", "model.html"), ("to_polars", "python.html"), ("walltime", "commands.html")])
def test_search_finds_a_word(browser, show, word, page):
    show("docs/guide.html")
    browser.type("input.md-search__input", word)
    browser.wait("document.querySelectorAll('.md-search-result__item').length")
    found = browser.run("return [...document.querySelectorAll('a.md-search-result__link')].map(({ href }) => href)")
    assert any(page in link for link in found), found
    browser.driver.get(next(link for link in found if page in link))
    assert word in browser.text("article")


def test_the_python_reference_has_every_public_name_with_its_words(browser, show):
    package = ast.parse((ROOT / "python" / "stickslip" / "__init__.py").read_text())
    public = next(ast.literal_eval(node.value) for node in package.body if isinstance(node, ast.Assign))
    show("docs/python.html")
    words = """const heading = document.getElementById(arguments[0]);
        return [...heading?.parentElement.querySelectorAll(":scope > .doc-contents > p") ?? []].map((p) => p.innerText)"""
    for name in [*public, "open"]:
        assert any(len(text) > 20 for text in browser.run(words, f"stickslip.{name}")), name
    for name in ("Results.slips", "Simulation.job", "Table.units", "Progress.share", "statistics.mean", "figures.Plot.intervals"):
        assert browser.run(words, f"stickslip.{name}"), name


@pytest.mark.parametrize("is_dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [380, 1280])
def test_pages_fit_their_window(browser, show, width, is_dark):
    browser.window(width, 900, is_dark=is_dark)
    for document in [*documents(), "results/gallery.html", "sweeps/fig3.toml.html"]:
        show(document)
        assert browser.run("return document.documentElement.scrollWidth") <= width, document
    colour = browser.run("return getComputedStyle(document.body).backgroundColor")
    assert (colour == "rgb(255, 255, 255)") != is_dark


@pytest.mark.parametrize("link", ["gone.md", "model.md#gone", "../sweeps/gone.toml"])
def test_a_link_that_leads_nowhere_fails_the_build(site, tmp_path, link):
    for entry in ROOT.iterdir():
        if entry.name not in ("docs", "target"):
            (tmp_path / entry.name).symlink_to(entry)
    shutil.copytree(ROOT / "docs", tmp_path / "docs")
    (tmp_path / "target").mkdir()
    (tmp_path / "target" / "docs-tools").symlink_to(ROOT / "target" / "docs-tools")
    with (tmp_path / "docs" / "guide.md").open("a") as guide:
        guide.write(f"\n[somewhere]({link})\n")
    done = build(tmp_path)
    assert done.returncode != 0 and "gone" in done.stderr, done.stdout + done.stderr
