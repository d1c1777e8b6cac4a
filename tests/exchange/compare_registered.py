"""Compares registered_footprints.parquet of a site with both tables of its registration, by DuckDB: rows and largest difference."""

import json
import sys

import duckdb

folder = sys.argv[1]
found = {}
for prefix, table in [("before", "registration"), ("adjusted", "registration_adjusted")]:
    found[prefix] = duckdb.execute(
        f"""SELECT count(*), max(greatest(abs(a.{prefix}_line - b.line), abs(a.{prefix}_sample - b.sample)))
            FROM read_parquet('{folder}/registered_footprints.parquet') a
            JOIN read_parquet('{folder}/{table}.parquet') b USING (image, profile, footprint_row)"""
    ).fetchone()
print(json.dumps(found))
