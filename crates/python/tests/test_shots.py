"""Shots against the tables of the command, the ranges of a run, and CSPICE as another package calls it."""

from __future__ import annotations

import datetime
import json
import signal
import struct
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import geopandas
import numpy
import pandas
import pyarrow
import pyarrow.csv
import pytest
import shapely
import spiceypy
from conftest import Mission, areograph, cspice

import areograph as ag

BOX = (175.0, 176.0, -16.0, -13.0)
AREA = geopandas.GeoSeries([shapely.box(BOX[0], BOX[2], BOX[1], BOX[3])])


def statement_of(table: pyarrow.Table) -> dict[str, Any]:
    statement: dict[str, Any] = json.loads(table.schema.metadata[b"areograph"])
    return statement


def test_shots_are_those_of_the_command(mission: Mission, tmp_path: Path) -> None:
    written = tmp_path / "shots.csv"
    searched = areograph("pedr", "search", mission.pedr, f"--box={','.join(map(str, BOX))}", "--out", written)
    assert searched.returncode == 0, searched.stderr
    command = pyarrow.csv.read_csv(written).to_pandas()
    found = ag.search_shots(mission.pedr, BOX)
    assert len(found) == len(command) > 1000
    for name in command.columns:
        if name in found.columns:
            pandas.testing.assert_series_equal(found[name], command[name], check_dtype=False, check_names=False)
    assert found.attrs["areograph"]["search"]["complete"] is True
    assert found.crs.to_authority() == ("IAU_2015", "49900")


def test_every_shot_of_a_record_is_read(mission: Mission) -> None:
    # The time of a record as its definition states it, big-endian seconds and microseconds at the beginning of 776 bytes, is
    # that of the middle of its 20 shots, which take 2 s (MOLA PEDR software interface specification).
    file = max(mission.pedr.glob("*.b"), key=lambda path: path.stat().st_size)
    table = ag.read_pedr(file, columns=["et_tag_s", "range_m", "record", "shot"])
    data, rows = file.read_bytes(), table.to_pandas()
    first = rows[rows["record"] == rows["record"].iloc[0]]
    at = (int(first["record"].iloc[0]) - 1) * 776
    seconds, microseconds = struct.unpack_from(">ii", data, at)
    # Seconds: shots without a return are not read.
    assert abs(first["et_tag_s"].mean() - (seconds + 1e-6 * microseconds)) < 1.0
    assert statement_of(table)["rows"] == table.num_rows == len(rows)


def test_a_polygon_holds_the_shots_that_shapely_finds(mission: Mission, tmp_path: Path) -> None:
    polygon = shapely.Polygon([(175.1, -15.6), (175.9, -15.2), (175.6, -13.4), (175.2, -13.6)])
    everywhere = ag.read_pedr(mission.pedr).to_pandas()
    ground = everywhere[(everywhere.return_class == 1) & everywhere["attitude_flag"].isin([0, 1])]
    inside = shapely.contains_xy(polygon, ground["longitude_deg"], ground["latitude_deg"])
    assert inside.sum() > 100
    file = tmp_path / "polygon.geojson"
    file.write_text(shapely.to_geojson(polygon))
    for aoi in (polygon, file, shapely.geometry.mapping(polygon)):
        found = ag.search_shots(mission.pedr, aoi)
        assert numpy.array_equal(found["et_tag_s"], ground["et_tag_s"][inside])
    # Bounds in the order of Shapely are not mistaken for a box.
    with pytest.raises(ag.UsageError, match="latitudes"):
        ag.search_shots(mission.pedr, polygon.bounds)


def test_times_and_classes_select(mission: Mission) -> None:
    found = ag.search_shots(mission.pedr, BOX)
    middle = float(found["et_tag_s"].median())
    early, late = (ag.search_shots(mission.pedr, BOX, **ends) for ends in ({"t1": middle}, {"t0": middle}))
    assert len(early) + len(late) - int((found["et_tag_s"] == middle).sum()) == len(found)
    utc = ag.spacecraft_state([middle], mission.kernels)["utc"].item()
    leap_seconds = mission.folder / "kernels" / "leapseconds.tls"
    by_utc = ag.search_shots(mission.pedr, BOX, t0=utc, leap_seconds=leap_seconds)
    # The text has milliseconds; shots are 0.1 s apart.
    assert abs(len(by_utc) - len(late)) <= 1
    orbit = int(found["orbit"].iloc[0])
    table = ag.read_pedr(mission.pedr, orbits=[orbit], columns=["shot", "return_class"])
    assert table.column_names == ["shot", "return_class"]
    assert table.num_rows > int((found["orbit"] == orbit).sum())


