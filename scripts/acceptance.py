"""Compares points on the ground that fetched kernels give with those that NAIF prints (SPICELIB, header of SRFXPT).

Usage: acceptance.py FOLDER. Prints the largest difference in kilometres; ends with 1 above the tolerance.
"""

import math
import pathlib
import sys

import spiceypy as spice

UTC = "2003 OCT 13 06:00:00"
# The kernels of the example; leap seconds of any later version are the same in 2003.
KERNELS = [
    "naif*.tls",
    "mgs_sclkscet_*.tsc",
    "mars_iau2000_v0.tpc",
    "mgs_moc_v20.ti",
    "de*.bsp",
    "mgs_ext12_ipng_mgs95j.bsp",
    "mgs_sc_ext12.bc",
]
# Ray in the frame of the camera; radius in km, latitude and longitude in degrees, range in km, as printed.
PRINTED = [
    ([0.00000185713838, -0.00380156226592, 0.99999277403434], 3384.9411359391133, -48.477481851561002, -123.47407882634886, 388.98310724844424),
    ([0.00000185713838, 0.00380156226592, 0.99999277403434], 3384.9396987514451, -48.481636266908055, -123.39882275183645, 388.97512489721356),
    ([-0.00000185713838, 0.00380156226592, 0.99999277403434], 3384.9396899058052, -48.481661836856034, -123.39882595816586, 388.97466598000682),
    ([-0.00000185713838, -0.00380156226592, 0.99999277403434], 3384.9411270910964, -48.477507427894842, -123.47408199055646, 388.98264816551176),
    ([0.0, 0.0, 1.0], 3384.9404101835457, -48.479579751487201, -123.43645374920047, 388.97573917648396),
]
# Rays are printed with 14 decimals: 4e-12 km at this range; the rest is rounding of other machines.
TOLERANCE_KM = 1e-6


def main(folder):
    for pattern in KERNELS:
        found = sorted(folder.glob(pattern))
        if not found:
            sys.exit(f"no {pattern} in {folder}")
        spice.furnsh(str(found[-1]))
    et = spice.str2et(UTC)
    worst_km = 0.0
    for ray, radius_km, latitude_deg, longitude_deg, range_km in PRINTED:
        point, distance_km, _, _ = spice.srfxpt("Ellipsoid", "MARS", et, "LT+S", "MGS", "MGS_MOC_NA", ray)
        printed = spice.latrec(radius_km, math.radians(longitude_deg), math.radians(latitude_deg))
        worst_km = max(worst_km, math.dist(point, printed), abs(distance_km - range_km))
    print(f"largest difference: {worst_km:.3g} km; tolerance {TOLERANCE_KM} km")
    sys.exit(worst_km > TOLERANCE_KM)


main(pathlib.Path(sys.argv[1]))
