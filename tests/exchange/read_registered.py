"""Reads registered_footprints.parquet with GeoPandas and with DuckDB and prints what both see."""

import json
import sys

import duckdb
import geopandas

path = sys.argv[1]
frame = geopandas.read_parquet(path)
kind, first, newest = duckdb.execute(
    "SELECT any_value(typeof(utc)), epoch_ms(min(utc)), epoch_ms(max(utc)) FROM read_parquet(?)", [path]
).fetchone()
print(json.dumps({
    "rows": len(frame),
    "crs": frame.crs.to_authority(),
    "time": str(frame["utc"].dtype),
    "first": frame["utc"].min().isoformat(),
    "duckdb_time": kind,
    "span_ms": newest - first,
    "geopandas_span_ms": round((frame["utc"].max() - frame["utc"].min()).total_seconds() * 1000),
}))
