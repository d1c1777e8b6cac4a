"""The same queries asked of an archive on this computer alone, and of a scheduler and two executors of one thread each.

bench_cluster.py AREOGRAPH ARCHIVE: the best of three, as whole commands; AREOGRAPH is built with the feature `cluster`. Then one
executor is killed in the middle of the last query. Answers are compared: rows exactly, means and sums within 1e-10.
"""

import contextlib
import math
import socket
import subprocess
import sys
import time

ROUNDS = 3
QUERIES = {
    "count of all shots": "select count(*) from shots",
    "box of 1°, rows": "select et_s, radius_m from shots where longitude_deg between 137 and 138 and latitude_deg between -5.5 and -4.5 order by et_s",
    "mean by orbit, 30° of latitude": "select orbit, count(*), avg(topography_m) from shots where latitude_deg between -15 and 15 group by orbit order by orbit",
    "mean and deviation by square degree, all shots": "select floor(latitude_deg) as y, floor(longitude_deg) as x, count(*), avg(topography_m), stddev(topography_m)"
    " from shots group by 1, 2 order by 1, 2",
    "the 100 longest ranges": "select et_s, range_m from shots order by range_m desc, et_s limit 100",
    "distinct times": "select count(distinct et_s) from shots",
}


def free_ports():
    while True:
        with contextlib.suppress(OSError), socket.socket() as first, socket.socket() as second:
            first.bind(("127.0.0.1", 0))
            port = first.getsockname()[1]
            second.bind(("127.0.0.1", port + 1))
            return port


def start(areograph, *arguments):
    process = subprocess.Popen([areograph, "--quiet", "pedr", "cluster", *arguments], stdout=subprocess.PIPE, text=True)
    return process, process.stdout.readline().strip()


def near(a, b):
    try:
        return math.isclose(float(a), float(b), rel_tol=1e-10, abs_tol=1e-9)
    except ValueError:
        return False


def compare(query, here, there):
    cells = [text.replace("\n", ",").split(",") for text in (here, there)]
    if len(cells[0]) != len(cells[1]) or not all(a == b or near(a, b) for a, b in zip(*cells)):
        sys.exit(f"the answers differ: {query}")


def main(areograph, archive):
    def ask(query, *more):
        command = [areograph, "--quiet", "pedr", "sql", archive, query, "--format", "csv", *more]
        begun = time.perf_counter()
        answer = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        return time.perf_counter() - begun, answer

    scheduler, line = start(areograph, "scheduler", "--listen", "127.0.0.1:0")
    url = line.removeprefix("scheduler at ")
    executors = []
    try:
        for _ in range(2):
            listen = f"127.0.0.1:{free_ports()}"
            executors.append(start(areograph, "executor", "--scheduler", url, "--listen", listen, "--threads", "1")[0])
        ask("select count(*) from shots where latitude_deg > 80", "--cluster", url)
        print("| query | this computer alone | scheduler and two executors |\n|---|---|---|")
        for name, query in QUERIES.items():
            here_s, here = min(ask(query) for _ in range(ROUNDS))
            there_s, there = min(ask(query, "--cluster", url) for _ in range(ROUNDS))
            compare(query, here, there)
            print(f"| {name} | {here_s:.2f} s | {there_s:.2f} s |", flush=True)
        for process in executors:
            with open(f"/proc/{process.pid}/status", encoding="ascii") as status:
                print(next(line for line in status if line.startswith("VmHWM")).strip())
        begun = time.perf_counter()
        command = [areograph, "--quiet", "pedr", "sql", archive, query, "--format", "csv", "--cluster", url]
        asked = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        time.sleep(there_s / 2)
        executors[0].kill()
        answer, error = asked.communicate()
        if asked.returncode == 0:
            compare(query, here, answer)
        print(f"an executor killed after {there_s / 2:.1f} s: code {asked.returncode} after {time.perf_counter() - begun:.1f} s {error}")
    finally:
        for process in [*executors, scheduler]:
            process.kill()


if __name__ == "__main__":
    main(*sys.argv[1:])
