"""Reads the tables of a campaign by their folders with DuckDB, and pools them again in SQL."""

import json
import sys

import duckdb

folder = sys.argv[1]
connection = duckdb.connect()


def one(select, table, where="is_valid"):
    source = f"read_parquet('{folder}/{table}/*/*.parquet', hive_partitioning = true)"
    return connection.execute(f"select {select} from {source} where {where}").fetchone()[0]


pooled = "is_valid and not is_repeated"
rms = "sqrt(avg({0} * {0}))".format
print(
    json.dumps(
        {
            "phases": one("list(distinct phase order by phase)", "images", "true"),
            "along_rms_m": one(rms("before_along_m"), "pairs", pooled),
            "after_along_rms_m": one(rms("after_along_m"), "pairs", pooled),
            "across_rms_px": one(rms("before_across_px"), "pairs", pooled),
            "budget_along_px": one(rms("budget_along_px"), "pairs", pooled),
            "range_mean_m": one("sum(shots * mean_m) / sum(shots)", "profiles"),
            "range_shots": int(one("sum(shots)", "profiles")),
            "order2_x_rmse_m": one(rms("order2_x_rmse_m"), "images"),
        }
    )
)
