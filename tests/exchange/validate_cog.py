"""Validates every raster in a folder as cloud-optimised GeoTIFF (rio-cogeo, strict), reads it with Rasterio, and prints its name, its size, and
the number of its cells with a value."""

import json
import pathlib
import sys

import rasterio
from rio_cogeo.cogeo import cog_validate

found = {}
for path in sorted(pathlib.Path(sys.argv[1]).rglob("*.tif")):
    is_valid, errors, warnings = cog_validate(str(path), strict=True, quiet=True)
    if not is_valid or errors or warnings:
        sys.exit(f"{path}: {errors} {warnings}")
    with rasterio.open(path) as raster:
        shown = raster.read(1, masked=True).count()
        found[str(path.relative_to(sys.argv[1]))] = [raster.height, raster.width, int(shown), raster.crs.is_projected]
print(json.dumps(found))
