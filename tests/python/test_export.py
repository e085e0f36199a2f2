"""pandas, polars and DuckDB read an export alike, in each format: the rows of the tables in the order of the plan, each
with all that was swept and the frequency, and of the reduced sets and edges."""

import csv

import duckdb
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

SWEEP = """
name = "exported"
model = {{ N = 9 }}
axes = {{ Kd = [4e6, 8e6], seed = {{ count = {seeds} }}, zip = [{{ Delta = [0, 1e-6], frequency = [29, 29] }}] }}
record = {{ slips = 4, precursors = true }}
"""
REFINED = """
name = "refined"
model = { N = 3, Ns = 4 }
axes = { V0 = { log = [1e-4, 1e-3], points = 3 } }
record = { slips = 2 }
refine = { axis = "V0", by = "slip_share", threshold = 0.5, to = 0.3, seeds = { from = 24, to = 48 }, jobs = 200 }
"""
TABLES = ("jobs", "precursors", "sets", "slips")
READERS = {
    "pandas": {"parquet": pd.read_parquet, "csv": pd.read_csv, "arrow": pd.read_feather},
    "polars": {"parquet": pl.read_parquet, "csv": pl.read_csv, "arrow": pl.read_ipc},
    "duckdb": {"arrow": lambda file: duckdb.from_arrow(pa.ipc.open_file(file).read_all())}
    | dict.fromkeys(("parquet", "csv"), lambda file: duckdb.sql(f"from '{file}'")),
}
FORMATS = tuple(READERS["pandas"])


@pytest.fixture(scope="module")
def extended(stickslip, tmp_path_factory):
    """The results of a sweep that was extended, and its export in each format."""
    folder = tmp_path_factory.mktemp("exported")
    for seeds in (2, 3):
        (folder / "sweep.toml").write_text(SWEEP.format(seeds=seeds))
        stickslip("run", folder / "sweep.toml", "--out", folder / "results", "--no-reduce")
        if seeds == 2:
            stickslip("reduce", folder / "results")
    for format in FORMATS:
        stickslip("export", folder / "results", "--out", folder / format, "--format", format)
    return folder


@pytest.fixture(scope="module")
def refined(stickslip, tmp_path_factory):
    """The results of a sweep with edges, and its export in each format."""
    folder = tmp_path_factory.mktemp("refined")
    (folder / "sweep.toml").write_text(REFINED)
    stickslip("run", folder / "sweep.toml", "--out", folder / "results", "--no-reduce")
    for format in FORMATS:
        stickslip("export", folder / "results", "--out", folder / format, "--format", format)
    return folder


def rows(table):
    """Names of columns, and rows as plain values, of any library's table."""
    if isinstance(table, pd.DataFrame):
        return list(table), table.astype(object).where(table.notna(), None).values.tolist()
    return table.columns, [list(row) for row in (table.rows() if isinstance(table, pl.DataFrame) else table.fetchall())]


def expected(results, name):
    """Sets as they are; or a table in the order of its parts, with the frequency as people write it, Kd, which only the jobs
    have, and no control."""
    if name == "sets":
        return pd.read_parquet(results / "reduced" / "sets.parquet")
    table, jobs = (pd.read_parquet(results / "tables" / folder) for folder in (name, "jobs"))
    assert table["frequency"].dropna().tolist() == [float(f"{1 / period:.12g}") for period in table["T"].dropna()]
    table = table if name == "jobs" else table.join(jobs.set_index("job_id")["Kd"], on="job_id")
    return table.assign(control=False)


def test_what_verifies_a_file_of_a_directory_is_in_no_export(extended):
    assert b"seal" in pq.read_metadata(extended / "results/reduced/sets.parquet").metadata
    assert b"seal" not in pq.read_metadata(extended / "parquet/sets.parquet").metadata



@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("format", FORMATS)
def test_every_reader_finds_the_rows_of_the_tables_with_what_was_swept(extended, format, reader):
    files = [f"{table}.{format}" for table in TABLES]
    assert sorted(file.name for file in (extended / format).iterdir()) == ["columns.csv"] * (format == "csv") + files
    for table in TABLES:
        columns, found = rows(READERS[reader][format](extended / format / f"{table}.{format}"))
        names, wanted = rows(expected(extended / "results", table))
        assert columns == names and found == wanted and len(found) >= (2 * 2 if table == "sets" else 2 * 2 * 3)


def test_units_are_in_the_fields(extended):
    files = extended / "parquet" / "slips.parquet", extended / "arrow" / "slips.arrow"
    for schema in (pq.read_schema(files[0]), pa.ipc.open_file(files[1]).schema):
        units = {name: schema.field(name).metadata[b"unit"] for name in ("interval", "Kd", "frequency", "periods")}
        assert units == {"interval": b"s", "Kd": b"N/m", "frequency": b"Hz", "periods": b""}


def test_units_and_meanings_lie_beside_csv(extended):
    header, *described = csv.reader((extended / "csv" / "columns.csv").read_text().splitlines(), strict=True)
    assert header == ["table", "column", "unit", "meaning"]
    schemas = {table: pq.read_schema(extended / "parquet" / f"{table}.parquet") for table in TABLES}
    fields = [(table, field) for table, schema in schemas.items() for field in schema]
    texts = [[table, field.name, *(field.metadata[key].decode() for key in (b"unit", b"description"))] for table, field in fields]
    assert sorted(described) == sorted(texts)


@pytest.mark.parametrize("format", FORMATS)
def test_a_sweep_that_refines_has_its_edges(refined, format):
    columns, found = rows(READERS["polars"][format](refined / format / f"edges.{format}"))
    names, wanted = rows(pl.read_parquet(refined / "results" / "reduced" / "edges.parquet"))
    assert columns == names and found == wanted and len(found) >= 1
    assert format != "csv" or "\nedges,edge_low," in (refined / "csv" / "columns.csv").read_text()


def test_a_spreadsheet_takes_the_csv(extended):
    for table in TABLES:
        text = (extended / "csv" / f"{table}.csv").read_bytes().decode("ascii")
        header, *lines = csv.reader(text.splitlines(), strict=True)
        assert header == list(expected(extended / "results", table)) and {len(line) for line in lines} == {len(header)}
        assert not {"nan", "inf", "null", "none"} & {field.lower() for line in lines for field in line}
