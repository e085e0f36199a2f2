"""What the site is made of: the documents, the files that they link to as pages of code, and two pages of its own, the
gallery and the Python reference. All in the layout of the repository, so that relative links hold.
"""

import ast
import json
import posixpath
import re
from pathlib import Path

from markdown import Extension
from markdown.preprocessors import Preprocessor
from mkdocs.structure.files import File

ROOT = Path(__file__).resolve().parents[2]
PICTURES = [*sorted(ROOT.glob("docs/*.svg")), *sorted(ROOT.glob("docs/*.png")), *sorted(ROOT.glob("results/*.png"))]
LANGUAGES = {".cff": "yaml", ".json": "json", ".py": "python", ".rs": "rust", ".toml": "toml"}
LINK = re.compile(r"(?<=\]\()(?!https?://)([^)#\s]+)")


def name(path):
    return path.relative_to(ROOT).as_posix()


def on_config(config):
    """The groups at the end of README.md, and what it cannot link to."""
    end = (ROOT / "README.md").read_text().partition("\n## Documentation\n")[2]
    groups = {
        group: [{text[0].upper() + text[1:]: page(target)} for text, target in re.findall(r"\[(.+?)\]\((.+?)\)", links)]
        for group, links in re.findall(r"^- \*\*(.+):\*\* (.*(?:\n  .*)*)", end, re.M)
    }
    groups["Look up"] += [{"Python": "docs/python.md"}, {"Gallery": "results/gallery.md"}]
    config.nav = [{"Home": "README.md"}, *({group: pages} for group, pages in groups.items()), {"Changes": "CHANGELOG.md"}]
    config.markdown_extensions.append(TextOnly())
    # From disk nobody gets a 404, whose links are absolute.
    config.theme.static_templates.clear()


class Examples(Preprocessor):
    """Examples in docstrings are code."""

    def run(self, lines):
        prompts = re.compile(r"^((?:>>>|\.\.\.) .*\n?)+", re.M)
        return prompts.sub(lambda code: f"```pycon\n{code[0].rstrip()}\n```\n", "\n".join(lines)).split("\n")


class TextOnly(Extension):
    """What looks like a tag is text, such as `<exp(iφ)>`: as on GitHub, and no page has tags."""

    def extendMarkdown(self, md):
        md.preprocessors.deregister("html_block")
        md.inlinePatterns.deregister("html")
        md.ESCAPED_CHARS.append("<")
        # Before code in fences is looked for.
        md.preprocessors.register(Examples(md), "examples", 28)


def on_files(files, config):
    for file in [file for file in files if file.src_dir == config.docs_dir]:
        files.remove(file)
    documents = [ROOT / "README.md", ROOT / "CHANGELOG.md", *ROOT.glob("docs/*.md")]
    texts = {name(path): path.read_text() for path in documents}
    texts |= {"results/gallery.md": gallery(), "docs/python.md": python()}
    linked = {
        posixpath.normpath(posixpath.join(posixpath.dirname(source), target))
        for source, text in texts.items()
        for target in LINK.findall(text)
    }
    texts = {source: LINK.sub(lambda link: page(link[0]), text) for source, text in texts.items()}
    while linked:
        path = ROOT / linked.pop()
        if path.exists() and path not in PICTURES and page(name(path)) not in texts:
            texts[page(name(path))] = shown(path)
            linked |= {name(file) for file in path.iterdir()} if path.is_dir() else set()
    for source, text in texts.items():
        files.append(File.generated(config, source, content=text))
    for path in [*PICTURES, *Path(__file__).parent.glob("*.css"), *Path(__file__).parent.glob("*.js")]:
        files.append(File.generated(config, name(path).removeprefix("docs/site/"), abs_src_path=str(path)))
    return files


def page(target):
    """The page that shows a file, or a folder."""
    return target if target.endswith((".md", ".png", ".svg")) else f"{target}.md"


def shown(path):
    """A file or a folder as a page; search leaves out all but the notebook."""
    if path.suffix == ".ipynb":
        cells = [(cell["cell_type"], "".join(cell["source"])) for cell in json.loads(path.read_text())["cells"]]
        return "\n\n".join(text if kind == "markdown" else f"```python\n{text}\n```" for kind, text in cells)
    if path.is_dir():
        shown = "\n".join(f"- [{file.name}]({page(f'{path.name}/{file.name}')})" for file in sorted(path.iterdir()))
    else:
        shown = f"````{LANGUAGES.get(path.suffix, 'text')}\n{path.read_text()}\n````"
    return f"---\ntitle: {path.name}\nsearch: {{exclude: true}}\n---\n\n# `{name(path)}`\n\n{shown}\n"


def gallery():
    """Every picture with what its sweep file says of it, or else results/README.md, and the command that draws it."""
    sweeps = dict(line.split()[:2] for line in (ROOT / "results" / "pictures.txt").read_text().splitlines())
    others = re.findall(r"^\| `(\S+\.(?:png|svg))` \| (.+?) \| (.+) \|$", (ROOT / "results" / "README.md").read_text(), re.M)
    others = {picture: about for picture, *about in others}
    text = "# Gallery\n\nEvery picture, and the command that draws it in a clone of the repository.\n\n"
    for picture in PICTURES:
        link = posixpath.relpath(name(picture), "results")
        if sweep := sweeps.get(link):
            file = f"sweeps/{sweep}.toml"
            comment = re.match(r"(?:# .*\n)+", (ROOT / file).read_text())[0]
            about = comment.removeprefix("# ").replace("\n# ", " ").strip()
            command = f"`scripts/reproduce {sweep}` ([sweep](../{file}))"
        else:
            about, command = others[link]
        text += f"- [![{about}]({link})]({link})\n\n    **{picture.stem}.** {about}\n\n    {command}\n\n"
    return text


def python():
    """What the package imports, what is used most first, and its further modules."""
    package = ast.parse((ROOT / "python" / "stickslip" / "__init__.py").read_text())
    imports = [one for node in package.body if isinstance(node, ast.ImportFrom) for one in node.names]
    names = [one.asname or one.name for one in imports]
    return (
        "# Python\n\n::: stickslip\n    options: {members: false, show_root_heading: false}\n\n"
        "`simulate` takes as `keys` the [parameters](model.md#parameters) and what sweep files have in\n"
        "[`[record]`](sweeps.md#record) and [`[solver]`](sweeps.md#solver).\n\n"
        + "".join(f"::: stickslip.{one}\n\n" for one in reversed(names))
        + "::: stickslip.figures.Plot\n\n::: stickslip.statistics\n\n::: stickslip.tables\n"
    )
