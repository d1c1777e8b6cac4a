"""Pushbroom cameras: support data, orientation, and projection from the ground to the image and back."""

from __future__ import annotations

import json
import os
import re
import tempfile
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeAlias, cast

import numpy
import pyarrow

from . import _native
from ._common import Paths, StrPath, column, optional, paths_of, provenance_text
from .errors import AreographError, InputError, InvalidProducts, UsageError
from .results import open_result

if TYPE_CHECKING:
    from xarray import Dataset
    from numpy.typing import NDArray

#: Support data, or their file (``.json``).
Image: TypeAlias = "dict[str, Any] | StrPath"
Numbers: TypeAlias = "NDArray[numpy.float64]"

#: Iterations of ray and surface, and the change of the radius at which they end, metres.
_ITERATIONS = 50
_TOLERANCE_M = 1e-3


def load(label: StrPath, kernels: Paths | None = None, *, format: str = "isd") -> dict[str, Any]:
    """Compute the support data of an image (ISD of the Community Sensor Model) from its label and kernels.

    Parameters
    ----------
    label
        Label of a MOC image, or a file with its label, such as ``.imq``.
    kernels
        A metakernel (``.tm``), a folder of kernels, or kernels in load order.
    format
        ``"isd"``, the only format.

    Returns
    -------
    dict
        Support data as ``usgscsm`` reads them, the file ``isd.json`` of a run. They state the pointing bias and the
        light-time convention; see the guide for the differences from ALE. The identifier is the product identifier in
        the label.

    Raises
    ------
    CoverageError
        If the kernels do not cover the image.
    InvalidProducts
        If the orientation is invalid, for example because an attitude is held over gaps in the kernels.
    """
    if format != "isd":
        raise UsageError(f"format is {format!r}; expected 'isd'")
    if kernels is None:
        raise UsageError("no kernels; expected a metakernel, a folder, or kernels in load order")
    files = [os.path.abspath(path) for path in paths_of(kernels)]
    if not files:
        raise UsageError("no kernels; expected a metakernel, a folder, or kernels in load order")
    if len(files) == 1 and os.path.isdir(files[0]):
        source = f"root = {_text(files[0])}"
    elif len(files) == 1 and files[0].lower().endswith(".tm"):
        source = f"metakernel = {_text(files[0])}"
    else:
        source = f"files = [{', '.join(map(_text, files))}]"
    path = os.path.abspath(label)
    if not os.path.isfile(path):
        raise InputError(f"{path}: no such file; expected the label of an image")
    name = _identifier(_native.product_id(path) or os.path.splitext(os.path.basename(path))[0])
    with tempfile.TemporaryDirectory() as folder:
        site, out = os.path.join(folder, "site.toml"), os.path.join(folder, "out")
        with open(site, "w", encoding="utf-8") as file:
            file.write(f'site = "image"\n[kernels]\n{source}\n')
            file.write(f"[[images]]\nid = {_text(name)}\nlabel = {_text(path)}\n")
        # Its remarks concern the missing shots.
        try:
            _native.run(site, out, False)
        except AreographError as error:
            # The site and its stages are those of this function alone.
            error.args = (re.sub(r"^image/[^:]*: ", "", str(error)),)
            error.site = error.stage = None
            raise
        result = open_result(os.path.join(out, "image"))
        if not result.valid:
            raise InvalidProducts(f"{path}: {'; '.join(result.reasons)}")
        return result.isd(result.images[0])


def orientation(image: Image, kernels: Paths | None = None, *, step_lines: float = 1.0) -> Dataset:
    """Compute position and attitude of the camera along an image.

    Parameters
    ----------
    image
        Support data or their file (``.json``); with ``kernels``, a label.
    kernels
        As for `load`.
    step_lines
        Lines between two poses; the last line is included.

    Returns
    -------
    xarray.Dataset
        ``position_m`` (``line``, ``xyz``): perspective centre, body-fixed, in the light-time convention of the support
        data; ``quaternion`` (``line``, ``wxyz``): rotation from the axes of the camera to those of the body;
        coordinates ``line`` (0 at the outer edge of the first line) and ``et_s``.
    """
    xarray = optional("xarray")
    if not step_lines > 0.0:
        raise UsageError(f"step_lines is {step_lines}; expected a number above 0")
    isd = load(cast(StrPath, image), kernels) if kernels is not None else _support(image)
    camera = _camera(isd)
    lines = camera.shape[0]
    line = numpy.arange(0.0, lines, step_lines)
    line = numpy.append(line, float(lines))
    table = pyarrow.table(camera.poses(line))
    names = table.column_names
    values = numpy.column_stack([table[name].to_numpy() for name in names])
    dataset: Dataset = xarray.Dataset(
        {
            "position_m": (("line", "xyz"), values[:, 1:4], {"units": "m"}),
            "quaternion": (("line", "wxyz"), values[:, 4:8]),
        },
        coords={
            "line": ("line", line, {"long_name": "line, 0 at the outer edge of the first"}),
            "et_s": ("line", values[:, 0], {"units": "s", "long_name": "TDB seconds past J2000"}),
            "xyz": ["x", "y", "z"],
            "wxyz": ["w", "x", "y", "z"],
        },
        attrs=provenance_text(image=isd.get("image_identifier"), support=isd.get("areograph")),
    )
    return dataset


