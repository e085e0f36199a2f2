"""The parts of the validation document, and how they are written as Markdown."""

import textwrap
from dataclasses import dataclass, field

#: Longest line of text in characters; rows of tables are longer.
WIDTH = 120


@dataclass(frozen=True)
class Check:
    """Measured numbers against one sentence of the paper."""

    claim: str
    criterion: str
    measured: str
    #: Whether each of them meets the criterion.
    agrees: tuple[bool, ...]

    def row(self) -> dict:
        """Its row of a table."""
        agrees = "yes" if all(self.agrees) else "in part" if any(self.agrees) else "**no**"
        return {"claim: criterion": f"{self.claim}: {self.criterion}", "measured": self.measured, "agrees": agrees}


@dataclass(frozen=True)
class Verdict:
    """What is to be said of a statement: "holds", "holds for ...", "holds in part", "restates ..."; and why."""

    word: str
    reason: str = ""


@dataclass
class Section:
    """A statement of the paper, or a question beyond it."""

    title: str
    #: The sweep files that it is measured with.
    source: str
    #: Pictures in results/, by the stems of their names.
    pictures: tuple[str, ...] = ()
    checks: list[Check] = field(default_factory=list)
    #: Of a table: the cells of each row by the heads of their columns.
    rows: list[dict] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    #: Where the checks alone do not say it.
    verdict: Verdict | None = None

    def summary(self) -> dict:
        """Its row of the table of verdicts."""
        agrees = all(all(check.agrees) for check in self.checks)
        verdict = self.verdict or Verdict("holds" if agrees else "does not hold")
        return {"statement": self.title, "verdict": verdict.word, "why": verdict.reason}

    def check(self, claim: str, criterion: str, measured: str, *agrees: bool) -> None:
        """Adds a check."""
        self.checks.append(Check(claim, criterion, measured, tuple(map(bool, agrees))))

    def remark(self, *sentences: str) -> None:
        """Adds a paragraph."""
        self.remarks.append(paragraph(*sentences))

    def item(self, *sentences: str) -> None:
        """Adds an item of a list."""
        self.remarks.append("- " + textwrap.indent(paragraph(*sentences, width=WIDTH - 2), "  ").lstrip())

    def markdown(self) -> str:
        """The section, with the checks before the table."""
        parts = [f"### {self.title}", f"From {self.source}."]
        parts += [f"![{picture}](../results/{picture}.png)" for picture in self.pictures]
        if self.checks:
            parts.append(table([check.row() for check in self.checks]))
        if self.rows:
            parts.append(table(self.rows))
        return "\n\n".join(parts + self.remarks)


def paragraph(*sentences: str, width: int = WIDTH) -> str:
    """Sentences on lines of their own, wrapped where they are longer than a line."""
    return "\n".join(textwrap.fill(one, width, break_long_words=False, break_on_hyphens=False) for one in sentences)


def table(rows: list[dict]) -> str:
    """A table; each row holds its cells by the heads of their columns."""
    head, *lines = (
        "| " + " | ".join(str(cell).replace("|", "\\|") for cell in line) + " |"
        for line in (rows[0], *(row.values() for row in rows))
    )
    return "\n".join([head, "|" + "---|" * len(rows[0]), *lines])
