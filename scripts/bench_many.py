"""Times sites of many images and of many tie points, and many sites, made from a site of the synthetic mission: seconds, peak
memory, and bytes of the page. Images are copies of two labels under other names, each a tick of the clock later than the one before;
tie points are copies of those of the site with a noise of 0.3 pixels; sites are copies without tie points.

bench_many.py PROGRAM [--images N…] [--ties N…] [--sites N…]
"""

import argparse
import datetime
import os
import pathlib
import random
import re
import subprocess
import tempfile
import time

SITE = "isidis"
IMAGES = ["E02-01301", "E02-02016"]
TICKS_PER_SECOND = 256


def later(label, ticks):
    """The label of an image that begins so many ticks later."""

    def utc(found):
        instant = datetime.datetime.fromisoformat(found[2]) + datetime.timedelta(seconds=ticks / TICKS_PER_SECOND)
        return f"{found[1]} = {instant.isoformat(timespec='milliseconds')}"

    def clock(found):
        seconds, rest = divmod(int(found[1]) * TICKS_PER_SECOND + int(found[2]) + ticks, TICKS_PER_SECOND)
        return f'SPACECRAFT_CLOCK_START_COUNT = "{seconds}:{rest:03d}"'

    label = re.sub(r"((?:START|IMAGE|STOP)_TIME) = (\S+)", utc, label)
    return re.sub(r'SPACECRAFT_CLOCK_START_COUNT = "(\d+):(\d+)"', clock, label)


def many_images(mission, count):
    """A site of so many images without tie points."""
    text = without_ties(mission).split("[[images]]")[0]
    text = text.replace(f'site = "{SITE}"', f'site = "images_{count}"')
    for index in range(count):
        original, name = IMAGES[index % 2], f"S{index // 100000:02d}-{index % 100000:05d}"
        label = later((mission / f"labels/{original}.lbl").read_text(), index // 2)
        for mark in ("/", ""):
            label = label.replace(original.replace("-", mark), name.replace("-", mark))
        (mission / f"labels/{name}.lbl").write_text(label)
        text += f'\n[[images]]\nid = "{name}"\nlabel = "../labels/{name}.lbl"\nlines_delivered = 7680\n'
    return written(mission, f"images_{count}", text)


def without_ties(mission):
    text = (mission / f"sites/{SITE}.toml").read_text()
    return re.sub(r"\[(ties|adjustment)\]\n(?:[^\[\n].*\n)*", "", text)


def many_sites(mission, count):
    """So many sites of two images."""
    text = without_ties(mission)
    names = [f"copy_{index:05d}" for index in range(count)]
    return [written(mission, name, text.replace(f'site = "{SITE}"', f'site = "{name}"')) for name in names]


def many_ties(mission, count):
    """A site of two images with so many tie points."""
    head, *rows = (mission / f"ties/{SITE}.csv").read_text().splitlines()
    points = {}
    for row in rows:
        point, image, sample, line = row.split(",")
        points.setdefault(point, []).append((image, float(sample), float(line)))
    noise, points, table = random.Random(1), list(points.values()), [head]
    for index in range(count):
        for image, sample, line in points[index % len(points)]:
            table.append(f"t{index:06d},{image},{sample + noise.gauss(0, 0.3):.4f},{line + noise.gauss(0, 0.3):.4f}")
    (mission / f"ties/ties_{count}.csv").write_text("\n".join(table) + "\n")
    text = (mission / f"sites/{SITE}.toml").read_text().replace(f'site = "{SITE}"', f'site = "ties_{count}"')
    return written(mission, f"ties_{count}", text.replace(f"ties/{SITE}.csv", f"ties/ties_{count}.csv"))


def written(mission, name, text):
    path = mission / f"sites/{name}.toml"
    path.write_text(text)
    return path


def measure(program, site, out):
    """Runs a site in a process of its own."""
    began = time.monotonic()
    process = subprocess.Popen([program, "--quiet", "run", site, "--out", out], stdout=subprocess.DEVNULL)
    _, _, used = os.wait4(process.pid, 0)
    page = pathlib.Path(out) / site.stem / "report/index.html"
    print(
        f"{site.stem}: {time.monotonic() - began:.1f} s, {used.ru_utime:.1f} s of processors, {used.ru_maxrss / 1024:.0f} MiB, "
        f"page {page.stat().st_size / 1e6:.2f} MB",
        flush=True,
    )


def measure_all(program, sites, out):
    """Runs many sites in one process."""
    began = time.monotonic()
    process = subprocess.Popen([program, "--quiet", "run", *sites, "--out", out], stdout=subprocess.DEVNULL)
    _, _, used = os.wait4(process.pid, 0)
    seconds, processors = time.monotonic() - began, used.ru_utime + used.ru_stime
    print(
        f"{len(sites)} sites: {seconds:.1f} s, {processors:.1f} s of processors ({processors / seconds:.2f} at a time), "
        f"{used.ru_maxrss / 1024:.0f} MiB",
        flush=True,
    )


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("program")
    arguments.add_argument("--images", type=int, nargs="*", default=[2, 100, 300, 1000])
    arguments.add_argument("--ties", type=int, nargs="*", default=[1000, 10000, 50000])
    arguments.add_argument("--sites", type=int, nargs="*", default=[300])
    wish = arguments.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        mission, out = pathlib.Path(folder) / "mission", f"{folder}/out"
        subprocess.run([wish.program, "--quiet", "scene", "mission", mission], check=True, stdout=subprocess.DEVNULL)
        for count in wish.images:
            measure(wish.program, many_images(mission, count), out)
        for count in wish.ties:
            measure(wish.program, many_ties(mission, count), out)
        for count in wish.sites:
            measure_all(wish.program, many_sites(mission, count), f"{folder}/out_{count}")


if __name__ == "__main__":
    main()
