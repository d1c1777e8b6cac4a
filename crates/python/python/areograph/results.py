"""Products of one site, read from the folder that a run has written.

Coordinates are body-fixed (Mars: IAU 2000), with planetocentric latitudes and east longitudes. Names of columns end in
the unit; `docs/products.md` describes every column.
"""

from __future__ import annotations

import importlib
import json
import math
import os
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

from .errors import InputError

if TYPE_CHECKING:
    from geopandas import GeoDataFrame
    from pandas import DataFrame
    import pyarrow

__all__ = ["Result", "open_result"]

Read = TypeVar("Read")

MANIFEST = "manifest.json"
FOOTPRINTS = "footprints.parquet"
TABLE = ".parquet"

_TIES = "tie points: add [ties] to the site file and run the site again"
_ADJUSTMENT = "an adjustment, which requires [ties] in the site file and enough usable tie points"
# Products that only some sites have, by file name, and what these sites have.
_REQUIRED = {
    "ties.parquet": _TIES,
    "height_check.parquet": _TIES,
    "adjusted_footprints.parquet": _ADJUSTMENT,
    "registration_adjusted.parquet": _ADJUSTMENT,
    "correlations.parquet": _ADJUSTMENT,
    "adjustment.json": _ADJUSTMENT,
    "adjusted_orientation.parquet": _ADJUSTMENT,
    "adjusted_orientation.json": _ADJUSTMENT,
    "adjusted_isd.json": _ADJUSTMENT,
    "adjusted.tm": _ADJUSTMENT,
    "registered_footprints.parquet": "footprints inside its images",
    "surface_above_sphere.tif": "a terrain model: two images with pixels, and cell_m in [surface] of the site file",
    "surface_above_areoid.tif": "a terrain model: two images with pixels, and cell_m in [surface] of the site file",
    "surface_hillshade.tif": "a terrain model: two images with pixels, and cell_m in [surface] of the site file",
    "surface_slope.tif": "a terrain model: two images with pixels, and cell_m in [surface] of the site file",
    "surface_sigma.tif": "a terrain model: two images with pixels, and cell_m in [surface] of the site file",
    "surface.json": "a terrain model: two images with pixels, and cell_m in [surface] of the site file",
    "overlay.png": "pixels of this image",
}


def open_result(folder: str | os.PathLike[str]) -> Result:
    """Open the products of one site.

    Parameters
    ----------
    folder
        Folder of the site: ``<out>/<site>`` of ``areograph run <site>.toml --out <out>``.

    Returns
    -------
    Result
        Only the manifest is read here. The other products are read on first access.

    Raises
    ------
    InputError
        If the folder has no manifest, or if the manifest does not describe the products of a site.
    """
    return Result(folder)


