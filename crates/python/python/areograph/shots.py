"""Laser shots: read, searched, joined to tracks, compared with kernels."""

from __future__ import annotations

import json
import os
import tempfile
import warnings
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy
import pyarrow

from . import _native
from ._common import Paths, StrPath, column, kernels_of, optional, paths_of, provenance
from .errors import UsageError

if TYPE_CHECKING:
    from geopandas import GeoDataFrame
    from pandas import DataFrame

# A box, a file of GeoJSON, or an object with __geo_interface__ (GeoPandas, Shapely).
Area: TypeAlias = Any
Time: TypeAlias = "float | str | None"

#: Radius of the sphere of the coordinate reference system, metres: heights of points refer to it.
_SPHERE_M = 3_396_190.0
_CHANNELS = (1, 2, 3, 4)
# Columns that only a search with windows has, or that other columns repeat.
_OF_SEARCH = ("windows", "geometry")


def read_pedr(
    path: Paths, *, orbits: Iterable[int] | None = None, columns: Sequence[str] | None = None
) -> pyarrow.Table:
    """Read every shot with a return of PEDR files, of any class.

    Parameters
    ----------
    path
        PEDR files and folders that contain them, or tables of the Orbital Data Explorer.
    orbits
        Only shots of these orbits.
    columns
        Names of columns, in the order of the result; by default all. Few columns are read faster.

    Returns
    -------
    pyarrow.Table
        Shots in order of time, with the columns of ``footprints.parquet``, in IAU 2000. Fields state description and
        unit in their metadata. The metadata ``areograph`` of the schema is a JSON statement of the files, and of
        records with errors, whose shots are omitted.

    Raises
    ------
    InputError
        If a file is damaged, or two files contain the same shots.

    Warns
    -----
    UserWarning
        If single records with errors are omitted with their shots.
    """
    known = [name for name in _native.shot_columns() if name not in _OF_SEARCH]
    wanted = list(known if columns is None else columns)
    _require_known(wanted, known)
    read = wanted if orbits is None or "orbit" in wanted else [*wanted, "orbit"]
    table, statement = _search(path, columns=read, check_all=True)
    if orbits is not None:
        compute = optional("pyarrow.compute", "geo")
        members = pyarrow.array(sorted(set(orbits)), type=table.schema.field("orbit").type)
        table = table.filter(compute.is_in(table["orbit"], members))
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
        180); a GeoJSON file; or polygons of GeoPandas or Shapely. By default all of Mars.
    t0, t1
        First and last time tag: TDB seconds past J2000, or UTC as text, which requires ``leap_seconds``.
    classes
        Classification codes to keep: 1 ground, 0 cloud or noise.
    channels, attitude_flags
        Trigger channels and attitude flags to keep.
    max_off_nadir_deg
        Largest off-nadir angle of the laser.
    solar_longitude_deg
        First and last areocentric longitude of the Sun: the season of Mars.
    leap_seconds
        Leap-second kernel, such as ``naif0012.tls``.

    Returns
    -------
    geopandas.GeoDataFrame
        Shots in order of time. ``geometry`` has longitudes from -180 to 180 degrees, areocentric latitudes, and heights
        above the sphere of radius 3396190 m (IAU_2015:49900). ``attrs["areograph"]`` states request, files and
        completeness.

    Raises
    ------
    InputError
        If a file cannot be searched.

    Warns
    -----
    UserWarning
        If records with errors are omitted: shots may be missing.
    UsageError
        If the area or the interval of time is not valid.
    """
    optional("geopandas", "geo")
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
    """Join the ground shots of an archive to tracks, one for each profile.

    A profile is the part of one orbit in the area; a pause of more than 300 s starts another profile.

    Parameters
    ----------
    archive, aoi, t0, t1, leap_seconds
        As of `search_shots`.

    Returns
    -------
    geopandas.GeoDataFrame
        ``orbit``, ``shots``, ``et_start_s``, ``et_stop_s`` and ``geometry``: lines through the footprints, in two parts
        where a track crosses 180 degrees of longitude. Profiles of a single shot have a point.
    """
    geopandas, shapely = optional("geopandas", "geo"), optional("shapely", "geo")
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
    starts = numpy.flatnonzero(numpy.concatenate([[len(et_s) > 0], begins]))
    rows = []
    for first, end in zip(starts, [*starts[1:], len(et_s)], strict=True):
        part = points_deg[first:end]
        turns = numpy.flatnonzero(numpy.abs(numpy.diff(part[:, 0])) > 180.0) + 1
        pieces = [piece for piece in numpy.split(part, turns) if len(piece) > 1]
        if len(part) == 1 or not pieces:
            geometry = shapely.MultiPoint(part) if len(part) > 1 else shapely.Point(part[0])
        elif len(pieces) == 1:
            geometry = shapely.LineString(pieces[0])
        else:
            geometry = shapely.MultiLineString(pieces)
        rows.append((int(orbit[first]), end - first, et_s[first], et_s[end - 1], geometry))
    names = ["orbit", "shots", "et_start_s", "et_stop_s", "geometry"]
    frame = geopandas.GeoDataFrame(rows, columns=names, geometry="geometry", crs=_crs(table))
    frame.attrs = provenance(search=statement)
    return frame


def check_ranges(
    shots: pyarrow.Table | DataFrame, kernels: Paths, *, clock_bias_s: float | None = None
) -> DataFrame:
    """Compare measured ranges with the distances between footprints and the spacecraft of kernels.

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
        For every shot, with the index of ``shots``: ``distance_m``; ``range_minus_distance_m`` for the radius before, and
        ``range_minus_distance_crossover_m`` for the radius after the crossover correction; ``decoding_m``, the same with
        the spacecraft of the file; and the spacecraft of the file minus that of the kernels along the radial,
        along-track and cross-track axes of the orbit. Metres.

    Raises
    ------
    CoverageError
        If the kernels do not cover a shot.
    """
    pandas = optional("pandas", "geo")
    lacking = [name for name in _native.RANGE_COLUMNS if name not in _names(shots)]
    if lacking:
        raise UsageError(
            f"no column {', '.join(lacking)}; expected shots of read_pedr or search_shots with all columns"
        )
    columns = [column(shots[name]) for name in _native.RANGE_COLUMNS]
    residuals, used = _native.range_residuals(columns, paths_of(kernels), clock_bias_s)
    frame: DataFrame = pyarrow.table(residuals).to_pandas()
    if isinstance(shots, pandas.DataFrame):
        frame.index = shots.index
    frame.attrs = provenance(kernels=kernels_of(used), clock_bias_s=clock_bias_s)
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
            f"{stated['records_left_out']} records with errors are omitted with their shots; the first: "
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
    shape = aoi if isinstance(aoi, dict) else getattr(aoi, "__geo_interface__", None)
    if shape is not None:
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


def _interval(t0: Time, t1: Time, leap_seconds: StrPath | None) -> list[float] | None:
    if t0 is None and t1 is None:
        return None
    ends_s = []
    for name, time, open_s in (("t0", t0, -numpy.inf), ("t1", t1, numpy.inf)):
        if time is None:
            ends_s.append(open_s)
        elif not isinstance(time, str):
            ends_s.append(float(time))
        elif leap_seconds is None:
            expected = "TDB seconds past J2000, or leap_seconds with a leap-second kernel"
            raise UsageError(f"{name} is {time!r}, a time in UTC; expected {expected}")
        else:
            ends_s += _native.utc_to_et([time], paths_of(leap_seconds))
    return ends_s


def _frame_of_points(table: pyarrow.Table, statement: dict[str, Any]) -> GeoDataFrame:
    geopandas, shapely = optional("geopandas", "geo"), optional("shapely", "geo")
    height_m = table["radius_crossover_m"].to_numpy() - _SPHERE_M
    east_deg = _signed(table["longitude_deg"].to_numpy())
    points = shapely.points(east_deg, table["latitude_deg"].to_numpy(), height_m)
    frame = geopandas.GeoDataFrame(table.to_pandas(), geometry=points, crs=_crs(table))
    frame.attrs = provenance(search=statement)
    return frame


def _crs(table: pyarrow.Table) -> Any:
    geo = json.loads(table.schema.metadata[b"geo"])
    return geo["columns"]["geometry"]["crs"]


def _signed(longitude_deg: Any) -> Any:
    return numpy.where(longitude_deg > 180.0, longitude_deg - 360.0, longitude_deg)


def _names(shots: Any) -> list[str]:
    return list(shots.column_names if isinstance(shots, pyarrow.Table) else shots.columns)


def _require_known(wanted: Sequence[str], known: Sequence[str]) -> None:
    unknown = [name for name in wanted if name not in known]
    if unknown:
        raise UsageError(f"no column {', '.join(unknown)}; expected some of {', '.join(known)}")
