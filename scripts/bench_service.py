"""Times a service on the synthetic mission: answers at a fixed rate and at saturation, and what running sites lose by them.

usage: bench_service.py AREOGRAPH SECONDS; `scripts/bench service` builds the first and passes the second on

A request is due at its instant whether those before it are answered or not, and its time counts from that instant:
a service that stands still for a second is not timed by the one request that waited for it.
"""

import asyncio
import collections
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request

RATE_PER_S = 500
CONNECTIONS = 200
# Pairs of rounds, with and without readers, in which every site runs once.
ROUNDS = 12
# What people and programs read; `{run}` is the newest run of a site.
PATHS = [
    "/",
    "/sites/eos_chasma",
    "/nights",
    "/kernels",
    "/metrics",
    "/api/v1/sites",
    "/api/v1/jobs?limit=50",
    "/api/v1/sites/eos_chasma/runs",
    "/api/v1/kernels",
    "/api/v1/runs/{run}/files/footprints.parquet",
]


async def answer(reader: asyncio.StreamReader) -> int:
    """Reads one answer whole; its status."""
    head = await reader.readuntil(b"\r\n\r\n")
    fields = dict(line.lower().split(b":", 1) for line in head.split(b"\r\n")[1:-2])
    if b"content-length" in fields:
        await reader.readexactly(int(fields[b"content-length"]))
    else:
        while length := int(await reader.readline(), 16):
            await reader.readexactly(length + 2)
        await reader.readline()
    return int(head.split(b" ", 2)[1])


