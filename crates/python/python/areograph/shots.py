"""Laser shots: read, searched, joined into tracks, compared with kernels."""

from __future__ import annotations

import datetime
import json
import os
import tempfile
import warnings
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy
import pyarrow
import pyarrow.compute

from . import _native
from ._common import (
    Paths,
    StrPath,
    column,
    kernels_at,
    kernels_of,
    optional,
    paths_of,
    provenance,
    utc_text,
)
from .errors import UsageError

if TYPE_CHECKING:
    from geopandas import GeoDataFrame
    from pandas import DataFrame

# A box, a file of GeoJSON, or an object with __geo_interface__ (GeoPandas, Shapely).
Area: TypeAlias = Any
Time: TypeAlias = "float | str | datetime.datetime | numpy.datetime64 | None"

#: Radius of the sphere of the coordinate reference system, metres: heights of points refer to it.
_SPHERE_M = 3_396_190.0
_CHANNELS = (1, 2, 3, 4)
#: Seconds between two shots beyond which a track does not join them.
_GAP_S = 2.0
# Columns that only a search with windows has, or that other columns repeat.
_OF_SEARCH = ("windows", "geometry")


def read_pedr(
    path: Paths, *, orbits: int | Iterable[int] | None = None, columns: str | Sequence[str] | None = None
) -> pyarrow.Table:
    """Read every shot with a return from PEDR files, whatever its class.

    Parameters
    ----------
    path
        PEDR files and folders that contain them, or tables of the Orbital Data Explorer.
    orbits
        Only shots of these orbits, as the files number them.
    columns
        Names of columns, in the order of the result; by default all. Fewer columns are read faster.

    Returns
    -------
    pyarrow.Table
        Shots in time order, with the columns of ``footprints.parquet``, in IAU 2000. Fields state their description
        and unit in their metadata. The metadata ``areograph`` of the schema is a JSON statement of the files, and of
        records with errors, whose invalid shots are omitted.

    Raises
    ------
    InputError
        If a file is damaged, or two files contain the same shots.

    Warns
    -----
    UserWarning
        If invalid shots of records with errors are omitted.
    """
    known = [name for name in _native.shot_columns() if name not in _OF_SEARCH]
    if isinstance(columns, str):
        columns = [columns]
    wanted = list(known if columns is None else columns)
    _require_known(wanted, known)
    if isinstance(orbits, int):
        orbits = [orbits]
    read = wanted if orbits is None or "orbit" in wanted else [*wanted, "orbit"]
    table, statement = _search(path, columns=read, check_all=True)
    if orbits is not None:
        try:
            members = pyarrow.array(sorted(set(orbits)), type=table.schema.field("orbit").type)
        except (pyarrow.ArrowException, OverflowError, TypeError):
            raise UsageError(f"orbits are {orbits!r}; expected orbit numbers") from None
        table = table.filter(pyarrow.compute.is_in(table["orbit"], members))
        statement["orbits"] = members.to_pylist()
    table = table.select(wanted)
    metadata = {**(table.schema.metadata or {}), b"areograph": json.dumps(statement).encode()}
    metadata.pop(b"geo", None)
    return table.replace_schema_metadata(metadata)


