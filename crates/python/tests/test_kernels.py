"""Spacecraft states and kernel comparisons against CSPICE as another package calls it."""

from __future__ import annotations

import json

import numpy
import pytest
import spiceypy
from conftest import Mission, cspice

import areograph as ag


def test_states_are_those_of_cspice(mission: Mission) -> None:
    et_s = float(mission.gusev.footprints["et_s"].iloc[0]) + numpy.arange(0.0, 60.0, 15.0)
    for frame in ("J2000", "IAU_MARS"):
        states = ag.spacecraft_state(et_s, mission.kernels, frame=frame)
        with cspice(mission):
            for number, et in enumerate(et_s):
                state, _ = spiceypy.spkezr("-94", et, frame, "NONE", "499")
                # Metres and metres per second: rounding, and the moving pole in the velocity.
                assert numpy.abs(1e3 * state[:3] - states["position_m"][number].values).max() < 1e-3
                assert numpy.abs(1e3 * state[3:] - states["velocity_m_s"][number].values).max() < 1e-4
                utc = spiceypy.et2utc(et, "ISOC", 3)
                assert states["utc"][number].item().rstrip("Z") == utc
    by_utc = ag.spacecraft_state(list(states["utc"].values), mission.kernels)
    assert numpy.abs(by_utc["et"].values - et_s).max() < 1e-3
    times = numpy.array([text.rstrip("Z") for text in states["utc"].values], dtype="datetime64[ms]")
    for dates in (times, list(times.astype(object))):
        assert numpy.array_equal(ag.spacecraft_state(dates, mission.kernels)["et"], by_utc["et"])
    # Attributes that NetCDF holds.
    stated = json.loads(states.attrs["areograph"])
    assert "leapseconds.tls" in [kernel["name"] for kernel in stated["kernels"]]


def test_differences_of_kernel_sets_are_those_of_their_states(mission: Mission) -> None:
    folder = mission.folder / "kernels"
    start, stop = (mission.gusev.shots["utc"].min(), mission.gusev.shots["utc"].max())
    ends = [end.strftime("%Y-%m-%dT%H:%M:%S") for end in (start, stop)]
    compared = ag.compare_kernels(folder / "nav.tm", folder / "gsfc.tm", t0=ends[0], t1=ends[1])
    et_s = compared["et"].values[:: max(1, compared.sizes["et"] // 5)]
    a, b = (ag.spacecraft_state(et_s, folder / name, frame="J2000")["position_m"] for name in ("nav.tm", "gsfc.tm"))
    apart_m = numpy.linalg.norm((b - a).values, axis=1)
    deviation = compared["position_m"].sel(et=et_s, set="b") - compared["position_m"].sel(et=et_s, set="a")
    # Metres: both are distances between the two orbits.
    assert numpy.abs(numpy.linalg.norm(deviation.values, axis=1) - apart_m).max() < 1e-3
    assert apart_m.max() > 1.0
    with pytest.raises(ag.UsageError, match="same kernels"):
        ag.compare_kernels(folder / "nav.tm", folder / "nav.tm")
    hashes = {kernel["name"]: kernel["blake3"] for kernel in json.loads(compared.attrs["areograph"])["kernels"]["b"]}
    assert len(hashes["mgs_gsfc_scene.bsp"]) == 64
    with pytest.raises(ag.UsageError, match="t0 earlier than t1"):
        ag.compare_kernels(folder / "nav.tm", folder / "gsfc.tm", t0=ends[1], t1=ends[0])
    with pytest.raises(ag.UsageError, match="UTC as text or datetime"):
        ag.compare_kernels(folder / "nav.tm", folder / "gsfc.tm", t0=1.0, t1=2.0)
    with pytest.raises(ag.UsageError, match="only one"):
        ag.compare_kernels(folder / "nav.tm", folder / "gsfc.tm", t0=ends[0])