class Result:
    """Products of one site.

    Each product is read on first access and then kept; further accesses return the same object. Every table has its
    provenance in ``.attrs["areograph"]``: ``version``, ``site``, ``verdict``, ``file`` and its ``blake3``, ``kernels``
    (``name`` and ``blake3`` in load order) and ``units`` of the columns.

    Parameters
    ----------
    folder
        Folder of the site.
    """

    folder: Path
    """Folder of the site."""
    manifest: dict[str, Any]
    """The content of ``manifest.json``."""

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        self.manifest = _read_manifest(self.folder)
        self._products: dict[str, dict[str, Any]] = {product["path"]: product for product in self.manifest["products"]}
        self._kept: dict[str, Any] = {}
        if FOOTPRINTS not in self._products:
            raise InputError(
                f"{self.folder / MANIFEST}: no {FOOTPRINTS} in the products; "
                "expected the folder of a site, which areograph run writes"
            )

    def __repr__(self) -> str:
        counts = self.manifest.get("counts", {})
        measurements = self._products.get("ties.parquet", {}).get("rows", 0)
        return (
            f"<Result {self.site}: {self.verdict}; {_counted(counts.get('footprints', 0), 'footprint')} in "
            f"{_counted(counts.get('profiles', 0), 'profile')}, {_counted(len(self.images), 'image')},\n "
            f"{_counted(measurements, 'tie-point measurement')}; areograph {self.manifest['version']}>"
        )

    @property
    def site(self) -> str:
        """Identifier of the site."""
        return cast(str, self.manifest["site"])

    @property
    def valid(self) -> bool:
        """Whether no limit is exceeded."""
        return cast(bool, self.manifest["verdict"]["valid"])

    @property
    def verdict(self) -> str:
        """``"valid"``, ``"valid with remarks"`` or ``"INVALID"``, as the program reports it."""
        if not self.valid:
            return "INVALID"
        return "valid with remarks" if self.remarks else "valid"

    @property
    def reasons(self) -> list[str]:
        """Exceeded limits, one sentence each; empty if the site is valid."""
        return list(self.manifest["verdict"]["reasons"])

    @property
    def remarks(self) -> list[str]:
        """Remarks that concern no exceeded limit, one sentence each."""
        return list(self.manifest["verdict"]["remarks"])

    @property
    def untested(self) -> list[str]:
        """Errors that the data of the run cannot detect, one phrase each."""
        return list(self.manifest["verdict"].get("untested", []))

    @property
    def products(self) -> list[str]:
        """Paths of all products below the folder, as the manifest lists them."""
        return list(self._products)

    @property
    def images(self) -> list[str]:
        """Identifiers of the images, in the order of the manifest."""
        parts = (path.split("/") for path in self._products)
        return list(dict.fromkeys(part[1] for part in parts if part[0] == "images"))

    @cached_property
    def checks(self) -> DataFrame:
        """Checks of the verdict; failed checks come first.

        Columns: ``kind``, ``what``, ``outcome`` (``fail``, ``warning``, ``pass``), ``subject``, ``value`` and ``limit``
        in ``unit``, and ``share_of_limit``: the fraction of the limit that is used, above 1 if the limit is exceeded,
        missing if a passed check has no number.
        """
        pandas = _optional("pandas")
        names = ["kind", "what", "outcome", "subject", "value", "limit", "unit"]
        checks: list[dict[str, Any]] = self.manifest["verdict"]["checks"]
        frame = pandas.DataFrame(checks, columns=names).astype({"value": float, "limit": float})
        frame["share_of_limit"] = [_share_of_limit(check) for check in checks]
        checked: DataFrame = self._with_provenance(frame, MANIFEST, {})
        return checked

    @property
    def footprints(self) -> GeoDataFrame:
        """Footprints of the laser shots inside the windows.

        Other tables refer to the row numbers of this table in ``footprint_row``. Longitudes are 0 to 360 degrees in
        ``longitude_deg`` and -180 to 180 degrees in ``geometry``, in the same frame.
        """
        return self._table_of_points(FOOTPRINTS)

    @property
    def shots(self) -> GeoDataFrame:
        """Footprints inside images, one row per footprint and image.

        Columns contain time (UTC), longitude and latitude (degrees), heights (metres), and line and sample with the
        orientation from the kernels (``before_``) and with the adjusted orientation (``adjusted_``). Lines and samples
        are 0 at the outer edge of the first line or sample and 0.5 at its centre. The adjusted values are missing
        without an adjustment.
        """
        return self._table_of_points("registered_footprints.parquet")

    @property
    def ranges(self) -> DataFrame:
        """Range residuals of the shots, metres: measured range minus distance between spacecraft and footprint."""
        return self._table_of("ranges.parquet")

    @property
    def registration(self) -> DataFrame:
        """Line and sample of every footprint in every image, with the orientation from the kernels.

        The table contains positions outside the image as well; ``inside`` states whether the delivered image shows the
        footprint. Lines and samples are 0 at the outer edge of the first line or sample.
        """
        return self._table_of("registration.parquet")

    @property
    def ties(self) -> DataFrame:
        """Measurements of tie points, with ground points and residuals before and after the adjustment.

        Ground points are body-fixed, in metres; residuals are in lines or pixels.

        Raises
        ------
        InputError
            If the site has no tie points.
        """
        return self._table_of("ties.parquet")

    @property
    def heights(self) -> DataFrame:
        """Heights of tie points above the MOLA surface, metres, before and after the adjustment.

        Rows with ``kind`` ``footprint`` are footprints that both images of a pair show.

        Raises
        ------
        InputError
            If the site has no tie points.
        """
        return self._table_of("height_check.parquet")

    @property
    def terrain(self) -> Path:
        """Path of the terrain model (GeoTIFF): heights above the map sphere, metres.

        Cells without a height contain -32768.

        Raises
        ------
        InputError
            If the site has no terrain model.
        """
        return self.path("surface_above_sphere.tif")

    def orientation(self, image: str, *, adjusted: bool = False) -> DataFrame:
        """Positions and rotations of the camera, sampled along an image.

        Parameters
        ----------
        image
            Identifier of the image, as in ``images``.
        adjusted
            The adjusted orientation instead of the one from the kernels.

        Returns
        -------
        pandas.DataFrame
            Epochs in TDB seconds past J2000; perspective centres in metres and rotations in radians, body-fixed.
        """
        return self._table_of(self._of_image(image, "orientation.parquet", adjusted))

    def isd(self, image: str, *, adjusted: bool = False) -> dict[str, Any]:
        """Camera model of an image: image support data of the Community Sensor Model.

        Positions follow the light-time convention of the run; ``path("exchange/centre/IMAGE_isd.json")`` is the file of
        the camera model that follows the convention of ISIS and ALE.

        Parameters
        ----------
        image
            Identifier of the image, as in ``images``.
        adjusted
            The adjusted camera model instead of the one from the kernels.
        """
        path = self._of_image(image, "isd.json", adjusted)
        return self._once(path, lambda file: cast(dict[str, Any], json.loads(file.read_text(encoding="utf-8"))))

    def table(self, name: str) -> pyarrow.Table:
        """Any Parquet product as an Arrow table. The fields state units and descriptions in their metadata.

        Parameters
        ----------
        name
            Path below the folder, with or without ``.parquet``: ``"ties"``, ``"images/E02-00665/orientation"``.
        """
        parquet = _optional("pyarrow.parquet")
        path = name if name.endswith(TABLE) else name + TABLE
        if path not in self._products:
            tables = ", ".join(path.removesuffix(TABLE) for path in self._products if path.endswith(TABLE))
            raise InputError(f"{self._missing(path)}; its tables: {tables}")
        # Two objects belong to one file: the Arrow table and the DataFrame.
        return self._once(path, parquet.read_table, key=f"arrow:{path}")

    def path(self, product: str) -> Path:
        """Path of a product file, whose existence and size are checked.

        Parameters
        ----------
        product
            Path below the folder, as in ``products``.
        """
        entry = self._products.get(product)
        if entry is None:
            raise InputError(self._missing(product))
        file = self.folder / product
        if not file.is_file():
            raise InputError(f"{file} is missing, although {MANIFEST} lists it; run the site again")
        size = file.stat().st_size
        if size != entry["bytes"]:
            raise InputError(
                f"{file} has {size} bytes; expected {entry['bytes']} according to {MANIFEST}: "
                "the file was changed after the run; run the site again"
            )
        return file

    def _missing(self, product: str) -> str:
        required = _REQUIRED.get(product.rsplit("/", 1)[-1])
        need = "" if required is None else f"; expected a site with {required}"
        return f"{self.site} has no {product}{need}"

    def _of_image(self, image: str, name: str, adjusted: bool) -> str:
        if image not in self.images:
            raise InputError(f"unknown image {image!r} of {self.site}; expected one of {', '.join(self.images)}")
        return f"images/{image}/{'adjusted_' if adjusted else ''}{name}"

    def _once(self, product: str, read: Callable[[Path], Read], key: str | None = None) -> Read:
        key = key or product
        if key not in self._kept:
            self._kept[key] = read(self.path(product))
        return cast(Read, self._kept[key])

    def _table_of(self, product: str) -> DataFrame:
        parquet = _optional("pyarrow.parquet")
        _optional("pandas")

        def read(file: Path) -> DataFrame:
            table = parquet.read_table(file)
            frame: DataFrame = self._with_provenance(table.to_pandas(), product, _units(table.schema))
            return frame

        return self._once(product, read)

    def _table_of_points(self, product: str) -> GeoDataFrame:
        parquet, points = _optional("pyarrow.parquet"), _optional("geopandas")

        def read(file: Path) -> GeoDataFrame:
            # GeoPandas drops the metadata of the fields, which contain the units.
            return self._with_provenance(points.read_parquet(file), product, _units(parquet.read_schema(file)))

        return self._once(product, read)

    def _with_provenance(self, frame: Any, file: str, units: dict[str, str]) -> Any:
        # Plain types only: pandas writes attrs into Parquet files as JSON.
        frame.attrs["areograph"] = {
            "version": self.manifest["version"],
            "site": self.site,
            "verdict": self.verdict,
            "file": file,
            "blake3": self._products.get(file, {}).get("blake3"),
            "kernels": [{"name": kernel["name"], "blake3": kernel["blake3"]} for kernel in self.manifest["kernels"]],
            "units": units,
        }
        return frame