def search_shots(
    archive: Paths,
    aoi: Area = None,
    *,
    t0: Time = None,
    t1: Time = None,
    classes: Sequence[int] = (1,),
    channels: Sequence[int] = _CHANNELS,
    attitude_flags: Sequence[int] = (0, 1),
    max_off_nadir_deg: float = 90.0,
    solar_longitude_deg: tuple[float, float] = (0.0, 360.0),
    leap_seconds: StrPath | None = None,
) -> GeoDataFrame:
    """Find the shots of an archive in an area, each by its own position.

    An index beside the files (``areograph pedr index``) makes the search faster and does not change the result.

    Parameters
    ----------
    archive
        PEDR files and folders that contain them, or tables of the Orbital Data Explorer.
    aoi
        Area: ``(west, east, south, north)`` in degrees, east longitudes -180 to 360 (west above east crosses 0 or
        180); a GeoJSON file; or polygons of GeoPandas or Shapely, without a coordinate reference system or in
        IAU_2015:49900. By default all of Mars.
    t0, t1
        First and last time tag: TDB seconds past J2000, or UTC as text or datetime, which requires ``leap_seconds``.
    classes
        Classification codes to keep: 1 ground, 0 cloud or noise.
    channels, attitude_flags
        Trigger channels and attitude flags to keep.
    max_off_nadir_deg
        Largest off-nadir angle of the laser.
    solar_longitude_deg
        First and last areocentric longitude of the Sun, 0 to 360 degrees: the season of Mars. If the first exceeds the
        last, the interval contains 0.
    leap_seconds
        Leap-second kernel, such as ``naif0012.tls``.

    Returns
    -------
    geopandas.GeoDataFrame
        Shots in time order. ``geometry`` contains longitudes from -180 to 180 degrees, areocentric latitudes, and heights
        above the sphere of radius 3396190 m (IAU_2015:49900). ``attrs["areograph"]`` states request, files and
        completeness.

    Raises
    ------
    InputError
        If a file cannot be searched.
    UsageError
        If the area, the time interval or the filter is invalid.

    Warns
    -----
    UserWarning
        If invalid shots of records with errors are omitted.
    """
    optional("geopandas")
    names = [name for name in _native.shot_columns() if name != "geometry"]
    shot_filter = (
        list(classes),
        list(channels),
        list(attitude_flags),
        float(max_off_nadir_deg),
        [float(longitude) for longitude in solar_longitude_deg],
    )
    time_s = _interval(t0, t1, leap_seconds)
    table, statement = _search(
        archive, aoi, columns=names, shot_filter=shot_filter, time_s=time_s, check_all=False
    )
    return _frame_of_points(table, statement)


def tracks(
    archive: Paths,
    aoi: Area = None,
    *,
    t0: Time = None,
    t1: Time = None,
    leap_seconds: StrPath | None = None,
) -> GeoDataFrame:
    """Join the ground shots of an archive into tracks, one for each profile.

    A profile is the part of one orbit in the area; a pause of more than 300 s starts another profile.

    Parameters
    ----------
    archive, aoi, t0, t1, leap_seconds
        As for `search_shots`.

    Returns
    -------
    geopandas.GeoDataFrame
        ``orbit``, ``shots``, ``et_start_s``, ``et_stop_s`` and ``geometry``: lines through the footprints, divided
        where more than 2 s separate two shots, and at 180 degrees of longitude. A part with a single shot has no line;
        profiles without any line have points.
    """
    geopandas, shapely = optional("geopandas"), optional("shapely")
    names = ["et_tag_s", "orbit", "longitude_deg", "latitude_deg"]
    shot_filter = ([1], list(_CHANNELS), [0, 1], 90.0, [0.0, 360.0])
    time_s = _interval(t0, t1, leap_seconds)
    table, statement = _search(
        archive, aoi, columns=names, shot_filter=shot_filter, time_s=time_s, check_all=False
    )
    et_s, orbit = (table[name].to_numpy() for name in names[:2])
    east_deg = _signed(table["longitude_deg"].to_numpy())
    points_deg = numpy.column_stack([east_deg, table["latitude_deg"].to_numpy()])
    begins = (numpy.diff(orbit) != 0) | (numpy.diff(et_s) > _native.PROFILE_PAUSE_S)
    tracks: dict[str, list[Any]] = {"orbit": [], "shots": [], "et_start_s": [], "et_stop_s": [], "geometry": []}
    for rows in numpy.split(numpy.arange(len(et_s)), numpy.flatnonzero(begins) + 1):
        if len(rows) == 0:
            continue
        gaps = numpy.flatnonzero(numpy.diff(et_s[rows]) > _GAP_S) + 1
        parts = [part for run in numpy.split(points_deg[rows], gaps) for part in _at_antimeridian(run)]
        lines = [part for part in parts if len(part) > 1]
        tracks["orbit"].append(int(orbit[rows[0]]))
        tracks["shots"].append(len(rows))
        tracks["et_start_s"].append(et_s[rows[0]])
        tracks["et_stop_s"].append(et_s[rows[-1]])
        if not lines:
            tracks["geometry"].append(shapely.MultiPoint(points_deg[rows]))
        elif len(lines) == 1:
            tracks["geometry"].append(shapely.LineString(lines[0]))
        else:
            tracks["geometry"].append(shapely.MultiLineString(lines))
    columns = {
        "orbit": numpy.array(tracks["orbit"], dtype=numpy.uint32),
        "shots": numpy.array(tracks["shots"], dtype=numpy.int64),
        "et_start_s": numpy.array(tracks["et_start_s"], dtype=numpy.float64),
        "et_stop_s": numpy.array(tracks["et_stop_s"], dtype=numpy.float64),
    }
    frame = geopandas.GeoDataFrame(columns, geometry=tracks["geometry"], crs=_crs(table))
    frame.attrs = provenance(search=statement)
    return frame


