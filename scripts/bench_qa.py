"""The range of every shot of an archive against kernels, by areograph and by a script of numpy and spiceypy.

bench_qa.py AREOGRAPH ARCHIVE KERNELS.tm: whole processes in turns; the script reads states of CSPICE every four seconds and
interpolates them by cubic Hermite splines. Shots and means of all profiles are compared. Needs the Python packages
spiceypy, numpy and pyarrow. `bench_qa.py peer ARCHIVE KERNELS.tm OUT.npz` is the script by itself.
"""

import os
import pathlib
import sys
import tempfile

import bench_chain

ROUNDS = 5
# The Hermite splines of the script are within 1e-5 m of the kernels, areograph within 1 mm.
LARGEST_M = 1e-3
STEP_S = 4.0


def peer(archive, kernels, answers):
    """Shots of each orbit in each file, and the mean of range minus distance."""
    import numpy as np
    import spiceypy as spice

    archive, kernels, answers = [pathlib.Path(path).resolve() for path in (archive, kernels, answers)]
    os.chdir(kernels.parent)  # kernels are relative to their metakernel
    spice.furnsh(str(kernels))
    ra, dec, meridian = [spice.bodvrd("MARS", item, 3)[1] for item in ("POLE_RA", "POLE_DEC", "PM")]
    fields = {"orbit": (8, ">u4"), "raw_cm": (48, (">i4", 20)), "mid_cm": (128, ">i4"), "dlat_dr": (324, ">i4"), "dlon_dr": (328, ">i4"),
              "lat": (336, ">i4"), "lon": (340, ">i4"), "class": (384, (">i2", 20)), "gm": (536, ">u2"), "attitude": (538, ">u2"),
              "et": (552, ">f8"), "hz": (644, ">u4"), "range_cm": (648, (">i4", 20)), "dlat": (768, ">i4"), "dlon": (772, ">i4")}
    layout = np.dtype({"names": list(fields), "formats": [f for _, f in fields.values()], "offsets": [o for o, _ in fields.values()],
                       "itemsize": 776})
    k = np.arange(20) - 9.5
    profiles = []
    for path in sorted(archive.glob("*.b")):
        frames = np.memmap(path, layout, "r", offset=7760)
        whole = {key: frames[key].astype(float)[:, None] for key in ("mid_cm", "dlat_dr", "dlon_dr", "lat", "lon", "dlat", "dlon", "et", "hz")}
        raw_m, x = 0.01 * frames["raw_cm"], k / 20.0
        above_m = np.where((frames["gm"] >= 2)[:, None], raw_m - 0.01 * whole["mid_cm"], 0.0)
        usable = (frames["attitude"] <= 1)
        keep = usable[:, None] & (frames["class"] == 1) & (frames["range_cm"] > 0)
        lat = np.radians(1e-6 * (whole["lat"] + x * whole["dlat"]) + 1e-9 * whole["dlat_dr"] * above_m)[keep]
        lon = np.radians(1e-6 * (whole["lon"] + x * whole["dlon"]) + 1e-9 * whole["dlon_dr"] * above_m)[keep]
        et = (whole["et"] + k * 1e7 / whole["hz"])[keep] - 0.117
        radius_m, range_m = raw_m[keep], 0.01 * frames["range_cm"][keep]
        orbit = np.broadcast_to(frames["orbit"][:, None], keep.shape)[keep]
        grid = np.arange(et[0] - STEP_S, et[-1] + 2 * STEP_S, STEP_S)
        states = 1e3 * np.array([spice.spkgeo(-94, at, "J2000", 499)[0] for at in grid])
        place = (et - grid[0]) / STEP_S
        node = place.astype(int)
        s = (place - node)[:, None]
        before, after = states[node], states[node + 1]
        craft = (((1 + 2 * s) * (1 - s) ** 2) * before[:, :3] + (s * (1 - s) ** 2 * STEP_S) * before[:, 3:]
                 + (s * s * (3 - 2 * s)) * after[:, :3] + (s * s * (s - 1) * STEP_S) * after[:, 3:])
        days = et / 86400.0
        a = np.radians(90.0 + ra[0] + ra[1] * days / 36525.0)
        b = np.radians(90.0 - dec[0] - dec[1] * days / 36525.0)
        c = np.radians((meridian[0] + meridian[1] * days) % 360.0)
        # The footprint in J2000: the transpose of Mars' rotation, which has the longitude and the meridian in one angle.
        out, up = radius_m * np.cos(lat), radius_m * np.sin(lat)
        u, v = out * np.cos(lon + c), out * np.sin(lon + c)
        v, w = np.cos(b) * v - np.sin(b) * up, np.sin(b) * v + np.cos(b) * up
        u, v = np.cos(a) * u - np.sin(a) * v, np.sin(a) * u + np.cos(a) * v
        residual_m = range_m - np.sqrt((craft[:, 0] - u) ** 2 + (craft[:, 1] - v) ** 2 + (craft[:, 2] - w) ** 2)
        for number, index in zip(*np.unique(orbit, return_index=True)):
            of = residual_m[orbit == number]
            profiles.append((path.name, number, len(of), of.mean(), of.std()))
    names, numbers, shots, means, spreads = zip(*profiles)
    np.savez(answers, name=names, orbit=numbers, shots=shots, mean_m=means, spread_m=spreads)


