"""The tables that a validation reads, and where each comes from."""

import json
from functools import cache
from pathlib import Path

import duckdb
import pandas


class Missing(Exception):
    """A result that is not there, with the command that makes it."""


class Results:
    """Results directories below one folder, read once each."""

    def __init__(self, root: Path):
        self.root = root

    def _read(self, path: Path, remedy: str) -> pandas.DataFrame:
        if not path.exists():
            raise Missing(f"{path}: not there; `{remedy}` makes it")
        return pandas.read_parquet(path)

    @cache
    def table(self, sweep: str, table: str) -> pandas.DataFrame:
        """A table of a sweep: `slips`, `precursors` or `jobs`."""
        return self._read(self.root / sweep / "tables" / table, f"stickslip run sweeps/{sweep}.toml")

    @cache
    def reduced(self, sweep: str, table: str) -> pandas.DataFrame:
        """A reduced table of a sweep, such as `sets`."""
        return self._read(self.root / sweep / "reduced" / f"{table}.parquet", f"stickslip reduce results/{sweep}")

    @cache
    def slips(self, sweep: str) -> pandas.DataFrame:
        """The slips of a sweep with every parameter of their jobs, the frequency 1/T in Hz and the ratio τ/T."""
        jobs = self.table(sweep, "jobs")
        slips = self.table(sweep, "slips")
        others = ["job_id", *jobs.columns.difference(slips.columns)]
        slips = slips.merge(jobs[others], on="job_id")
        slips["frequency"] = (1 / slips["T"]).round(6)
        slips["periods"] = slips["interval"] / slips["T"]
        return slips

    @cache
    def simulation(self, name: str, record: str) -> pandas.DataFrame:
        """What a single simulation wrote: `trace`, `map` or `profile`."""
        return self._read(self.root / name / f"{record}.parquet", "scripts/reproduce")

    @cache
    def parameters(self, name: str, record: str) -> dict:
        """The parameters of a single simulation, from the footer of its record."""
        path = self.root / name / f"{record}.parquet"
        query = "select decode(value) from parquet_kv_metadata(?) where decode(key) = 'parameters'"
        return json.loads(duckdb.execute(query, [str(path)]).fetchall()[0][0])


def of(frame: pandas.DataFrame, **values) -> pandas.DataFrame:
    """The rows with these values; numbers to a part in a million, `None` for a value that is not there."""
    for column, value in values.items():
        if value is None:
            frame = frame[frame[column].isna()]
        elif isinstance(value, str):
            frame = frame[frame[column] == value]
        else:
            frame = frame[(frame[column] - value).abs() <= 1e-6 * abs(value)]
    return frame
