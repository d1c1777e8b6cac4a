"""What users wait for, by size: time, processor time, memory and bytes of whole commands, each over a decade of sizes.

bench_costs.py PROGRAM FOLDER [--plot FILE.svg] [--terrain]: prints a table in Markdown. Every size is measured three times, and the
median is printed, except for first runs without changes; input files are in the page cache. Rows of Parquet and CSV are compared with PyArrow and Polars, which must be
installed, as must matplotlib for the plot. With --terrain also two rendered images are matched, which takes minutes.
"""

import argparse
import json
import os
import pathlib
import re
import resource
import shutil
import statistics
import subprocess
import time

import bench_many

ROUNDS = 3
CELL_M = 15.0


class Cost:
    """The cost of a process: seconds of wall clock and of processors, and peak memory."""

    def __init__(self, wall_s, cpu_s, memory_mib):
        self.wall_s, self.cpu_s, self.memory_mib = wall_s, cpu_s, memory_mib

    def __str__(self):
        return f"{self.wall_s:.2f} s, {self.cpu_s:.2f} s of processors, {self.memory_mib:.0f} MiB"


def once(command):
    began = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    # 5: results that are not valid, such as those of copied tie points.
    if process.returncode not in (0, 5):
        raise SystemExit(f"bench: {' '.join(map(str, command))} ended with {process.returncode}")
    return Cost(time.monotonic() - began, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)


def median(command, before=lambda: None):
    costs = []
    for _ in range(ROUNDS):
        before()
        costs.append(once(command))
    return Cost(*(statistics.median(getattr(cost, key) for cost in costs) for key in ("wall_s", "cpu_s", "memory_mib")))


class Bench:
    def __init__(self, program, folder):
        self.program, self.folder = program, pathlib.Path(folder)
        self.mission, self.out = self.folder / "mission", self.folder / "out"
        self.series = {}
        self.command("scene", "mission", self.mission)

    def command(self, *arguments):
        subprocess.run([self.program, "--quiet", *map(str, arguments)], check=True, stdout=subprocess.DEVNULL)

    def note(self, series, size, cost, more=""):
        self.series.setdefault(series, []).append((size, cost))
        print(f"| {series} | {size:,} | {cost.wall_s:.2f} s | {cost.cpu_s:.2f} s | {cost.memory_mib:.0f} MiB | {more} |", flush=True)

    def run(self, *sites):
        """The cost of a first run."""
        fresh = lambda: shutil.rmtree(self.out, ignore_errors=True)
        return median([self.program, "--quiet", "run", *map(str, sites), "--out", str(self.out)], fresh)

    def shots(self):
        images = re.search(r"(?ms)^\[\[images\]\].*", (self.mission / "sites/gusev_crater.toml").read_text())[0]
        for latitude_deg in (8, 27, 80):
            site = self.mission / "sites/large.toml"
            site.write_text(
                'site = "large"\nkernels.metakernel = "../kernels/nav.tm"\n'
                'pedr.files = ["../pedr/ap18933l.b", "../pedr/ap19215k.b"]\n'
                f'[[windows]]\nid = "belt"\nlongitude_deg = [0.0, 360.0]\nlatitude_deg = [-{latitude_deg}.0, {latitude_deg}.0]\n' + images
            )
            cost = self.run(site)
            products = self.out / "large"
            count = json.loads((products / "manifest.json").read_text())["counts"]["footprints"]
            stored = size_of(products / ".cache")
            written = f"{(size_of(products) - stored) / 2**20:.0f} MiB in products, {stored / 2**20:.0f} MiB in stored stages"
            self.note("shots of a site: run", count, cost, written)
            again = [self.program, "--quiet", "run", str(site), "--out", str(self.out)]
            self.note("shots of a site: first run without changes", count, once(again))
            self.note("shots of a site: run without changes", count, median(again))
        site.unlink()

    def sites(self):
        sites = sorted((self.mission / "sites").glob("*.toml"))
        self.note("sites of the synthetic mission", len(sites), self.run(*sites))

    def images(self, counts):
        for count in counts:
            self.note("images of a site", count, self.run(bench_many.many_images(self.mission, count)))

    def ties(self, counts):
        for count in counts:
            self.note("tie points of a site", count, self.run(bench_many.many_ties(self.mission, count)))

    def terrain(self):
        mission = self.folder / "images"
        self.command("scene", "mission", mission, "--images")
        site = mission / "sites/gusev_crater.toml"
        text = re.sub(r"(?m)^\[ties\]\n(?:[^\[\n].*\n)*", "[ties]\nmatch = true\n\n", site.read_text())
        for cell_m in (4 * CELL_M, 2 * CELL_M, CELL_M):
            site.write_text(f"{text}\n[surface]\ncell_m = {cell_m}\n")
            cost = self.run(site)
            surface = next((self.out / "gusev_crater").rglob("surface.json"))
            cells = json.loads(surface.read_text())["cells"]["common"]
            self.note("cells of a terrain model from pixels", cells, cost, f"edge {cell_m:.0f} m")

    def archive(self):
        archive = self.folder / "archive"
        self.command("scene", "archive", archive, "--gb", "0.2")
        pedr = archive / "pedr"
        self.command("pedr", "index", pedr)
        for count in (1, 100, 1_000, 10_000):
            windows = self.folder / f"windows_{count}.toml"
            # Spread over the sphere by the golden ratio, with equal areas between parallels.
            boxes = (((n * 222.492235) % 359.5, -85 + 170 * n / max(count - 1, 1)) for n in range(count))
            windows.write_text(
                "".join(
                    f'[[windows]]\nid = "w{n}"\nlongitude_deg = [{west:.3f}, {west + 0.5:.3f}]\nlatitude_deg = [{south:.3f}, {south + 0.5:.3f}]\n'
                    for n, (west, south) in enumerate(boxes)
                )
            )
            search = [self.program, "--quiet", "pedr", "search", str(pedr), "--windows", str(windows), "--format", "count"]
            answer = subprocess.run([*search, "--json"], check=True, capture_output=True).stdout
            self.note("windows of an indexed archive of 0.2 GB", count, median(search), f"{json.loads(answer)['rows']:,} shots")
        self.rows(pedr)

    def rows(self, pedr):
        """Rows a second of Parquet and CSV, in turns with PyArrow and Polars; the search alone is subtracted."""
        import polars
        import pyarrow.parquet

        search = [self.program, "--quiet", "pedr", "search", str(pedr), "--box=0,360,-90,90", "--wide"]
        files = {kind: self.folder / f"all.{kind}" for kind in ("parquet", "csv")}
        theirs = {kind: self.folder / f"peer.{kind}" for kind in files}
        once([*search, "--out", str(files["parquet"])])
        table = pyarrow.parquet.read_table(files["parquet"])
        group = pyarrow.parquet.ParquetFile(files["parquet"]).metadata.row_group(0)
        columns = [group.column(place) for place in range(group.num_columns)]
        dictionaries = [of.path_in_schema for of in columns if "RLE_DICTIONARY" in of.encodings]
        encodings = {
            of.path_in_schema: next(name for name in of.encodings if name in ("BYTE_STREAM_SPLIT", "DELTA_BINARY_PACKED"))
            for of in columns
            if {"BYTE_STREAM_SPLIT", "DELTA_BINARY_PACKED"} & set(of.encodings)
        }
        lists = polars.col(polars.List(polars.String))
        frame = polars.from_arrow(table.drop_columns(["geometry", "bbox"])).with_columns(lists.list.join(";"))

        def pyarrow_writes():
            pyarrow.parquet.write_table(
                table, theirs["parquet"], compression="zstd", compression_level=1, use_dictionary=dictionaries,
                column_encoding=encodings, row_group_size=1 << 18,
            )

        peers = {"parquet": ("PyArrow", pyarrow_writes), "csv": ("Polars", lambda: frame.write_csv(theirs["csv"]))}
        found = median([*search, "--format", "count"])
        for kind, (name, write) in peers.items():
            ours, peer = [], []
            for _ in range(ROUNDS):
                ours.append(once([*search, "--out", str(files[kind])]))
                peer.append(of_work(write))
            rows = table.num_rows
            for clock in ("wall_s", "cpu_s"):
                mine = statistics.median(getattr(cost, clock) for cost in ours)
                their = statistics.median(getattr(cost, clock) for cost in peer)
                alone = mine - getattr(found, clock)
                print(
                    f"{kind}, {clock}: {rows / alone / 1e6:.2f} million rows a second ({rows / mine / 1e6:.2f} with the search), "
                    f"{name} {rows / their / 1e6:.2f}: {their / alone:.2f} ({their / mine:.2f})",
                    flush=True,
                )


