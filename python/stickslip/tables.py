"""Tables, reduced data and footers of what stickslip writes, as pandas frames. Columns are in docs/tables.md."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import pandas
import pyarrow.parquet

from .results import Results, Table


class MissingResult(Exception):
    """A result that is not there, with the command that makes it."""


@dataclass(frozen=True)
class Sweep:
    """The results directory of one sweep. Each table is read once; do not change the frames in place."""

    directory: Path

    @cache
    def table(self, name: str) -> pandas.DataFrame:
        """`slips`, `precursors` or `jobs`; one that is damaged raises `ResultsError`."""
        return without_units(self._checked(name).to_pandas())

    @cache
    def reduced(self, name: str) -> pandas.DataFrame:
        """Reduced data, such as `sets`."""
        return read(self.directory / "reduced" / f"{name}.parquet", f"stickslip reduce {self.directory}")

    @cache
    def sets(self) -> pandas.DataFrame:
        """The reduced sets without those that were run as controls alone."""
        sets = self.reduced("sets")
        return sets[~sets["control"]]

    @cache
    def slips(self) -> pandas.DataFrame:
        """The slips of these sets with all parameters of their jobs, `frequency` = 1/T in Hz and `tau_over_T` = interval/T."""
        slips = without_units(self._checked("slips", join=True).to_pandas())
        slips = slips[slips["set_id"].isin(self.sets()["set_id"])]
        return slips.assign(frequency=(1 / slips["T"]).round(6), tau_over_T=slips["interval"] / slips["T"])

    def _checked(self, name: str, **options: bool) -> Table:
        if not (self.directory / "tables" / "jobs").exists():
            raise MissingResult(f"{self.directory}: run `stickslip run sweeps/{self.directory.name}.toml`")
        return getattr(Results(self.directory), name)(**options)


def read(path: Path, remedy: str) -> pandas.DataFrame:
    """A file; `remedy` is the command that makes it."""
    if not path.exists():
        raise MissingResult(f"{path} is missing: run `{remedy}`")
    return without_units(pandas.read_parquet(path))


def without_units(frame: pandas.DataFrame) -> pandas.DataFrame:
    """The frame without units and meanings, which pandas copies with each selection: a third of the time of statistics."""
    frame.attrs.clear()
    return frame


def parameters(file: Path) -> dict:
    """The parameters in the footer of what `stickslip simulate` wrote, by symbol; empty if there are none."""
    footer = pyarrow.parquet.read_metadata(file).metadata or {}
    return json.loads(footer.get(b"parameters", b"{}"))


def select(frame: pandas.DataFrame, **values: float | str) -> pandas.DataFrame:
    """The rows with these values in columns of these names; numbers agree to a part in a million."""
    for column, value in values.items():
        same = frame[column] == value if isinstance(value, str) else (frame[column] - value).abs() <= 1e-6 * abs(value)
        frame = frame[same]
    return frame