class Readers:
    """Connections that are kept and read in turn, all at one rate; a rate of 0 is as fast as they are answered."""

    def __init__(self, service: "Service", rate_per_s: float):
        self.port = service.port
        self.paths = service.paths()
        self.rate_per_s = rate_per_s
        self.times_s: list[float] = []
        self.unexpected: collections.Counter[str] = collections.Counter()

    async def read(self, end: asyncio.Event) -> None:
        """Reads until `end` is set."""
        self.began = time.monotonic()
        await asyncio.gather(*(self.connection(first, end) for first in range(CONNECTIONS)))
        self.lasted_s = time.monotonic() - self.began

    async def connection(self, number: int, end: asyncio.Event) -> None:
        """One connection, and every request that is its."""
        reader = writer = None
        while not end.is_set():
            due = time.monotonic()
            if self.rate_per_s:
                due = self.began + number / self.rate_per_s
                await asyncio.sleep(due - time.monotonic())
            path = self.paths[number % len(self.paths)]
            try:
                if writer is None:
                    reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
                writer.write(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{self.port}\r\n\r\n".encode())
                status = await answer(reader)
                if status != 200:
                    self.unexpected[f"{path}: {status}"] += 1
            except (OSError, ValueError, asyncio.IncompleteReadError) as error:
                self.unexpected[f"{path}: {type(error).__name__}"] += 1
                if writer is not None:
                    writer.close()
                writer = None
            self.times_s.append(time.monotonic() - due)
            number += CONNECTIONS
        if writer is not None:
            writer.close()

    def told(self) -> str:
        """Rate, quantiles and what was not answered as it should be."""
        times = sorted(self.times_s)
        parts = {"median": 0.5, "p99": 0.99, "p99.9": 0.999, "longest": 1.0}
        quantiles = ", ".join(
            f"{name} {1000 * times[min(len(times) - 1, int(part * len(times)))]:.1f} ms" for name, part in parts.items()
        )
        unexpected = "".join(f"\n  {what}, {count} times" for what, count in self.unexpected.items())
        rate = len(times) / self.lasted_s
        return f"{len(times)} answers, {rate:.0f} a second, {quantiles}, {self.unexpected.total()} errors{unexpected}"


class Service:
    """A service on a synthetic mission of its own."""

    def __init__(self, areograph: str, folder: str):
        subprocess.run([areograph, "serve", "--init", folder], check=True, stdout=subprocess.DEVNULL)
        configuration = f"{folder}/areograph.toml"
        self.process = subprocess.Popen(
            [areograph, "--quiet", "serve", configuration, "--listen", "127.0.0.1:0"], stdout=subprocess.PIPE, text=True
        )
        self.port = int(self.process.stdout.readline().rsplit(":", 1)[1])
        add = [areograph, "service", "token", "add", "--role", "operate", configuration]
        token = subprocess.run(add, check=True, capture_output=True, text=True).stdout
        self.token = re.search(r"areo_\S+", token)[0]
        self.sites = len(os.listdir(f"{folder}/sites"))
        while not self.idle() or len(self.ask("/api/v1/jobs")["items"]) < self.sites:
            time.sleep(0.2)

    def paths(self) -> list[str]:
        """What is read: of a site's products those of today, since the service does not keep all."""
        run = self.ask("/api/v1/sites/eos_chasma")["current_run"]
        return [path.format(run=run) for path in PATHS]

    def ask(self, path: str, body: object = None) -> dict:
        """One request of the interface for programs."""
        request = urllib.request.Request(
            f"http://127.0.0.1:{self.port}{path}",
            data=json.dumps(body).encode() if body else None,
            headers={"Authorization": f"Bearer {self.token}", "Content-Type": "application/json"},
        )
        with urllib.request.urlopen(request, timeout=30) as response:
            return json.load(response)

    def idle(self) -> bool:
        """Whether every job has ended."""
        return all(job["ended_utc"] for job in self.ask("/api/v1/jobs")["items"])

    async def run_all(self) -> float:
        """Runs every stage of every site; seconds that it took."""
        began = time.monotonic()
        await asyncio.to_thread(self.ask, "/api/v1/jobs", {"sites": "all", "force": True, "reason": "bench"})
        while not await asyncio.to_thread(self.idle):
            await asyncio.sleep(0.05)
        return time.monotonic() - began

    def memory_mib(self) -> float:
        """Most memory that it has held."""
        status = open(f"/proc/{self.process.pid}/status").read()
        return int(re.search(r"VmHWM:\s+(\d+)", status)[1]) / 1024


async def reading(service: Service, rate_per_s: float, work) -> tuple[Readers, object]:
    """Reads while `work` is in progress."""
    readers, end = Readers(service, rate_per_s), asyncio.Event()
    task = asyncio.create_task(readers.read(end))
    done = await work
    end.set()
    await task
    return readers, done


async def main(areograph: str, seconds: float) -> None:
    """The three measurements."""
    with tempfile.TemporaryDirectory() as folder:
        service = Service(areograph, folder)
        try:
            readers, _ = await reading(service, RATE_PER_S, asyncio.sleep(seconds))
            cpu = 100 * time.process_time() / readers.lasted_s
            print(f"{RATE_PER_S} requests a second, {CONNECTIONS} connections: {readers.told()}")
            ratios, errors = [], 0
            for turn in range(ROUNDS):
                if turn % 2 == 0:
                    alone_s = await service.run_all()
                readers, beside_s = await reading(service, RATE_PER_S, service.run_all())
                if turn % 2 == 1:
                    alone_s = await service.run_all()
                errors += readers.unexpected.total()
                ratios.append(beside_s / alone_s)
            print(
                f"{service.sites} sites forced, beside these readers (who take {cpu:.0f} % of a core themselves) against alone, {ROUNDS} pairs: median "
                f"{statistics.median(ratios):.3f}, {min(ratios):.3f} to {max(ratios):.3f}, {errors} errors"
            )
            readers, _ = await reading(service, 0, asyncio.sleep(seconds / 4))
            print(f"as fast as answered: {readers.told()}")
            print(f"memory at most: {service.memory_mib():.0f} MiB")
        finally:
            service.process.terminate()
            service.process.wait()


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], float(sys.argv[2])))
