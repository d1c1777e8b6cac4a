"""The chain from a PEDR file to the image, of one site, by areograph and by a script of numpy and spiceypy.

bench_chain.py AREOGRAPH [--rounds N]: whole processes in turns, seconds of wall and of processors, for a window of some
hundred shots and for a belt of a hundred thousand. The answers of both are compared first. Needs the Python packages
spiceypy, numpy and pyarrow. `bench_chain.py peer SITE.toml OUT.npz` is the script by itself.
"""

import argparse
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

BELT = """site = "belt"
kernels.metakernel = "../kernels/nav.tm"
pedr.files = ["../pedr/ap18933l.b", "../pedr/ap19215k.b"]
[[windows]]
id = "belt"
longitude_deg = [0.0, 360.0]
latitude_deg = [-5.25, 5.25]
"""
# Ours minus theirs. Positions and ranges: CSPICE against a trajectory within 1 mm of it; UTC: whole microseconds. Lines and
# samples: both fit second-order polynomials, but to ω, φ, κ or to a rotation vector.
LARGEST = {"et_s": 1e-6, "utc_s": 2e-6, "range_minus_distance_m": 2e-3, "line": 0.02, "sample": 0.02}


def peer(site, answers):
    """A window of PEDR files: UTC, datum, range minus distance, and lines and samples in the images of the site."""
    import re
    import tomllib

    import numpy as np
    import spiceypy as spice

    site, answers = pathlib.Path(site).resolve(), pathlib.Path(answers).resolve()
    config = tomllib.loads(site.read_text())
    here = site.parent
    kernels = here / config["kernels"]["metakernel"]
    os.chdir(kernels.parent)  # kernels are relative to their metakernel
    spice.furnsh(str(kernels))
    late_s = config.get("altimeter_clock", {}).get("bias_s", 0.117)
    ck_bias_s = config.get("pointing", {}).get("ck_bias_s", -1.15)
    window = config["windows"][0]
    fields = {"orbit": (8, ">u4"), "raw_cm": (48, (">i4", 20)), "mid_cm": (128, ">i4"), "dlat_dr": (324, ">i4"), "dlon_dr": (328, ">i4"),
              "xover_cm": (332, ">i4"), "lat": (336, ">i4"), "lon": (340, ">i4"), "class": (384, (">i2", 20)), "gm": (536, ">u2"),
              "et": (552, ">f8"), "hz": (644, ">u4"), "range_cm": (648, (">i4", 20)), "dlat": (768, ">i4"), "dlon": (772, ">i4")}
    layout = np.dtype({"names": list(fields), "formats": [f for _, f in fields.values()], "offsets": [o for o, _ in fields.values()],
                       "itemsize": 776})
    k = np.arange(20) - 9.5

    def rotation(et, ra, dec, w):
        """J2000 to a Mars frame of linear elements, degrees at J2000 and their rates by century and day: n x 3 x 3."""
        days = et / 86400.0
        a = np.radians(90.0 + ra[0] + ra[1] * days / 36525.0)
        b = np.radians(90.0 - dec[0] - dec[1] * days / 36525.0)
        c = np.radians((w[0] + w[1] * days) % 360.0)
        (sa, ca), (sb, cb), (sc, cc) = [(np.sin(v), np.cos(v)) for v in (a, b, c)]
        rows = [[cc * ca - sc * cb * sa, cc * sa + sc * cb * ca, sc * sb], [-sc * ca - cc * cb * sa, -sc * sa + cc * cb * ca, cc * sb],
                [sb * sa, -sb * ca, cb]]
        return np.moveaxis(np.array(rows), (0, 1), (-2, -1))

    of_2000 = [spice.bodvrd("MARS", item, 3)[1] for item in ("POLE_RA", "POLE_DEC", "PM")]
    of_1991 = [(317.681, -0.108), (52.886, -0.061), (176.868, 350.8919830)]
    shots = []
    for name in config["pedr"]["files"]:
        frames = np.fromfile(here / name, layout, offset=7760)
        frames = frames[np.isfinite(frames["et"])]
        of_frame = {key: frames[key].astype(float)[:, None] for key in ("mid_cm", "dlat_dr", "dlon_dr", "lat", "lon", "dlat", "dlon", "et", "hz")}
        raw_m, x, known = 0.01 * frames["raw_cm"], k / 20.0, (frames["gm"] >= 2)[:, None]
        above_m = np.where(known, raw_m - 0.01 * of_frame["mid_cm"], 0.0)
        lat = 1e-6 * (of_frame["lat"] + x * of_frame["dlat"]) + 1e-9 * of_frame["dlat_dr"] * above_m
        lon = (1e-6 * (of_frame["lon"] + x * of_frame["dlon"]) + 1e-9 * of_frame["dlon_dr"] * above_m) % 360.0
        tag = of_frame["et"] + k * 1e7 / of_frame["hz"]
        (west, east), (south, north) = window["longitude_deg"], window["latitude_deg"]
        keep = (frames["class"] == 1) & (frames["range_cm"] > 0) & (np.abs(lat - (south + north) / 2) <= (north - south) / 2 + 0.5)
        xover_m = 0.01 * np.where(frames["gm"] >= 2, frames["xover_cm"], 0)
        moved_m = (xover_m[:, None] + x * np.diff(xover_m, prepend=xover_m[0])[:, None])[keep]
        lat, lon, tag, radius_m, range_m = np.radians(lat[keep]), np.radians(lon[keep]), tag[keep], raw_m[keep], 0.01 * frames["range_cm"][keep]
        ground = radius_m[:, None] * np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], 1)
        if name[-3] < "l":  # older versions follow the report of 1991
            ground = np.einsum("nij,nkj,nk->ni", rotation(tag, *of_2000), rotation(tag, *of_1991), ground)
        lon = np.degrees(np.arctan2(ground[:, 1], ground[:, 0])) % 360.0
        lat = np.degrees(np.arcsin(ground[:, 2] / radius_m))
        within = (lat >= south) & (lat <= north) & (lon >= west) & (lon <= east)
        shots.append(np.column_stack([tag, range_m, ground, (1 - moved_m / radius_m)[:, None] * ground])[within])
    shots = np.concatenate(shots)
    tag, range_m, raw, ground = shots[:, 0], shots[:, 1], shots[:, 2:5], shots[:, 5:]
    et = tag - late_s
    k_s, eccentricity, (m0, m1) = [spice.gdpool(f"DELTET/{name}", 0, 2) for name in ("K", "EB", "M")]
    yearly_s = k_s * np.sin(m0 + m1 * et + eccentricity * np.sin(m0 + m1 * et))
    late_ns = np.round(1e9 * (et - yearly_s - (spice.deltet(et[0], "ET") - yearly_s[0]))).astype(int)
    utc = np.datetime64("2000-01-01T12:00:00", "ns") + late_ns.astype("timedelta64[ns]")
    craft = 1e3 * spice.spkpos("MGS", et, "J2000", "NONE", "MARS")[0]
    craft = np.einsum("nij,nj->ni", rotation(et, *of_2000), craft)
    found = {"et_s": et, "utc": utc.astype("datetime64[us]"), "range_minus_distance_m": range_m - np.linalg.norm(craft - raw, axis=1)}
    radii_km = spice.bodvrd("MARS", "RADII", 3)[1]
    to_camera = spice.pxform("MGS_SPACECRAFT", "MGS_MOC_NA", et[0])
    for image in config["images"]:
        label = (here / image["label"]).read_text()
        read = lambda key: re.search(rf"^{key} = \"?([^\"\s]+)", label, re.M)[1]
        start, summing, lines = spice.scs2e(-94, read("SPACECRAFT_CLOCK_START_COUNT")), int(read("DOWNTRACK_SUMMING")), int(read("LINES"))
        across, line_s = int(read("CROSSTRACK_SUMMING")), 1e-3 * float(read("LINE_EXPOSURE_DURATION")) * summing
        offsets, places, turns = np.linspace(-lines / 2, lines / 2, 31), [], []
        for epoch in start + (offsets + lines / 2) * line_s:
            bus, _ = spice.ckgp(-94000, spice.sce2c(-94, epoch + ck_bias_s), 0.0, "J2000")
            looks, left = to_camera @ bus, epoch
            for _ in range(2):  # light leaves the ground earlier
                state, _ = spice.spkgps(-94, left, "J2000", 499)
                to_mars = rotation(np.array(left), *of_2000)
                point = spice.surfpt(to_mars @ state, to_mars @ looks[2], *radii_km)
                left = epoch - np.linalg.norm(point - to_mars @ state) / spice.clight()
            places.append(1e3 * to_mars @ spice.spkgps(-94, left, "J2000", 499)[0])
            turns.append(looks @ to_mars.T)
        vectors = [np.multiply(*spice.raxisa(turn @ turns[15].T)[::-1]) for turn in turns]
        path, vector = [np.polynomial.polynomial.polyfit(offsets, of, 2) for of in (places, vectors)]
        power = lambda x: np.stack([np.ones_like(x), x, x * x], 1)

        above = np.flatnonzero(ground @ places[15] > 3.37e6**2)  # the horizon of the image, generously
        shown = ground[above]

        def seen(x):
            r = power(x) @ vector
            angle = np.linalg.norm(r, axis=1)[:, None, None]
            cross = np.zeros((len(x), 3, 3))
            cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -r[:, 2], r[:, 1], -r[:, 0]
            cross -= cross.transpose(0, 2, 1)
            with np.errstate(invalid="ignore"):
                turn = np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / 2 / np.pi) ** 2 * (cross @ cross)
            return np.einsum("nij,nj->ni", turn @ turns[15], shown - power(x) @ path)

        x, step = np.zeros(len(above)), np.full(len(above), 10.0)
        before = seen(x - step)[:, 0]
        for _ in range(12):  # the secant method on the camera's x axis
            now = seen(x)[:, 0]
            with np.errstate(invalid="ignore", divide="ignore"):
                step, before = np.nan_to_num(-now * step / (now - before)), now
            x = np.clip(x + step, -10 * lines, 10 * lines)
            if np.all(np.abs(step) < 1e-4):
                break
        camera = seen(x)
        focal_px = 3500.0 / (0.0131240578522949 * across)
        line, sample = found[f"line {image['id']}"], found[f"sample {image['id']}"] = np.full((2, len(et)), np.nan)
        line[above], sample[above] = x + lines / 2, 1024.0 / across + focal_px * camera[:, 1] / camera[:, 2]
    np.savez(answers, **found)


