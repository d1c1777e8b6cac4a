"""Shots read and searched by the Python package, against the command of the same wheel that writes them as Parquet.

bench_python.py ARCHIVE: warm, the median of five; the command as a whole process, the function in a program that runs already.
Needs the wheel of areograph and GeoPandas.
"""

import statistics
import subprocess
import sys
import tempfile
import time

import areograph

ROUNDS = 5
ALL_SHOTS = ["--classes=0,1", "--attitude-flags=0,1,2,3", "--check-all"]
BOXES = {
    "all shots": (0.0, 360.0, -90.0, 90.0),
    "40 x 60 degrees": (100.0, 140.0, -30.0, 30.0),
    "1.0 x 1.5 degrees": (137.0, 138.0, -5.5, -4.0),
}


def median_s(work):
    taken = []
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        answer = work()
        taken.append(time.perf_counter() - begun)
    return statistics.median(taken), answer


def main(archive):
    with tempfile.TemporaryDirectory() as folder:
        for name, box in BOXES.items():
            is_all = name == "all shots"
            command = ["areograph", "--quiet", "pedr", "search", archive, "--out", f"{folder}/shots.parquet"]
            command += [f"--box={','.join(map(str, box))}", *(ALL_SHOTS if is_all else [])]
            command_s, _ = median_s(lambda: subprocess.run(command, check=True, stdout=subprocess.DEVNULL))
            function = areograph.read_pedr if is_all else areograph.search_shots
            function_s, found = median_s(lambda: function(archive) if is_all else function(archive, box))
            print(
                f"{name}: {len(found)} shots; command {command_s:.3f} s, {function.__name__} {function_s:.3f} s: "
                f"{command_s / function_s:.2f} times the speed of the command"
            )


if __name__ == "__main__":
    main(*sys.argv[1:])