def ground_to_image(
    image: Image, longitude_deg: Any, latitude_deg: Any, radius_m: Any
) -> tuple[Numbers, Numbers, NDArray[numpy.bool_]]:
    """Find the lines and samples at which an image shows points on the ground.

    Parameters
    ----------
    image
        Support data or their file.
    longitude_deg, latitude_deg, radius_m
        Points: east longitude, areocentric latitude, distance from the centre of the body; numbers or arrays of one
        shape.

    Returns
    -------
    line, sample, valid
        Lines and samples are 0 at the outer edge of the first line or sample. ``valid`` states whether the image shows
        the point. Line and sample are NaN for a point that no line sees: behind the camera, on the far side of the
        body, or with invalid coordinates. Occlusion by terrain is not examined.
    """
    points, shape = _broadcast(longitude_deg=longitude_deg, latitude_deg=latitude_deg, radius_m=radius_m)
    table = pyarrow.table(_camera(_support(image)).project(*points))
    line, sample, valid = (
        numpy.array(table[name].to_numpy()).reshape(shape) for name in ("line", "sample", "valid")
    )
    return line, sample, valid


def image_to_ground(
    image: Image,
    line: Any,
    sample: Any,
    *,
    surface: float | Callable[[Numbers, Numbers], Any] | None = None,
) -> tuple[Numbers, Numbers, Numbers]:
    """Find the points on the ground at image positions.

    Parameters
    ----------
    image
        Support data or their file.
    line, sample
        Positions, 0 at the outer edge of the first line or sample; numbers or arrays of one shape.
    surface
        The ground: a radius in metres, or a function that returns radii in metres for arrays of longitudes (0 to 360)
        and latitudes in degrees; these are NaN for positions outside the image. By default the ellipsoid of the body.

    Returns
    -------
    longitude_deg, latitude_deg, radius_m
        NaN where the position is outside the image, a ray meets no ground, or the iteration over ``surface`` does not
        converge to 1 mm. Support data state no accuracy: for standard deviations, use the products of an adjustment.
    """
    (lines, samples), shape = _broadcast(line=line, sample=sample)
    camera, pixels = _camera(_support(image)), (lines, samples)
    if surface is None:
        ground = _ground(camera.intersect(*pixels))
    elif callable(surface):
        ground = _on_surface(camera, pixels, surface)
    else:
        radii_m = column(surface, "surface")
        if len(radii_m) != 1:
            raise UsageError("surface is an array; expected a radius, or a function of longitude and latitude")
        spheres_m = numpy.full(pixels[0].shape, radii_m[0])
        ground = _ground(camera.intersect(*pixels, spheres_m))
    longitude_deg, latitude_deg, radius_m = (values.reshape(shape) for values in ground)
    return longitude_deg, latitude_deg, radius_m


def _on_surface(
    camera: _native.Camera, pixels: tuple[Numbers, Numbers], surface: Callable[[Numbers, Numbers], Any]
) -> list[Numbers]:
    longitude_deg, latitude_deg, radius_m = _ground(camera.intersect(*pixels))
    change_m = numpy.full(radius_m.shape, numpy.inf)
    for _ in range(_ITERATIONS):
        radii_m = column(surface(longitude_deg, latitude_deg), "the result of surface")
        if len(radii_m) not in (1, len(radius_m)):
            expected = f"1, or one for each of {len(radius_m)} places"
            raise UsageError(f"surface returned {len(radii_m)} radii; expected {expected}")
        surface_m = numpy.ascontiguousarray(numpy.broadcast_to(radii_m, radius_m.shape))
        # A place outside the surface keeps NaN from here on.
        change_m = numpy.abs(surface_m - radius_m)
        longitude_deg, latitude_deg, radius_m = _ground(camera.intersect(*pixels, surface_m))
        if not numpy.any(change_m > _TOLERANCE_M):
            break
    found = change_m <= _TOLERANCE_M
    return [numpy.where(found, values, numpy.nan) for values in (longitude_deg, latitude_deg, radius_m)]


def _ground(columns: _native.Columns) -> list[Numbers]:
    table = pyarrow.table(columns)
    return [numpy.array(table[name].to_numpy()) for name in ("longitude_deg", "latitude_deg", "radius_m")]


def _broadcast(**values: Any) -> tuple[list[Numbers], tuple[int, ...]]:
    """Return numbers as columns of equal length, and their common shape."""
    arrays = {name: numpy.ma.asanyarray(of) if numpy.ma.isMaskedArray(of) else of for name, of in values.items()}
    shape = numpy.broadcast_shapes(*(numpy.shape(of) for of in arrays.values()))
    columns = []
    for name, of in arrays.items():
        numbers = column(of, name).reshape(numpy.shape(of))
        columns.append(numpy.ascontiguousarray(numpy.broadcast_to(numbers, shape)).reshape(-1))
    return columns, shape


def _support(image: Image) -> dict[str, Any]:
    if isinstance(image, dict):
        return image
    path = os.fspath(image)
    try:
        with open(path, encoding="utf-8") as file:
            return cast("dict[str, Any]", json.load(file))
    except ValueError:
        expected = "support data (JSON); for a label use load(label, kernels)"
        raise InputError(f"{path}: not JSON; expected {expected}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot read: {error.strerror}") from error


def _camera(isd: dict[str, Any]) -> _native.Camera:
    # NumPy's numbers are numbers too.
    return _native.Camera(json.dumps(isd, default=lambda value: value.item()))


def _identifier(name: str) -> str:
    """Return a name as an identifier of images: 1 to 64 letters, digits, `_` or `-`."""
    return re.sub(r"[^A-Za-z0-9_-]", "-", name)[:64] or "image"


def _text(path: str) -> str:
    # A basic string of TOML has the escapes of JSON.
    return json.dumps(path, ensure_ascii=False)