def check_ranges(
    shots: pyarrow.Table | DataFrame, kernels: Paths, *, clock_bias_s: float | None = None
) -> DataFrame:
    """Compare measured ranges with the distances between footprints and the spacecraft positions from kernels.

    Parameters
    ----------
    shots
        Result of `read_pedr` or `search_shots`, or footprints of a site.
    kernels
        A metakernel (``.tm``), or kernels in load order: leap seconds, clock and the orbit of the spacecraft.
    clock_bias_s
        Seconds by which the time tags are late; 0 leaves them unchanged. By default the bias of the MOLA clock,
        0.117 s (Shan et al. 2005).

    Returns
    -------
    pandas.DataFrame
        For every shot, with the index of ``shots``: ``distance_m``; ``range_minus_distance_m`` with the radius of the
        footprint before the crossover correction, and ``range_minus_distance_crossover_m`` with that after it;
        ``decoding_m``, as ``range_minus_distance_m`` but with the spacecraft position in the file; and this position
        minus that from the kernels along the radial, along-track and cross-track axes of the orbit. Metres.

    Raises
    ------
    CoverageError
        If the kernels do not cover a shot.
    """
    pandas = optional("pandas")
    lacking = [name for name in _native.RANGE_COLUMNS if name not in _names(shots)]
    if lacking:
        raise UsageError(
            f"no column {', '.join(lacking)}; expected shots of read_pedr or search_shots with all columns"
        )
    columns = [column(shots[name], name) for name in _native.RANGE_COLUMNS]
    residuals, used, bias_s = _native.range_residuals(columns, kernels_at(kernels), clock_bias_s)
    frame: DataFrame = pyarrow.table(residuals).to_pandas()
    if isinstance(shots, pandas.DataFrame):
        frame.index = shots.index
    frame.attrs = provenance(kernels=kernels_of(used), clock_bias_s=bias_s)
    return frame


def _search(
    paths: Paths,
    aoi: Area = None,
    *,
    columns: Sequence[str],
    shot_filter: Any = None,
    time_s: Sequence[float] | None = None,
    check_all: bool,
) -> tuple[pyarrow.Table, dict[str, Any]]:
    with tempfile.TemporaryDirectory() as folder:
        boxes, polygons = _windows(aoi, folder)
        found, statement = _native.search_shots(
            paths_of(paths),
            boxes=boxes,
            polygons=polygons,
            columns=list(columns),
            filter=shot_filter,
            time_s=time_s,
            check_all=check_all,
        )
    stated: dict[str, Any] = json.loads(statement)
    if not stated["complete"]:
        warnings.warn(
            f"{stated['records_left_out']} records with errors, whose invalid shots are omitted; the first error: "
            f"{stated['first_complaints'][0]}",
            UserWarning,
            stacklevel=3,
        )
    return pyarrow.table(found), stated


def _windows(aoi: Area, folder: str) -> tuple[list[list[float]], list[str]]:
    if aoi is None:
        return [], []
    if isinstance(aoi, str | os.PathLike):
        return [], [os.fspath(aoi)]
    crs = getattr(aoi, "crs", None)
    if crs is not None and crs != _crs_of_shots():
        expected = "IAU_2015:49900 (areocentric latitudes, east longitudes), or no crs; see to_crs and set_crs"
        raise UsageError(f"the crs of aoi is {crs.name}; expected {expected}")
    shape = aoi if isinstance(aoi, dict) else getattr(aoi, "__geo_interface__", None)
    if shape is not None:
        _require_polygons(shape)
        file = os.path.join(folder, "aoi.geojson")
        with open(file, "w", encoding="utf-8") as out:
            json.dump(shape, out)
        return [], [file]
    try:
        west, east, south, north = (float(edge) for edge in aoi)
    except (TypeError, ValueError):
        expected = "(west, east, south, north), a GeoJSON file, or polygons of GeoPandas or Shapely"
        raise UsageError(f"aoi is {aoi!r}; expected {expected}") from None
    return [[west, east, south, north]], []