def main(program, archive, kernels):
    import numpy as np
    import pyarrow.parquet as parquet

    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        script = [sys.executable, __file__, "peer", archive, kernels, folder / "answers.npz"]
        outs = iter(range(1_000_000))

        def ours():
            # Exit code 5 states that a profile exceeds a limit, as some of the synthetic ones do.
            check = f'"{program}" --quiet pedr qa "{archive}" --kernels "{kernels}" --out "{folder}/qa_{next(outs)}" || [ $? = 5 ]'
            return ["sh", "-c", check]

        seconds = bench_chain.best(ROUNDS, ours=ours, theirs=lambda: script)
        found = parquet.read_table(folder / "qa_0/profiles.parquet", columns=["file", "orbit", "shots", "mean_m"]).to_pylist()
        theirs = np.load(folder / "answers.npz")
        by_orbit = {}
        for row in found:
            shots, sum_m = by_orbit.get((row["file"], row["orbit"]), (0, 0.0))
            by_orbit[row["file"], row["orbit"]] = (shots + row["shots"], sum_m + row["shots"] * row["mean_m"])
        if len(by_orbit) != len(theirs["name"]):
            sys.exit(f"areograph checks {len(by_orbit)} profiles, the script {len(theirs['name'])}")
        largest_m, total = 0.0, 0
        for file, orbit, shots, mean_m in zip(theirs["name"], theirs["orbit"], theirs["shots"], theirs["mean_m"]):
            ours_shots, sum_m = by_orbit.get((str(file), int(orbit)), (0, 0.0))
            if ours_shots != shots:
                sys.exit(f"{file}, orbit {orbit}: areograph checks {ours_shots} shots, the script {shots}")
            largest_m, total = max(largest_m, abs(sum_m / ours_shots - mean_m)), total + shots
        if not largest_m <= LARGEST_M:
            sys.exit(f"means of areograph and of the script differ by {largest_m} m; expected {LARGEST_M} at most")
        print(f"{total} shots in {len(by_orbit)} profiles; means differ by up to {largest_m:.1e} m")
        for name, (wall_s, cpu_s) in seconds.items():
            print(f"  {name}: {wall_s:.2f} s, {cpu_s:.2f} s of processors, {total / cpu_s / 1e6:.2f} million shots per second of a processor")
        print(f"  ratio {seconds['theirs'][0] / seconds['ours'][0]:.1f}, of processors {seconds['theirs'][1] / seconds['ours'][1]:.1f}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["peer"]:
        peer(*sys.argv[2:])
    else:
        main(*sys.argv[1:])
