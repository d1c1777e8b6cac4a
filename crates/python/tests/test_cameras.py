"""Cameras against the registration of a run, its support data, and their own inverse."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy
import pytest
import spiceypy
from conftest import Mission, cspice

import areograph as ag

IMAGE = "E02-00665"


@pytest.fixture(scope="module")
def exact(mission: Mission, tmp_path_factory: pytest.TempPathFactory) -> ag.Result:
    """The site with a registration by densely sampled orientation instead of polynomials, without light time."""
    site = mission.site("gusev_crater").read_text()
    site = site.replace('"../', f'"{mission.folder}/') + '\n[registration]\nmodel = "samples"\n'
    site += "\n[orientation]\nintervals = 3000\nlight_time = \"none\"\n"
    path = tmp_path_factory.mktemp("exact") / "exact.toml"
    path.write_text(site)
    return ag.run(path, out=path.parent / "out")


@pytest.mark.parametrize("name", ["before", "adjusted"])
def test_ground_points_are_seen_where_the_registration_states(exact: ag.Result, name: str) -> None:
    shots = exact.shots
    for image in exact.images:
        seen = shots[(shots["image"] == image) & shots[f"{name}_inside"]]
        assert len(seen) > 100
        line, sample, valid = ag.ground_to_image(
            exact.isd(image, adjusted=name == "adjusted"),
            seen["longitude_deg"],
            seen["latitude_deg"],
            seen["ground_radius_m"],
        )
        assert valid.all()
        # Pixels: both interpolate between nodes, each within 1e-4 pixels of the kernels.
        assert numpy.abs(line - seen[f"{name}_line"]).max() < 2e-4
        assert numpy.abs(sample - seen[f"{name}_sample"]).max() < 2e-4


def test_lines_of_isis_are_those_of_its_camera_model(exact: ag.Result) -> None:
    shots = exact.shots
    for image in exact.images:
        seen = shots[(shots["image"] == image) & shots["before_isis_line"].notna()]
        assert len(seen) > 100
        isd = json.loads(exact.path(f"exchange/centre/{image}_isd.json").read_text())
        line, sample, valid = ag.ground_to_image(
            isd, seen["longitude_deg"], seen["latitude_deg"], seen["ground_radius_m"]
        )
        assert valid.all()
        # Pixels: both interpolate between nodes; the convention of the run, without light time, is 7 lines away.
        assert numpy.abs(line + 0.5 - seen["before_isis_line"]).max() < 2e-3
        assert numpy.abs(sample + 0.5 - seen["before_isis_sample"]).max() < 2e-3
        assert numpy.abs(line - seen["before_line"]).min() > 7.0


def test_image_to_ground_inverts_ground_to_image(mission: Mission) -> None:
    isd = mission.gusev.isd(IMAGE)
    lines, samples = isd["image_lines"], isd["image_samples"]
    line, sample = numpy.meshgrid(numpy.linspace(0.0, lines, 7), numpy.linspace(0.0, samples, 5))

    def hills(longitude_deg: Any, latitude_deg: Any) -> Any:
        return 3.3957e6 + 300.0 * numpy.sin(40.0 * latitude_deg) * numpy.cos(40.0 * longitude_deg)

    for surface in (None, 3.3957e6, hills):
        longitude_deg, latitude_deg, radius_m = ag.image_to_ground(isd, line, sample, surface=surface)
        assert longitude_deg.shape == line.shape
        back = ag.ground_to_image(isd, longitude_deg, latitude_deg, radius_m)
        # Pixels: the surface is met within a millimetre, a thousandth of a pixel.
        assert numpy.abs(back[0] - line).max() < 2e-3
        assert numpy.abs(back[1] - sample).max() < 2e-3
        if callable(surface):
            assert numpy.abs(hills(longitude_deg, latitude_deg) - radius_m).max() < 2e-3
    # Exchanged coordinates, and positions outside the image, have no place.
    assert not ag.ground_to_image(isd, latitude_deg, longitude_deg, radius_m)[2].any()
    # The opposite side of the body lies on the same rays.
    for hidden in ((longitude_deg + 180.0, -latitude_deg, radius_m), (longitude_deg, 180.0 - latitude_deg, radius_m)):
        assert not ag.ground_to_image(isd, *hidden)[2].any()
    masked = numpy.ma.masked_array([longitude_deg[2, 3]] * 2, [False, True])
    seen = ag.ground_to_image(isd, masked, latitude_deg[2, 3], radius_m[2, 3])
    assert list(seen[2]) == [True, False]
    seen[0][~seen[2]] = 0.0  # arrays of their own
    assert numpy.isnan(ag.image_to_ground(isd, [-1.0, lines + 1.0], [5.0, 5.0])[0]).all()
    assert numpy.isnan(ag.image_to_ground(isd, 5.0, 5.0, surface=5e6)[0])


def test_support_data_of_a_label_are_those_of_a_run(mission: Mission) -> None:
    label = mission.folder / "labels" / f"{IMAGE}.lbl"
    loaded, published = ag.load(label, mission.kernels), mission.gusev.isd(IMAGE)
    # A site states how many lines of the image were delivered; a label does not.
    differ = {name for name in published if loaded[name] != published[name]}
    assert differ <= {"image_lines", "line_scan_rate", "center_ephemeris_time", "areograph"}
    files = [str(path) for path in sorted((mission.folder / "kernels").iterdir())]
    with pytest.raises(ag.CoverageError, match="spacecraft clock"):
        ag.load(label, [path for path in files if path.endswith(".tls")])
    with pytest.raises(ag.UsageError, match="metakernel"):
        ag.load(label)
    # The identifier is the product; the name of the file is free.
    copy = mission.out / "my label, 日本.copy.lbl"
    copy.write_bytes(label.read_bytes())
    copied = ag.load(copy, mission.kernels)
    assert {name for name in loaded if loaded[name] != copied[name]} == {"areograph"}
    assert loaded["image_identifier"] == IMAGE
    # A label with kernels is an image too; its positions have the usual light time.
    poses = [ag.orientation(image, *kernels) for image, *kernels in ((label, mission.kernels), (loaded,))]
    assert poses[0].equals(poses[1])


def test_orientation_is_that_of_cspice(mission: Mission, exact: ag.Result) -> None:
    poses = ag.orientation(exact.isd(IMAGE), step_lines=2000.0)
    with cspice(mission):
        for number in range(poses.sizes["line"]):
            et_s = float(poses["et_s"][number])
            state, _ = spiceypy.spkezr("-94", et_s, "IAU_MARS", "NONE", "499")
            # Metres: interpolation between nodes of the tables.
            assert numpy.abs(1e3 * state[:3] - poses["position_m"][number].values).max() < 0.01
            matrix = spiceypy.q2m(poses["quaternion"][number].values)
            clock = spiceypy.sce2c(-94, et_s - 1.15)
            bus, _ = spiceypy.ckgp(-94000, clock, 0.0, "J2000")
            mars = spiceypy.pxform("J2000", "IAU_MARS", et_s)
            mounting = spiceypy.pxform("MGS_SPACECRAFT", "MGS_MOC_NA", et_s)
            # Radians: a hundredth of a pixel of 3.7 microradians.
            assert numpy.abs(matrix - mars @ bus.T @ mounting.T).max() < 4e-8


@pytest.mark.parametrize(
    ("image", "kind", "text"),
    [
        ({}, ag.InputError, "name_model is missing"),
        ("nothing.json", ag.InputError, "cannot read"),
        (__file__, ag.InputError, "not JSON"),
    ],
)
def test_other_files_are_refused(image: Any, kind: type[Exception], text: str) -> None:
    with pytest.raises(kind, match=text):
        ag.ground_to_image(image, 1.0, 2.0, 3.4e6)


def test_a_camera_that_sees_no_ground_is_refused(mission: Mission) -> None:
    isd = mission.gusev.isd(IMAGE)
    # A spacecraft that stands still over a body that does not turn: no line sees a point.
    still = json.loads(json.dumps(isd))
    for block, key in (("instrument_position", "positions"), ("body_rotation", "quaternions")):
        still[block][key] = [still[block][key][0]] * len(still[block][key])
    for block, key in (("instrument_position", "velocities"), ("body_rotation", "angular_velocities")):
        still[block][key] = [[0.0] * 3] * len(still[block][key])
    with pytest.raises(ag.InputError, match="shows the ground"):
        ag.ground_to_image(still, 175.0, -15.0, 3.4e6)


def test_damaged_support_data_are_refused(mission: Mission, tmp_path: Path) -> None:
    isd = mission.gusev.isd(IMAGE)
    for change in ({"image_lines": 0}, {"radii": {}}, {"instrument_position": None}):
        with pytest.raises(ag.InputError):
            ag.ground_to_image({**isd, **change}, 175.0, -15.0, 3.4e6)
    saved = tmp_path / "isd.json"
    saved.write_text(json.dumps(isd))
    from_file = ag.image_to_ground(saved, 100.0, 100.0)
    assert from_file == ag.image_to_ground(isd, 100.0, 100.0)