def _require_polygons(shape: dict[str, Any]) -> None:
    """Raise an error for GeoJSON with geometries other than polygons, or with none."""
    if shape.get("type") == "FeatureCollection":
        geometries = [(feature.get("geometry") or {}).get("type") for feature in shape.get("features", [])]
    elif shape.get("type") == "Feature":
        geometries = [(shape.get("geometry") or {}).get("type")]
    else:
        geometries = [shape.get("type")]
    others = [str(kind) for kind in geometries if kind not in ("Polygon", "MultiPolygon")]
    if others or not geometries:
        found = f"a {others[0]}" if others else "no geometry"
        raise UsageError(f"aoi contains {found}; expected polygons")


def _crs_of_shots() -> Any:
    pyproj = optional("pyproj")
    return pyproj.CRS.from_user_input("IAU_2015:49900")


def _interval(t0: Time, t1: Time, leap_seconds: StrPath | None) -> list[float] | None:
    if t0 is None and t1 is None:
        return None
    ends_s = []
    for name, time, open_s in (("t0", t0, -numpy.inf), ("t1", t1, numpy.inf)):
        if time is None:
            ends_s.append(open_s)
            continue
        utc = utc_text(time)
        if utc is None:
            ends_s.append(float(column(time, name)[0]))
        elif leap_seconds is None:
            expected = "TDB seconds past J2000, or leap_seconds with a leap-second kernel"
            raise UsageError(f"{name} is {time!r}, a time in UTC; expected {expected}")
        else:
            ends_s += _native.utc_to_et([utc], kernels_at(leap_seconds))
    return ends_s


def _frame_of_points(table: pyarrow.Table, statement: dict[str, Any]) -> GeoDataFrame:
    geopandas, shapely = optional("geopandas"), optional("shapely")
    height_m = table["radius_crossover_m"].to_numpy() - _SPHERE_M
    east_deg = _signed(table["longitude_deg"].to_numpy())
    points = shapely.points(east_deg, table["latitude_deg"].to_numpy(), height_m)
    frame = geopandas.GeoDataFrame(table.to_pandas(), geometry=points, crs=_crs(table))
    frame.attrs = provenance(search=statement)
    return frame


def _crs(table: pyarrow.Table) -> Any:
    geo = json.loads(table.schema.metadata[b"geo"])
    return geo["columns"]["geometry"]["crs"]


def _at_antimeridian(points_deg: Any) -> list[Any]:
    """Divide a line where it crosses 180 degrees of longitude, with a point on the meridian at both ends."""
    pieces, piece = [], list(points_deg[:1])
    for (east_a, north_a), (east_b, north_b) in zip(points_deg[:-1], points_deg[1:], strict=True):
        if abs(east_b - east_a) > 180.0:
            edge = numpy.copysign(180.0, east_a)
            across = east_b + 2.0 * edge - east_a
            share = (edge - east_a) / across if across else 0.0
            north = north_a + share * (north_b - north_a)
            pieces.append(numpy.array([*piece, (edge, north)]))
            piece = [(-edge, north)]
        piece.append((east_b, north_b))
    return [*pieces, numpy.array(piece)]


def _signed(longitude_deg: Any) -> Any:
    return numpy.where(longitude_deg > 180.0, longitude_deg - 360.0, longitude_deg)


def _names(shots: Any) -> list[str]:
    return list(shots.column_names if isinstance(shots, pyarrow.Table) else shots.columns)


def _require_known(wanted: Sequence[str], known: Sequence[str]) -> None:
    unknown = [name for name in wanted if name not in known]
    if unknown or not wanted:
        found = f"no column {', '.join(unknown)}" if unknown else "no columns"
        raise UsageError(f"{found}; expected some of {', '.join(known)}")