def _read_manifest(folder: Path) -> dict[str, Any]:
    file = folder / MANIFEST
    try:
        manifest = json.loads(file.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        sites = sorted(str(found.parent) for found in folder.glob(f"*/{MANIFEST}"))
        known = f", such as {sites[0]}" if sites else ", which areograph run writes"
        raise InputError(f"{folder} has no {MANIFEST}; expected the folder of a site{known}") from None
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise InputError(f"{file} is malformed: {error}") from error
    tool = manifest.get("tool") if isinstance(manifest, dict) else None
    if tool != "areograph":
        raise InputError(f"{file}: tool is {tool!r}; expected 'areograph'")
    lacking = [key for key in ("version", "site", "verdict", "kernels", "products") if key not in manifest]
    if lacking:
        raise InputError(f"{file} is malformed: no {', '.join(lacking)}")
    return cast(dict[str, Any], manifest)


def _share_of_limit(check: dict[str, Any]) -> float:
    value, limit, passed = check.get("value"), check.get("limit"), check["outcome"] == "pass"
    if value is None or limit is None:
        return math.nan if passed else math.inf
    low, high = sorted((abs(value), abs(limit)))
    # The manifest does not state which limits are lower limits, but the outcome decides the side.
    if passed:
        return low / high if high > 0.0 else 0.0
    return high / low if low > 0.0 else math.inf


def _units(schema: Any) -> dict[str, str]:
    units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in schema}
    return {name: unit for name, unit in units.items() if unit}


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


def _optional(module: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise ImportError(
            f"Tables require {package}, which cannot be imported ({error}); install it with pip"
        ) from error
