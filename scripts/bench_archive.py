"""The same window asked of an archive with its index, and of the same shots as Parquet in DuckDB.

bench_archive.py AREOGRAPH ARCHIVE: both warm, the best of nine; ours is the whole command, DuckDB's the query alone, in a program
that runs already. Needs the Python package duckdb.
"""

import json
import pathlib
import subprocess
import sys
import time

import duckdb

ROUNDS = 9
WEST, EAST, SOUTH, NORTH = 20.0, 20.5, 10.0, 10.5


def best_s(work):
    taken = []
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        answer = work()
        taken.append(time.perf_counter() - begun)
    return min(taken), answer


def main(areograph, archive):
    def search(*arguments):
        command = [areograph, "--quiet", "pedr", "search", archive, *arguments]
        told = subprocess.run(command, check=True, capture_output=True).stdout
        return json.loads(told)["rows"]

    everything = pathlib.Path(archive, "shots.parquet")
    # Each shot of class 1 with a return; rows come in the order of time, as a user would sort them.
    rows = search("--box=0,360,-90,90", "--out", str(everything))
    size_gb = everything.stat().st_size / 1e9
    box = f"--box={WEST},{EAST},{SOUTH},{NORTH}"
    ours_s, ours = best_s(lambda: search(box))
    count = f"""select count(*) from '{everything}' where longitude_deg between {WEST} and {EAST}
                and latitude_deg between {SOUTH} and {NORTH}"""
    theirs_s, theirs = best_s(lambda: duckdb.sql(count).fetchone()[0])
    if ours != theirs:
        sys.exit(f"areograph finds {ours} shots, DuckDB {theirs}")
    print(f"{rows} shots, {size_gb:.2f} GB of Parquet; {ours} in the window")
    print(f"areograph {ours_s * 1e3:.1f} ms, DuckDB {duckdb.__version__} {theirs_s * 1e3:.1f} ms: {theirs_s / ours_s:.1f} times as long")
    everything.unlink()


if __name__ == "__main__":
    main(*sys.argv[1:])
