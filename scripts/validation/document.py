"""The validation document: sections of checks and findings, and how they are written as Markdown."""

from dataclasses import dataclass, field


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
    source: str
    picture: str | None = None
    checks: list[Check] = field(default_factory=list)
    table: tuple[list[str], list[list[str]]] | None = None
    remarks: list[str] = field(default_factory=list)

    def check(self, claim: str, criterion: str, measured: str, agrees) -> None:
        self.checks.append(Check(claim, criterion, measured, bool(agrees)))

    def markdown(self) -> str:
        parts = [f"### {self.title}", f"From {self.source}."]
        if self.picture:
            parts.append(f"![{self.title}](../results/{self.picture}.png)")
        if self.checks:
            rows = [[c.claim, c.criterion, c.measured, "yes" if c.agrees else "**no**"] for c in self.checks]
            parts.append(table(["the paper says", "agrees if", "measured", "agrees"], rows))
        if self.table:
            parts.append(table(*self.table))
        parts.extend(self.remarks)
        return "\n\n".join(parts)


def table(head: list[str], rows: list[list[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell).replace("|", "\\|") for cell in line) + " |" for line in lines)
