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
HALF_WINDOW_DEG = 0.25


def best_s(work):
    taken = []
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        answer = work()
        taken.append(time.perf_counter() - begun)
    return min(taken), answer


def main(areograph, archive):
    def search(*arguments):
        command = [areograph, "--quiet", "pedr", "search", archive, "--wide", "--json", *arguments]
        answer = subprocess.run(command, check=True, capture_output=True).stdout
        return json.loads(answer)["rows"]

    everything = pathlib.Path(archive, "shots.parquet")
    # Each shot of class 1 with a return; rows come in the order of time, as a user would sort them.
    rows = search("--box=0,360,-90,90", "--out", str(everything))
    size_gb = everything.stat().st_size / 1e9
    def first(question):
        return duckdb.sql(question).fetchall()[0]

    # About a shot far from poles and from the prime meridian.
    lon, lat = first(f"""select longitude_deg, latitude_deg from '{everything}'
                         where abs(latitude_deg) < 45 and longitude_deg between 10 and 350 limit 1 offset {rows // 3}""")
    west, east, south, north = lon - HALF_WINDOW_DEG, lon + HALF_WINDOW_DEG, lat - HALF_WINDOW_DEG, lat + HALF_WINDOW_DEG
    box = f"--box={west!r},{east!r},{south!r},{north!r}"
    ours_s, ours = best_s(lambda: search(box))
    count = f"""select count(*) from '{everything}' where longitude_deg between {west!r} and {east!r}
                and latitude_deg between {south!r} and {north!r}"""
    theirs_s, theirs = best_s(lambda: first(count)[0])
    if ours != theirs:
        sys.exit(f"areograph finds {ours} shots, DuckDB {theirs}")
    print(f"{rows} shots, {size_gb:.2f} GB of Parquet; {ours} in the window")
    print(f"areograph {ours_s * 1e3:.1f} ms, DuckDB {duckdb.__version__} {theirs_s * 1e3:.1f} ms: {theirs_s / ours_s:.1f} times as long")
    everything.unlink()


if __name__ == "__main__":
    main(*sys.argv[1:])
