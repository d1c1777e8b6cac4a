"""Time and memory of orthoimages and mosaics, step by step: a pair of images of 1,024 samples and about 10,000 lines with matched tie
points, then more images of the same ground, with a mosaic. The further images are copies of the pair under other names, with its tie
points: memory and time depend on their number alone.

bench_mosaic.py PROGRAM FOLDER [--images N…] [--cell-m CELL]
"""

import argparse
import csv
import pathlib
import re
import shutil

import bench_costs
import bench_many

SITE, PAIR = "gusev_crater", ["E02-00665", "E02-01453"]
RECORD = 2048
STEPS = ("map_surface", "rectify_images", "compare_orthoimages", "mosaic_images", "publish")


def copied(mission, original, name):
    """The image under another name."""
    file = mission / f"images/{original.replace('-', '').lower()}.imq"
    head, rest = file.read_bytes()[:RECORD], file.read_bytes()[RECORD:]
    label = head.rstrip(b" \0").decode()
    for mark in ("/", ""):
        label = label.replace(original.replace("-", mark), name.replace("-", mark))
    (mission / f"images/{name}.imq").write_bytes(label.encode().ljust(RECORD) + rest)


def site(mission, count, ties, cell_m):
    """A site of so many images on the terrain model of the pair; of the pair alone, with matched tie points."""
    text = (mission / f"sites/{SITE}.toml").read_text()
    text, images = text[: text.index("[[images]]")], text[text.index("[[images]]") :]
    text = re.sub(r"(?m)^\[(ties|products)\]\n(?:[^\[\n].*\n)*", "", text)
    name = f"mosaic_{count}" if ties else "pair"
    text = text.replace(f'site = "{SITE}"', f'site = "{name}"')
    text += "[ties]\n" + (f'files = ["../ties/{name}.csv"]\n' if ties else "match = true\n")
    text += f"[surface]\ncell_m = 15.0\northoimage_cell_m = {cell_m}\nimages = {PAIR}\n".replace("'", '"')
    text += "mosaic = true\n" if ties else ""
    names = list(PAIR)
    for index in range(2, count):
        # Fragments of the file contain the number of the image.
        names.append(f"S{index:02}-{PAIR[index % 2][-5:]}")
        copied(mission, PAIR[index % 2], names[-1])
        file = f"../images/{names[-1]}.imq"
        images += f'\n[[images]]\nid = "{names[-1]}"\nlabel = "{file}"\npixels = "{file}"\n'
    if ties:
        head, *rows = list(csv.reader(ties.open()))
        image = head.index("serial_number")
        rows = [
            [*row[:image], name, *row[image + 1 :]]
            for row in rows
            for index, name in enumerate(names)
            if row[image] == PAIR[index % 2]
        ]
        with (mission / f"ties/{name}.csv").open("w") as file:
            csv.writer(file).writerows([head, *rows])
    return bench_many.written(mission, name, text + images)


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("program")
    arguments.add_argument("folder", type=pathlib.Path)
    arguments.add_argument("--images", type=int, nargs="+", default=[2, 5, 10])
    arguments.add_argument("--cell-m", type=float, default=3.5)
    wish = arguments.parse_args()
    mission, out = wish.folder / "mission", wish.folder / "out"
    if not mission.exists():
        bench_costs.once([wish.program, "--quiet", "scene", "mission", str(mission), "--images", "--day-s", "600"])

    def steps(file, name, count):
        shutil.rmtree(out / name, ignore_errors=True)
        for step in STEPS:
            # Copies have no parallax against their originals, which the adjustment cannot publish.
            if (name == "pair" and step == "mosaic_images") or (count > 2 and step == "publish"):
                continue
            run = [wish.program, "--quiet", "run", str(file), "--out", str(out), "--until", step]
            print(f"{name}, to {step}: {bench_costs.once(run)}", flush=True)

    steps(site(mission, 2, None, wish.cell_m), "pair", 2)
    ties = out / "pair/exchange/matched_ties.csv"
    for count in wish.images:
        steps(site(mission, count, ties, wish.cell_m), f"mosaic_{count}", count)


if __name__ == "__main__":
    main()