def of_work(work):
    """The cost of a function of this process."""
    used = lambda: sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
    began, spent = time.monotonic(), used()
    work()
    return Cost(time.monotonic() - began, used() - spent, 0)


def size_of(folder):
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def plot(series, path):
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "costs"
    import matplotlib.pyplot as pyplot

    shown = {name: points for name, points in series.items() if len(points) > 1}
    figure, axes = pyplot.subplots(1, 2, figsize=(10, 4.2))
    for axis, key, label in zip(axes, ("wall_s", "memory_mib"), ("time, s", "peak memory, MiB")):
        for name, points in shown.items():
            axis.loglog([size for size, _ in points], [getattr(cost, key) for _, cost in points], marker="o", label=name)
        axis.set_xlabel("number of shots, images, tie points, cells or windows")
        axis.set_ylabel(label)
        axis.grid(True, which="both", alpha=0.3)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="lower center", ncols=4, fontsize=7)
    figure.tight_layout(rect=(0, 0.09, 1, 1))
    figure.savefig(path, metadata={"Date": None})


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("program")
    arguments.add_argument("folder")
    arguments.add_argument("--plot")
    arguments.add_argument("--terrain", action="store_true")
    wish = arguments.parse_args()
    print("| what | number | time | processors | peak memory | |\n|---|---|---|---|---|---|")
    bench = Bench(wish.program, wish.folder)
    bench.sites()
    bench.shots()
    bench.images([3, 10, 30])
    bench.ties([100, 1_000, 10_000])
    if wish.terrain:
        bench.terrain()
    # Last, because processes inherit the peak memory of this one, which reads all rows.
    bench.archive()
    if wish.plot:
        plot(bench.series, wish.plot)


if __name__ == "__main__":
    main()