def compare(folder, answers):
    """Ends the bench if a shot or a number differs."""
    import numpy as np
    import pyarrow.parquet as parquet

    theirs = np.load(answers)
    order = np.argsort(theirs["et_s"], kind="stable")
    ours = parquet.read_table(folder / "footprints.parquet", columns=["et_s", "utc"]).to_pydict()
    if len(order) != len(ours["et_s"]):
        sys.exit(f"areograph finds {len(ours['et_s'])} shots, the script {len(order)}")
    et_s = np.array(ours["et_s"])
    own = np.argsort(et_s, kind="stable")
    utc = np.array([instant.replace(tzinfo=None) for instant in ours["utc"]], "datetime64[us]")
    pairs = {"et_s": (et_s[own], theirs["et_s"][order]), "utc_s": [of.astype(float) / 1e6 for of in (utc[own], theirs["utc"][order])]}
    ranges = parquet.read_table(folder / "ranges.parquet", columns=["footprint_row", "range_minus_distance_m"]).to_pydict()
    by_row = np.full(len(order), np.nan)
    by_row[ranges["footprint_row"]] = ranges["range_minus_distance_m"]
    pairs["range_minus_distance_m"] = (by_row[own], theirs["range_minus_distance_m"][order])
    places = parquet.read_table(folder / "registration.parquet", columns=["image", "footprint_row", "line", "sample", "inside"])
    columns = places.to_pydict()
    rank = np.empty(len(own), int)
    rank[own] = np.arange(len(own))
    image, row, inside = np.array(columns["image"]), np.array(columns["footprint_row"]), np.array(columns["inside"])
    for key in ("line", "sample"):
        for name in np.unique(image):
            on = (image == name) & inside
            by_script = theirs[f"{key} {name}"][order][rank[row[on]]]
            pairs[f"{key} {name}"] = (np.array(columns[key])[on], by_script)
    for key, (mine, other) in pairs.items():
        if not len(mine):
            print(f"  {key}: no values")
            continue
        largest = np.max(np.abs(mine - other))
        if not largest <= LARGEST[key.split()[0]]:
            sys.exit(f"{key}: areograph and the script differ by {largest}; expected {LARGEST[key.split()[0]]} at most")
        print(f"  {key}: {len(mine)} values, differences up to {largest:.1e}")
    return len(order)


