"""Products of a site against their manifest, and against DuckDB as another reader of the same files."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import duckdb
import geopandas
import numpy as np
import pyarrow.parquet as parquet
import pytest
from conftest import Mission

from areograph.errors import InputError
from areograph.results import Result, open_result
from areograph.sites import run

SITE = Path(os.environ["AREOGRAPH_SITE"])
Edit = Callable[[dict[str, Any]], object]


def manifest_of(folder: Path) -> dict[str, Any]:
    manifest: dict[str, Any] = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    return manifest


MANIFEST = manifest_of(SITE)
ROWS = {product["path"]: product["rows"] for product in MANIFEST["products"]}
TABLES = [path for path in ROWS if path.endswith(".parquet")]
FRAMES = ["footprints", "shots", "ranges", "registration", "ties", "heights"]

with_adjustment = pytest.mark.skipif("adjustment.json" not in ROWS, reason="the site has no adjustment")


def sql(query: str, **tables: str) -> list[tuple[Any, ...]]:
    """Rows of a query; `tables` name the products."""
    for name, product in tables.items():
        query = query.replace(f"{{{name}}}", f"read_parquet('{SITE / product}')")
    rows: list[tuple[Any, ...]] = duckdb.sql(query).fetchall()
    return rows


@pytest.fixture
def result() -> Result:
    return open_result(SITE)


@pytest.fixture
def edited(tmp_path: Path) -> Callable[[Edit], Path]:
    """Copies the site and edits the manifest of the copy."""

    def edit(change: Edit) -> Path:
        copy = tmp_path / "copy"
        if not copy.exists():
            shutil.copytree(SITE, copy, ignore=shutil.ignore_patterns(".cache", "report", "exchange"))
        manifest = manifest_of(copy)
        change(manifest)
        (copy / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
        return copy

    return edit


def without(*names: str) -> Edit:
    """Removes products from a manifest by file name."""

    def change(manifest: dict[str, Any]) -> None:
        manifest["products"] = [
            product for product in manifest["products"] if product["path"].rsplit("/", 1)[-1] not in names
        ]

    return change


def test_the_verdict_is_that_of_the_manifest(result: Result) -> None:
    verdict = MANIFEST["verdict"]
    assert result.folder == SITE
    assert result.manifest == MANIFEST
    assert result.site == MANIFEST["site"]
    assert result.valid is verdict["valid"]
    assert (result.reasons, result.remarks) == (verdict["reasons"], verdict["remarks"])
    assert result.untested == verdict["untested"]
    assert len(result.images) == MANIFEST["counts"]["images"]
    assert sorted(result.images) == sorted(folder.name for folder in (SITE / "images").iterdir())
    assert result.products == list(ROWS)


@pytest.mark.parametrize(
    ("valid", "remarks", "word"),
    [(True, [], "valid"), (True, ["a"], "valid with remarks"), (False, [], "INVALID"), (False, ["a"], "INVALID")],
)
def test_the_verdict_has_the_words_of_the_program(
    edited: Callable[[Edit], Path], valid: bool, remarks: list[str], word: str
) -> None:
    folder = edited(lambda manifest: manifest["verdict"].update(valid=valid, remarks=remarks, reasons=["b"]))
    result = open_result(folder)
    assert result.verdict == word
    assert result.footprints.attrs["areograph"]["verdict"] == word
    assert f" {word};" in repr(result)


def test_the_summary_has_two_lines_at_most(result: Result) -> None:
    summary = repr(result)
    assert summary.count("\n") <= 1
    assert f"{MANIFEST['site']}: {result.verdict};" in summary
    assert f"{MANIFEST['counts']['footprints']} footprints" in summary
    assert f"{MANIFEST['counts']['images']} image" in summary


def test_checks_are_those_of_the_manifest(result: Result) -> None:
    checks = result.checks
    assert len(checks) == len(MANIFEST["verdict"]["checks"])
    for (_, row), check in zip(checks.iterrows(), MANIFEST["verdict"]["checks"], strict=True):
        for key in ["kind", "what", "outcome", "subject", "unit"]:
            assert row[key] == check[key]
        for key in ["value", "limit"]:
            assert np.isnan(row[key]) if key not in check else row[key] == check[key]
        share = row["share_of_limit"]
        assert np.isnan(share) or (share <= 1) == (check["outcome"] == "pass")


def test_shares_of_limits_have_upper_and_lower_limits(edited: Callable[[Edit], Path]) -> None:
    def check(outcome: str, value: float | None, limit: float | None) -> dict[str, Any]:
        numbers = {"value": value, "limit": limit}
        check = {key: number for key, number in numbers.items() if number is not None}
        return {"kind": "shots", "what": "Shots", "outcome": outcome, "subject": "", "unit": "", **check}

    checks = [
        check("fail", -30.0, 10.0),
        check("fail", 5.0, 20.0),
        check("fail", None, 2.0),
        check("warning", 2.0, 0.0),
        check("pass", -2.0, 10.0),
        check("pass", 40.0, 20.0),
        check("pass", 0.0, 5.0),
        check("pass", 0.0, 0.0),
        check("pass", None, None),
    ]
    folder = edited(lambda manifest: manifest["verdict"].update(checks=checks))
    shares = open_result(folder).checks["share_of_limit"].tolist()
    assert shares[:8] == [3.0, 4.0, np.inf, np.inf, 0.2, 0.5, 0.0, 0.0]
    assert np.isnan(shares[8])


@pytest.mark.parametrize("path", TABLES)
def test_every_table_has_the_rows_of_the_manifest(result: Result, path: str) -> None:
    table = result.table(path)
    assert table.num_rows == ROWS[path] == sql("select count(*) from {table}", table=path)[0][0]
    assert result.table(path.removesuffix(".parquet")) is table


def test_footprints_have_the_counts_of_the_manifest(result: Result) -> None:
    footprints = result.footprints
    assert isinstance(footprints, geopandas.GeoDataFrame)
    assert len(footprints) == MANIFEST["counts"]["footprints"]
    wrapped_deg = (footprints["longitude_deg"] + 180) % 360 - 180
    assert np.allclose(footprints.geometry.x, wrapped_deg, rtol=0, atol=1e-9)
    assert np.allclose(footprints.geometry.y, footprints["latitude_deg"], rtol=0, atol=1e-9)
    extent = sql("select min(topography_m), max(topography_m) from {table}", table="footprints.parquet")[0]
    assert (footprints["topography_m"].min(), footprints["topography_m"].max()) == extent


def test_ranges_and_registration_have_the_counts_of_the_manifest(result: Result) -> None:
    means = dict(
        sql("select profile, avg(range_minus_distance_m) from {table} group by profile", table="ranges.parquet")
    )
    found = result.ranges.groupby("profile")["range_minus_distance_m"].mean()
    assert found.to_dict() == pytest.approx(means)
    assert len(result.registration) == MANIFEST["counts"]["registered"]
    assert result.registration["inside"].sum() == MANIFEST["counts"]["registered_inside"]


def test_shots_are_the_join_of_footprints_and_registration(result: Result) -> None:
    join = """
        select shots.*, registration.line, registration.sample, footprints.latitude_deg, footprints.topography_m
        from {shots} shots
        join (select distinct image, footprint_row, line, sample from {registration}) registration
            using (image, footprint_row)
        join (select *, row_number() over () - 1 as footprint_row from {footprints}) footprints
            using (footprint_row)
    """
    counts, line, sample, latitude, topography = sql(
        f"""select count(*), max(abs(before_line - line)), max(abs(before_sample - sample)),
            max(abs(latitude_deg - latitude_deg_1)), max(abs(topography_m - topography_m_1)) from ({join})""",
        shots="registered_footprints.parquet",
        registration="registration.parquet",
        footprints="footprints.parquet",
    )[0]
    assert (counts, line, sample, latitude, topography) == (len(result.shots), 0, 0, 0, 0)
    assert isinstance(result.shots, geopandas.GeoDataFrame)
    assert set(result.shots["image"]) <= set(result.images)
    assert result.shots["before_inside"].sum() == MANIFEST["counts"]["registered_inside"]


@with_adjustment
def test_the_adjustment_moved_the_shots_by_the_stated_distance(result: Result) -> None:
    shots = result.shots
    adjusted = parquet.read_table(SITE / "registration_adjusted.parquet").to_pandas()
    keys = ["image", "footprint_row"]
    joined = shots.merge(adjusted.drop_duplicates(keys), on=keys)
    assert len(joined) == len(shots)
    assert (joined["adjusted_line"] == joined["line"]).all()
    assert (joined["adjusted_sample"] == joined["sample"]).all()
    line_change = shots["adjusted_line"] - shots["before_line"]
    sample_change = shots["adjusted_sample"] - shots["before_sample"]
    distance_px = np.hypot(line_change, sample_change)
    assert np.allclose(distance_px, shots["moved_px"], rtol=0, atol=1e-6)


@with_adjustment
def test_heights_have_the_medians_of_the_adjustment(result: Result) -> None:
    document = json.loads((SITE / "adjustment.json").read_text(encoding="utf-8"))
    ties = result.heights[result.heights["kind"] == "tie"]
    for column, state in [("above_surface_m", "before"), ("adjusted_above_surface_m", "after")]:
        expected = document[state]["heights"]["above_surface_m"]
        assert ties[column].count() == expected["n"]
        assert ties[column].median() == pytest.approx(expected["median"], abs=1e-9)
    assert result.ties["tie"].nunique() == len(ties)


@pytest.mark.parametrize("adjusted", [False, pytest.param(True, marks=with_adjustment)])
def test_orientation_and_isd_belong_to_the_image(result: Result, adjusted: bool) -> None:
    prefix = "adjusted_" if adjusted else ""
    for image in result.images:
        orientation = result.orientation(image, adjusted=adjusted)
        path = f"images/{image}/{prefix}orientation.parquet"
        assert len(orientation) == ROWS[path]
        assert orientation.attrs["areograph"]["file"] == path
        quaternions = orientation[["quaternion_w", "quaternion_x", "quaternion_y", "quaternion_z"]]
        assert np.allclose(np.linalg.norm(quaternions, axis=1), 1)
        isd = result.isd(image, adjusted=adjusted)
        assert isd == json.loads((SITE / f"images/{image}/{prefix}isd.json").read_text(encoding="utf-8"))
        assert isd["image_identifier"] == image


@with_adjustment
def test_the_adjusted_orientation_is_another_one(result: Result) -> None:
    moved = [
        not result.orientation(image).equals(result.orientation(image, adjusted=True))
        and result.isd(image)["instrument_position"] != result.isd(image, adjusted=True)["instrument_position"]
        for image in result.images
    ]
    assert any(moved)


@pytest.mark.parametrize("name", FRAMES)
def test_every_frame_states_its_provenance(result: Result, name: str) -> None:
    try:
        frame = getattr(result, name)
    except InputError:
        pytest.skip(f"the site has no {name}")
    provenance = frame.attrs["areograph"]
    assert provenance["version"] == MANIFEST["version"]
    assert provenance["site"] == MANIFEST["site"]
    assert provenance["verdict"] == result.verdict
    entry = next(product for product in MANIFEST["products"] if product["path"] == provenance["file"])
    assert provenance["blake3"] == entry["blake3"]
    assert len(frame) == entry["rows"]
    kernels = [(kernel["name"], kernel["blake3"]) for kernel in MANIFEST["kernels"]]
    assert [(kernel["name"], kernel["blake3"]) for kernel in provenance["kernels"]] == kernels
    suffixes = {"m": "m", "deg": "deg", "s": "s", "px": "pixel"}
    for column in frame.columns:
        suffix = column.rsplit("_", 1)[-1]
        if suffix in suffixes:
            assert provenance["units"][column] == suffixes[suffix], column
    assert frame[frame.columns[:3]].head(2).attrs["areograph"] == provenance


def test_checks_state_their_provenance(result: Result) -> None:
    provenance = result.checks.attrs["areograph"]
    assert (provenance["file"], provenance["site"]) == ("manifest.json", MANIFEST["site"])
    assert provenance["blake3"] is None


def test_frames_are_written_with_their_provenance(result: Result, tmp_path: Path) -> None:
    file = tmp_path / "ranges.parquet"
    result.ranges.to_parquet(file)
    result.footprints.to_parquet(tmp_path / "footprints.parquet")
    stored = json.loads(parquet.read_schema(file).metadata[b"PANDAS_ATTRS"])
    assert stored["areograph"] == result.ranges.attrs["areograph"]


def test_each_product_is_read_once_and_only_if_asked_for(edited: Callable[[Edit], Path]) -> None:
    folder = edited(lambda manifest: None)
    result = open_result(folder)
    footprints, isd = result.footprints, result.isd(result.images[0])
    for file in folder.rglob("*.*"):
        if file.is_file():
            file.unlink()
    assert result.footprints is footprints
    assert result.isd(result.images[0]) is isd
    assert len(result.checks) == len(MANIFEST["verdict"]["checks"])
    with pytest.raises(InputError, match=r"ranges\.parquet is missing, although manifest\.json lists it"):
        _ = result.ranges


def test_a_folder_without_manifest_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"has no manifest\.json; expected the folder of a site, which"):
        open_result(tmp_path)
    with pytest.raises(InputError, match="has no manifest"):
        open_result(tmp_path / "absent")
    (tmp_path / "alpha").mkdir()
    (tmp_path / "alpha" / "manifest.json").write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match="expected the folder of a site, such as .*alpha"):
        open_result(tmp_path)


def test_a_file_instead_of_a_folder_is_refused() -> None:
    with pytest.raises(InputError, match="has no manifest"):
        open_result(SITE / "footprints.parquet")


def test_a_manifest_of_another_program_is_refused(edited: Callable[[Edit], Path]) -> None:
    with pytest.raises(InputError, match="tool is 'isis'; expected 'areograph'"):
        open_result(edited(lambda manifest: manifest.update(tool="isis")))


@pytest.mark.parametrize("text", ["", "{", "[]", "null"])
def test_a_malformed_manifest_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "manifest.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"manifest\.json(:| is malformed)"):
        open_result(tmp_path)


def test_a_manifest_that_is_not_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "manifest.json").write_bytes(b"\xff\xfe{")
    with pytest.raises(InputError, match="is malformed"):
        open_result(tmp_path)


def test_an_incomplete_manifest_is_refused(edited: Callable[[Edit], Path]) -> None:
    with pytest.raises(InputError, match="is malformed: no kernels"):
        open_result(edited(lambda manifest: manifest.pop("kernels")))


def test_the_manifest_of_a_net_is_refused(edited: Callable[[Edit], Path]) -> None:
    with pytest.raises(InputError, match=r"no footprints\.parquet in the products; expected the folder of a site"):
        open_result(edited(without("footprints.parquet")))


def test_a_changed_product_is_refused(edited: Callable[[Edit], Path]) -> None:
    folder = edited(lambda manifest: None)
    with (folder / "ranges.parquet").open("ab") as file:
        file.write(b"1")
    size = (SITE / "ranges.parquet").stat().st_size
    with pytest.raises(InputError, match=f"has {size + 1} bytes; expected {size} according to manifest"):
        _ = open_result(folder).ranges


def test_an_unknown_table_is_refused_with_the_tables(result: Result) -> None:
    with pytest.raises(InputError, match=r"has no shot\.parquet; its tables: footprints, ranges, ") as refused:
        result.table("shot")
    for path in TABLES:
        assert path.removesuffix(".parquet") in str(refused.value)
    with pytest.raises(InputError, match="has no ranges.json.parquet"):
        result.table("ranges.json")


def test_an_unknown_image_is_refused_with_the_images(result: Result) -> None:
    for read in (result.orientation, result.isd):
        with pytest.raises(InputError, match=f"unknown image 'X'.*expected one of {result.images[0]}"):
            read("X")


def test_a_product_that_the_site_lacks_is_refused_with_its_requirement(edited: Callable[[Edit], Path]) -> None:
    lacking = without("ties.parquet", "height_check.parquet", "adjusted_isd.json", "surface_above_sphere.tif", "adjusted.tm")
    result = open_result(edited(lacking))
    for name, product in [("ties", "ties.parquet"), ("heights", "height_check.parquet")]:
        with pytest.raises(InputError, match=rf"has no {product}; expected a site with tie points: add \[ties\]"):
            getattr(result, name)
    with pytest.raises(InputError, match=r"no ties\.parquet; expected a site with tie points.*; its tables: "):
        result.table("ties")
    with pytest.raises(InputError, match=r"adjusted_isd\.json; expected a site with an adjustment"):
        result.isd(result.images[0], adjusted=True)
    with pytest.raises(InputError, match=r"surface_above_sphere\.tif; expected a site with a terrain model.*\[surface\]"):
        _ = result.terrain
    with pytest.raises(InputError, match=r"has no adjusted\.tm; expected a site with an adjustment"):
        result.path("adjusted.tm")


def test_a_site_without_tie_points_has_its_other_products(mission: Mission, tmp_path: Path) -> None:
    text = mission.site("gusev_crater").read_text().replace('"../', f'"{mission.folder}/')
    text = re.sub(r"(?ms)^\[(ties|adjustment|intersection|limits|surface)\].*?(?=^\[|\Z)", "", text)
    site = tmp_path / "no_ties.toml"
    site.write_text(text)
    result = run(site, out=tmp_path / "out")
    assert len(result.footprints) == result.manifest["counts"]["footprints"]
    assert result.shots["adjusted_line"].isna().all()
    assert not result.shots["adjusted_inside"].any()
    assert "0 tie-point measurements" in repr(result)
    for read in (lambda: result.ties, lambda: result.heights, lambda: result.isd(result.images[0], adjusted=True)):
        with pytest.raises(InputError, match=r"\[ties\]"):
            read()


@pytest.mark.parametrize("package", ["pandas", "pyarrow", "geopandas"])
def test_a_missing_package_is_reported_with_the_extra(
    result: Result, monkeypatch: pytest.MonkeyPatch, package: str
) -> None:
    for module in [name for name in sys.modules if name.split(".")[0] == package]:
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ImportError, match=rf"require {package}.*install it with pip"):
        _ = result.checks if package == "pandas" else result.footprints
    assert len(result.isd(result.images[0])) > 0


def test_the_optional_packages_are_imported_only_for_tables() -> None:
    code = """
import sys
from areograph.results import open_result
result = open_result(sys.argv[1])
result.isd(result.images[0]), result.verdict, repr(result)
print(*{"pandas", "geopandas", "pyarrow"} & set(sys.modules))
"""
    run = subprocess.run([sys.executable, "-c", code, SITE], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == ""