def test_tracks_hold_every_shot_once(mission: Mission) -> None:
    found, tracks = ag.search_shots(mission.pedr, BOX), ag.tracks(mission.pedr, BOX)
    assert tracks["shots"].sum() == len(found)
    assert sorted(tracks["orbit"]) == sorted(found.groupby("orbit").size().index)
    for _, track in tracks.iterrows():
        shots = found[found["orbit"] == track["orbit"]]
        assert track.geometry.geom_type == "LineString"
        points = numpy.column_stack([shots.geometry.x, shots.geometry.y])
        assert numpy.array_equal(numpy.array(track.geometry.coords), points)


def test_tracks_are_divided_at_the_antimeridian_and_at_gaps(mission: Mission) -> None:
    whole = ag.tracks(mission.pedr, (-180.0, 180.0, -20.0, 20.0))
    lines = whole.geometry.explode()
    assert (numpy.abs(shapely.get_coordinates(lines)[:, 0]) <= 180.0).all()
    # Degrees: the ground track moves by less than a degree of longitude between shots here.
    for line in lines[lines.geom_type == "LineString"]:
        assert numpy.abs(numpy.diff(numpy.array(line.coords)[:, 0])).max() < 1.0
    two = shapely.MultiPolygon([shapely.box(170, -16, 178, -15), shapely.box(170, -14, 178, -13)])
    apart = ag.tracks(mission.pedr, two)
    assert len(apart) > 0
    # Degrees: the margin of the window of the joined shots.
    assert apart.geometry.within(two.buffer(0.02)).all()
    none = ag.tracks(mission.pedr, (10.0, 11.0, 80.0, 81.0))
    assert len(none) == 0 and list(none.dtypes) == list(apart.dtypes) and none.crs == apart.crs


def test_areas_with_the_reference_system_of_shots_are_areas(mission: Mission) -> None:
    assert len(ag.search_shots(mission.pedr, AREA.set_crs("IAU_2015:49900"))) == len(ag.search_shots(mission.pedr, BOX))


def test_ranges_are_those_of_a_run(mission: Mission) -> None:
    result = mission.gusev
    checked = ag.check_ranges(result.footprints, mission.kernels)
    published = result.ranges.set_index("footprint_row")
    shots = checked.loc[published.index]
    for name in ("range_minus_distance_m", "range_minus_distance_crossover_m", "decoding_m"):
        # Metres: the products have a tenth of a millimetre, and angles in degrees move points by a nanometre.
        assert numpy.abs(shots[name] - published[name]).max() < 2e-4, name
    # The bias moves the spacecraft by 0.117 s of its motion relative to the ground.
    unbiased = ag.check_ranges(result.footprints, mission.kernels, clock_bias_s=0.0)
    assert (unbiased["distance_m"] - checked["distance_m"]).abs().max() > 0.05
    assert checked.attrs["areograph"]["clock_bias_s"] == 0.117
    unknown = result.footprints.copy()
    unknown.loc[unknown.index[3], "et_tag_s"] = numpy.nan
    partly = ag.check_ranges(unknown, mission.kernels)
    assert partly.isna().all(axis=1).sum() == 1
    pandas.testing.assert_frame_equal(partly.drop(unknown.index[3]), checked.drop(unknown.index[3]))
    table = ag.read_pedr(mission.pedr, columns=["et_tag_s", "range_m"])
    with pytest.raises(ag.UsageError, match="no column longitude_deg"):
        ag.check_ranges(table, mission.kernels)


def test_ranges_follow_from_states_of_another_reader(mission: Mission) -> None:
    result = mission.gusev
    shots = result.footprints.iloc[::40]
    checked = ag.check_ranges(shots, mission.kernels, clock_bias_s=0.0)
    with cspice(mission):
        for row, (_, shot) in zip(checked.itertuples(), shots.iterrows(), strict=True):
            state, _ = spiceypy.spkezr("-94", shot["et_tag_s"], "IAU_MARS", "NONE", "499")
            ground_km = spiceypy.latrec(
                shot["radius_m"] / 1e3, numpy.radians(shot["longitude_deg"]), numpy.radians(shot["latitude_deg"])
            )
            distance_m = 1e3 * numpy.linalg.norm(state[:3] - ground_km)
            # Metres: the tabulated trajectory is within a millimetre of the kernels.
            assert abs(row.distance_m - distance_m) < 2e-3


def test_kernels_of_another_package_stay_loaded(mission: Mission) -> None:
    with cspice(mission):
        loaded = spiceypy.ktotal("ALL")
        ag.spacecraft_state([float(mission.gusev.footprints["et_s"].iloc[0])], mission.kernels)
        assert spiceypy.ktotal("ALL") == loaded > 0


