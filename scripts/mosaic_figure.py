"""The figure of a mosaic before and after the adjustment: a detail at the seam, and both orthoimages in red and cyan.

mosaic_figure.py SITE FILE.jpg [--place ROW_SHARE] [--metres WIDTH]: SITE is the folder of the products of a site with mosaic = true
and orthoimages_before = true. Matplotlib, NumPy and Rasterio must be installed.
"""

import argparse
import json
import pathlib

import matplotlib
import numpy as np
import rasterio
from rasterio.windows import from_bounds

matplotlib.use("Agg")
from matplotlib import pyplot as plt  # noqa: E402

SEAM = "#ffd000"


def arguments():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("site", type=pathlib.Path)
    parser.add_argument("file", type=pathlib.Path)
    parser.add_argument("--place", type=float, default=0.3, help="share of the rows above the middle of the detail")
    parser.add_argument("--metres", type=float, default=1600.0, help="edge of the detail")
    return parser.parse_args()


def read(path, bounds):
    with rasterio.open(path) as raster:
        window = from_bounds(*bounds, raster.transform)
        return raster.read(1, window=window, boundless=True, fill_value=0)


def stretched(pixels):
    known = pixels[pixels > 0]
    dark, bright = np.percentile(known, [0.5, 99.5])
    shown = np.clip((pixels.astype(float) - dark) / (bright - dark), 0.0, 1.0)
    return np.where(pixels > 0, shown, 1.0)


def detail(site, share, metres):
    """Bounds of a square about the middle of the ground at a share of the rows."""
    with rasterio.open(site / "mosaic_source.tif") as raster:
        row = int(share * raster.height)
        known = np.flatnonzero(raster.read(1)[row])
        x, y = raster.xy(row, int(known.mean()))
    half = 0.5 * metres
    return x - half, y - half, x + half, y + half


def words(pair, state):
    offsets = pair[state]
    return f"{offsets['rms_m']:.3g} m rms, {offsets['rms_cells']:.2g} cells, at {pair.get('places_in_both') or offsets['places']} places"


def main():
    of = arguments()
    images = [part["image"] for part in json.loads((of.site / "mosaic.json").read_text())["images"]][:2]
    pair = json.loads((of.site / "orthoimages.json").read_text())["pairs"][0]
    bounds = detail(of.site, of.place, of.metres)
    extent = (0.0, of.metres, 0.0, of.metres)
    figure, axes = plt.subplots(2, 2, figsize=(9.6, 10.4), layout="constrained")
    states = [("before", "Uncontrolled: orientation from the kernels", "_before"), ("after", "Controlled: adjusted orientation", "")]
    for column, (state, title, end) in enumerate(states):
        mosaic = read(of.site / f"mosaic{end}.tif", bounds)
        sources = read(of.site / f"mosaic{end}_source.tif", bounds)
        seam = axes[0, column]
        seam.imshow(stretched(mosaic), cmap="gray", vmin=0, vmax=1, extent=extent)
        rows, columns = sources.shape
        east = (np.arange(columns) + 0.5) * of.metres / columns
        north = of.metres - (np.arange(rows) + 0.5) * of.metres / rows
        seam.contour(east, north, sources == 2, levels=[0.5], colors=SEAM, linewidths=1.6, linestyles="dotted")
        seam.set_title(f"{title}\nmosaic with its seam", fontsize=11)
        both = [stretched(read(of.site / f"images/{image}/orthoimage{end}.tif", bounds)) for image in images]
        colours = axes[1, column]
        colours.imshow(np.dstack([both[0], both[1], both[1]]), extent=extent)
        colours.set_title(f"both orthoimages in red and cyan\n{words(pair, state)}", fontsize=11)
    for axis in axes.flat:
        axis.set_xticks([0, 500, 1000, 1500] if of.metres >= 1500 else [0, 0.5 * of.metres, of.metres])
        axis.set_yticks([])
        axis.set_xlabel("m")
    figure.savefig(of.file, dpi=100)


main()
