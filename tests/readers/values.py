"""What a library reads from files of the program, without an option: `values.py READER PATH...` prints a JSON line for each
path, a file or a folder of files, with the columns as lists. It needs nothing but the library."""

import json
import math
import sys
from pathlib import Path


def with_pyarrow(path):
    if path.suffix == ".arrow":
        from pyarrow import feather

        return feather.read_table(path).to_pydict()
    from pyarrow import parquet

    return parquet.read_table(path).to_pydict()


def with_pandas(path):
    import pandas

    table = pandas.read_feather(path) if path.suffix == ".arrow" else pandas.read_parquet(path)
    return table.to_dict("list")


def with_fastparquet(path):
    import pandas

    return pandas.read_parquet(path, engine="fastparquet").to_dict("list")


def with_polars(path):
    import polars

    if path.suffix == ".arrow":
        return polars.read_ipc(path).to_dict(as_series=False)
    return polars.read_parquet(f"{path}/*.parquet" if path.is_dir() else path).to_dict(as_series=False)


def with_duckdb(path):
    import duckdb

    files = f"{path}/*.parquet" if path.is_dir() else path
    table = duckdb.sql(f"from '{files}'")
    return dict(zip(table.columns, map(list, zip(*table.fetchall()))))


def with_datafusion(path):
    import datafusion

    return datafusion.SessionContext().read_parquet(str(path)).to_pydict()


def plain(value):
    """A number as a float and a missing value as None, whatever type the library has for them."""
    if value is None or isinstance(value, str):
        return value
    number = float(value)
    return None if math.isnan(number) else number


if __name__ == "__main__":
    read = globals()[f"with_{sys.argv[1]}"]
    for path in map(Path, sys.argv[2:]):
        print(json.dumps({name: [plain(value) for value in column] for name, column in read(path).items()}))