def taken(command):
    """Seconds of wall and of processors of a process, without its output."""
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after, wall_s = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - begun
    return wall_s, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def best(rounds, **commands):
    """The least wall and the least processor time of each command, run in turns."""
    of = {name: [] for name in commands}
    for _ in range(rounds):
        for name, command in commands.items():
            of[name].append(taken(command()))
    return {name: [min(each[index] for each in runs) for index in (0, 1)] for name, runs in of.items()}


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("program")
    arguments.add_argument("--rounds", type=int, default=7)
    wish = arguments.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        mission, runs = folder / "mission", iter(range(1_000_000))
        subprocess.run([wish.program, "--quiet", "scene", "mission", mission], check=True, stdout=subprocess.DEVNULL)
        images = (mission / "sites/gusev_crater.toml").read_text()
        (mission / "sites/belt.toml").write_text(BELT + images[images.index("[[images]]"):])

        def run(site, until):
            return lambda: [wish.program, "--quiet", "run", mission / f"sites/{site}.toml", "--out", folder / f"run_{next(runs)}", "--until", until]

        floors = best(
            wish.rounds,
            version=lambda: [wish.program, "--version"],
            kernels=run("gusev_crater", "load_kernels"),
            imports=lambda: [sys.executable, "-c", "import numpy, spiceypy"],
        )
        for name, what in (("version", "a process that states its version"), ("kernels", "run until load_kernels"), ("imports", "Python with numpy and spiceypy")):
            print(f"floor, {what}: {floors[name][0] * 1e3:.0f} ms, {floors[name][1] * 1e3:.0f} ms of processors")
        for site in ("gusev_crater", "belt"):
            whole = [wish.program, "--quiet", "run", mission / f"sites/{site}.toml", "--out", folder / "out"]
            subprocess.run(whole, check=True, stdout=subprocess.DEVNULL)
            script = [sys.executable, __file__, "peer", mission / f"sites/{site}.toml", folder / "answers.npz"]
            subprocess.run(script, check=True)
            print(site)
            shots = compare(folder / "out" / site, folder / "answers.npz")
            seconds = best(wish.rounds, ours=run(site, "register"), theirs=lambda: script)
            (ours, ours_cpu), (theirs, theirs_cpu) = seconds["ours"], seconds["theirs"]
            print(
                f"  {shots} shots: areograph {ours:.3f} s, {ours_cpu:.3f} s of processors; script {theirs:.3f} s, {theirs_cpu:.3f} s; "
                f"ratio {theirs / ours:.1f}, of processors {theirs_cpu / ours_cpu:.1f}",
                flush=True,
            )


if __name__ == "__main__":
    if sys.argv[1:2] == ["peer"]:
        peer(*sys.argv[2:])
    else:
        main()
