"""The parts of the validation document, and how they are written as Markdown."""

import re
import textwrap
from dataclasses import dataclass, field

#: Longest line of text in characters; rows of tables are longer.
WIDTH = 120

#: What each picture shows.
CAPTIONS = {
    "fig2": "Intervals between slips at Δ = 0, 29 and 58 Hz: our counterpart of Fig. 2d to f",
    "fig3-tau-T": "Intervals in periods against the period",
    "fig3-phase": "Slip phases against η with the backbone of Eq. 2: our counterpart of Fig. 3e",
    "drive-alone": "Excess of the resultant length over the drive alone against η, by velocity and amplitude",
    "friction": "Intervals, friction, slip share and resultant length against the amplitude",
    "fig4d": "A precursor from the trailing edge and the slip after it: our counterpart of Fig. 4d",
    "drag": "Intervals on a ramp of the period, which rises and falls",
    "drag-strong": "Intervals on the ramp at three times the amplitude",
    "locking-map": "Periods per slip, locking index and excess over frequency and amplitude",
    "staircase": "Median interval in periods against the period, at three amplitudes",
    "size": "Statistics of slips by the number of blocks",
    "contacts": "Statistics of slips by the number of contacts per block",
    "disorder": "Statistics of slips by the spread of the thresholds",
    "stiff-drive-phase": "Slip phases against η with a stiff drive, and the backbone of Eq. 2",
    "triggering": "Advance of slips against where in the interval a pulse begins, and triggered slips",
    "tide-phase": "Mean phase of slips against the period over the interval of the control",
    "tide-excess": "Excess of the resultant length against the period over the interval of the control",
    "correlation": "Resultant length against η at four amplitudes, beside random loads and the drive alone",
    "weakening-threshold": "Where friction has fallen by 20 %: amplitude, velocity, acceleration",
    "weakening": "Mean friction against the amplitude at five frequencies",
    "weakening-velocity": "Mean friction against amplitude times frequency, at five frequencies",
}


@dataclass
class Section:
    """A statement of the paper, or a question beyond it."""

    #: Begins with the number of a statement.
    title: str
    #: The sweep files that it is measured with, and what is to be said of them.
    source: str
    #: Pictures in results/, by the stems of their names.
    pictures: tuple[str, ...] = ()
    #: Rows of the table of checks: measured numbers against one sentence of the paper each; and whether each number agrees.
    checks: list[dict] = field(default_factory=list)
    agrees: list[bool | None] = field(default_factory=list)
    #: Of a table: the cells of each row by the heads of their columns.
    rows: list[dict] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    #: Where the checks alone do not say it, as in "restates ..."; what qualifies it; and why.
    verdict: str = ""
    note: str = ""
    why: str = ""

    def summary(self) -> dict:
        """Its row of the table of verdicts."""
        word = (
            "holds" if all(self.agrees)
            else "holds in part" if True in self.agrees
            else "does not hold" if False in self.agrees
            else "is undecided"
        )
        return {"statement": self.title, "verdict": (self.verdict or word) + self.note, "why": self.why}

    def check(self, claim: str, criterion: str, measured: str, *agrees: bool | None) -> None:
        """`claim` is empty where the criterion says it; `agrees` are whether each number meets it, None if undecided."""
        # Nothing to compare decides nothing.
        agrees = agrees or (None,)
        self.agrees += agrees
        claim = self.number() + ": ".join(filter(None, (claim, criterion)))
        words = {True: "yes", False: "**no**", None: "undecided"}
        word = "in part" if len(set(agrees)) > 1 else words[agrees[0]]
        self.checks.append({"claim: criterion": claim, "measured": measured, "agrees": word})

    def remark(self, *sentences: str) -> None:
        self.remarks.append(paragraph(*sentences))

    def item(self, *sentences: str) -> None:
        self.remarks.append(item(*sentences))

    def number(self) -> str:
        """The number of the statement, as in "12. "."""
        return next(iter(re.findall(r"^\d+\. ", self.title)), "")

    def markdown(self) -> str:
        return figure(self.title, [self])


def figure(title: str, sections: list[Section]) -> str:
    """Statements on the same figure: pictures, a list of all checks, tables, remarks."""
    sources = "; ".join(dict.fromkeys(section.source for section in sections))
    parts = [f"### {title}", paragraph(f"From {sources}.")]
    pictures = (picture for section in sections for picture in section.pictures)
    parts += [f"![{CAPTIONS[picture]}](../results/{picture}.png)" for picture in pictures]
    checks = [checked(check) for section in sections for check in section.checks]
    parts += ["\n".join(checks)] if checks else []
    parts += [table(section.rows) for section in sections if section.rows]
    return "\n\n".join([*parts, *(remark for section in sections for remark in section.remarks)])


def checked(check: dict) -> str:
    """A check as an item of a list, which must not begin as a numbered one."""
    claim = re.sub(r"^(\d+)\. ", r"\1: ", check["claim: criterion"])
    return item(f"{claim}. *{check['agrees'].strip('*')}:* {check['measured']}")


def item(*sentences: str) -> str:
    """An item of a list."""
    return "- " + textwrap.indent(paragraph(*sentences, width=WIDTH - 2), "  ").lstrip()


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
