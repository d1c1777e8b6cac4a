"""Reads footprints.parquet with GeoPandas and with DuckDB and prints what both see."""

import json
import sys

import duckdb
import geopandas

path = sys.argv[1]
frame = geopandas.read_parquet(path)
rows, orbits, range_m = duckdb.execute(
    "SELECT count(*), count(DISTINCT orbit), sum(range_m) FROM read_parquet(?)", [path]
).fetchone()
columns = [name for name, *_ in duckdb.execute("DESCRIBE SELECT * FROM read_parquet(?)", [path]).fetchall()]
print(json.dumps({
    "geopandas": {
        "rows": len(frame),
        "crs": frame.crs.to_authority(),
        "crs_name": frame.crs.name,
        "types": sorted(frame.geom_type.unique()),
        "bounds": list(frame.total_bounds),
        "first": [frame.geometry.iloc[0].x, frame.geometry.iloc[0].y],
        "range_m": float(frame["range_m"].sum()),
        "columns": list(frame.columns),
    },
    "duckdb": {"rows": rows, "orbits": orbits, "range_m": range_m, "columns": columns},
}))