@pytest.mark.parametrize(
    ("call", "kind", "text"),
    [
        (lambda m: ag.read_pedr(m.folder / "nothing"), ag.InputError, "nothing"),
        (lambda m: ag.read_pedr(m.kernels), ag.InputError, "nav.tm"),
        (lambda m: ag.read_pedr(m.pedr, columns=["range"]), ag.UsageError, "no column range"),
        (lambda m: ag.search_shots(m.pedr, (1, 2, 3)), ag.UsageError, "west, east, south, north"),
        (lambda m: ag.search_shots(m.pedr, (0, 1, 5, -5)), ag.UsageError, "south below north"),
        (lambda m: ag.search_shots(m.pedr, t0="1999-01-01"), ag.UsageError, "leap_seconds"),
        (lambda m: ag.search_shots(m.pedr, t0=2.0, t1=1.0), ag.UsageError, "expected t0 no later than t1"),
        (lambda m: ag.search_shots(m.pedr, t0=float("nan")), ag.UsageError, "expected t0 no later than t1"),
        (lambda m: ag.search_shots(m.pedr, t0=datetime.datetime(1999, 1, 1)), ag.UsageError, "leap_seconds"),
        (lambda m: ag.search_shots(m.pedr, shapely.Point(0, 0)), ag.UsageError, "a Point; expected polygons"),
        (lambda m: ag.search_shots(m.pedr, geopandas.GeoSeries([])), ag.UsageError, "no geometry"),
        (lambda m: ag.search_shots(m.pedr, AREA.set_crs("EPSG:4326")), ag.UsageError, "IAU_2015:49900"),
        (lambda m: ag.search_shots(m.pedr, AREA.set_crs("IAU_2015:49901")), ag.UsageError, "IAU_2015:49900"),
        (lambda m: ag.search_shots(m.pedr, solar_longitude_deg=(float("nan"), 1)), ag.UsageError, "0 to 360"),
        (lambda m: ag.search_shots(m.pedr, max_off_nadir_deg=-1.0), ag.UsageError, "above 0"),
        (lambda m: ag.search_shots(m.pedr, channels=(300,)), ag.UsageError, "1 to 4"),
        (lambda m: ag.read_pedr(m.pedr, columns=[]), ag.UsageError, "no columns"),
        (lambda m: ag.read_pedr(m.pedr, orbits=[-1]), ag.UsageError, "orbit numbers"),
        (lambda m: ag.check_ranges(ag.read_pedr(m.pedr), m.kernels, clock_bias_s=99.0), ag.UsageError, "-10 to 10"),
        (lambda m: ag.spacecraft_state([float("nan")], m.kernels), ag.UsageError, r"et\[0\] is nan"),
        (lambda m: ag.spacecraft_state([0.0], m.kernels.parent), ag.UsageError, "folder"),
        (lambda m: ag.check_ranges(ag.search_shots(m.pedr, BOX), m.folder / "no.tm"), ag.InputError, "no.tm"),
        (lambda m: ag.spacecraft_state([0.0], m.kernels), ag.CoverageError, "-94"),
        (lambda m: ag.spacecraft_state([0.0], m.kernels, frame="MARS"), ag.UsageError, "IAU_MARS"),
    ],
)
def test_failures_are_exceptions_by_kind(
    mission: Mission, call: Callable[[Mission], Any], kind: type[Exception], text: str
) -> None:
    with pytest.raises(kind, match=text) as raised:
        call(mission)
    assert isinstance(raised.value, ag.AreographError)
    codes = {ag.UsageError: 2, ag.InputError: 3, ag.CoverageError: 4, ag.FileAccessError: 6}
    assert raised.value.exit_code == codes[type(raised.value)]
    assert isinstance(raised.value.advice, str) and raised.value.site is None


def test_damage_is_never_left_out_in_silence(mission: Mission, tmp_path: Path) -> None:
    file = max(mission.pedr.glob("*.b"), key=lambda path: path.stat().st_size)
    cut = tmp_path / file.name
    data = bytearray(file.read_bytes())
    half = 776 * (len(data) // 776 // 2)
    for changed in (data[: half - 100], data[:half] + b"\xff" * 8 + data[half + 8 :]):
        cut.write_bytes(changed)
        with pytest.warns(UserWarning, match=f"1 records .* {file.name}"):
            table = ag.read_pedr(cut)
        assert statement_of(table)["complete"] is False
        assert statement_of(table)["records_left_out"] == 1
    cut.write_bytes(data[:half] + bytes(len(data) - half))
    with pytest.raises(ag.InputError, match="unusable"):
        ag.read_pedr(cut)


def test_other_threads_run_and_signals_arrive(mission: Mission) -> None:
    counted = 0
    searching = threading.Event()

    def count() -> None:
        nonlocal counted
        while not searching.is_set():
            counted += 1
            time.sleep(0.001)

    counter = threading.Thread(target=count)
    counter.start()
    ag.read_pedr(mission.pedr)
    searching.set()
    counter.join()
    # A reader that keeps the lock of the interpreter lets the other thread count once or twice.
    assert counted > 20

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        with pytest.raises(KeyboardInterrupt):
            while True:
                ag.read_pedr(mission.pedr)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert ag.read_pedr(mission.pedr, columns=["shot"]).num_rows > 0
