"""The parts of the validation document, and how they are written as Markdown."""

import textwrap
from dataclasses import dataclass, field

#: Longest line of text in characters; rows of tables are longer.
WIDTH = 120


@dataclass(frozen=True)
class Check:
    """One number against one sentence of the paper."""

    claim: str
    criterion: str
    measured: str
    agrees: bool


@dataclass
class Section:
    """A statement of the paper, or a question beyond it."""

    title: str
    #: The sweep files that it is measured with.
    source: str
    #: A picture in results/, by the stem of its name.
    picture: str | None = None
    checks: list[Check] = field(default_factory=list)
    table: tuple[list[str], list[list]] | None = None
    remarks: list[str] = field(default_factory=list)

    def check(self, claim: str, criterion: str, measured: str, agrees: bool) -> None:
        """Adds a check."""
        self.checks.append(Check(claim, criterion, measured, bool(agrees)))

    def remark(self, *sentences: str) -> None:
        """Adds a paragraph."""
        self.remarks.append(paragraph(*sentences))

    def item(self, *sentences: str) -> None:
        """Adds an item of a list."""
        self.remarks.append("- " + textwrap.indent(paragraph(*sentences, width=WIDTH - 2), "  ").lstrip())

    def markdown(self) -> str:
        """The section, with the checks before the table."""
        parts = [f"### {self.title}", f"From {self.source}."]
        if self.picture:
            parts.append(f"![{self.title}](../results/{self.picture}.png)")
        if self.checks:
            rows = [[c.claim, c.criterion, c.measured, "yes" if c.agrees else "**no**"] for c in self.checks]
            parts.append(table(["the paper says", "agrees if", "measured", "agrees"], rows))
        if self.table:
            parts.append(table(*self.table))
        return "\n\n".join(parts + self.remarks)


def paragraph(*sentences: str, width: int = WIDTH) -> str:
    """Sentences on lines of their own, wrapped where they are longer than a line."""
    return "\n".join(textwrap.fill(one, width, break_long_words=False, break_on_hyphens=False) for one in sentences)


def table(head: list[str], rows: list[list]) -> str:
    """A table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell).replace("|", "\\|") for cell in line) + " |" for line in lines)
