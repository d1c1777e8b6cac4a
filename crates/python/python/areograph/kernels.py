"""Spacecraft states, and differences between kernel sets."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy
import pyarrow

from . import _native
from ._common import Paths, column, kernels_at, kernels_of, optional, provenance_text, utc_text
from .errors import UsageError

if TYPE_CHECKING:
    from xarray import Dataset

_FRAMES = {"IAU_MARS": True, "J2000": False}
_AXES = ["radial", "along_track", "cross_track"]


def spacecraft_state(et: Any, kernels: Paths, *, frame: str = "IAU_MARS") -> Dataset:
    """Compute geometric states of Mars Global Surveyor relative to Mars.

    Parameters
    ----------
    et
        TDB seconds past J2000, or UTC as text or datetime: a single value or an array.
    kernels
        A metakernel (``.tm``), or kernels in load order.
    frame
        ``"IAU_MARS"`` with the IAU 2000 constants of areograph, velocities relative to the rotating frame; or
        ``"J2000"``.

    Returns
    -------
    xarray.Dataset
        ``position_m`` and ``velocity_m_s`` with dimensions ``et`` and ``xyz``; coordinates ``et`` (seconds) and
        ``utc``.

    Raises
    ------
    CoverageError
        If the kernels do not cover an instant.
    """
    if frame not in _FRAMES:
        raise UsageError(f"frame is {frame!r}; expected one of {', '.join(_FRAMES)}")
    xarray, files = optional("xarray"), kernels_at(kernels)
    texts = _utc_texts(et)
    et_s = column(et, "et") if texts is None else column(_native.utc_to_et(texts, files))
    if not numpy.all(numpy.isfinite(et_s)):
        row = int(numpy.flatnonzero(~numpy.isfinite(et_s))[0])
        raise UsageError(f"et[{row}] is {et_s[row]}; expected finite seconds past J2000")
    states, used = _native.spacecraft_states(et_s, files, _FRAMES[frame])
    table = pyarrow.table(states)

    def vectors(names: Iterable[str]) -> Any:
        return numpy.column_stack([table[name].to_numpy() for name in names])

    dims = ("et", "xyz")
    dataset: Dataset = xarray.Dataset(
        {
            "position_m": (dims, vectors(["x_m", "y_m", "z_m"]), {"units": "m"}),
            "velocity_m_s": (dims, vectors(["vx_m_s", "vy_m_s", "vz_m_s"]), {"units": "m s-1"}),
        },
        coords={
            "et": ("et", et_s, {"units": "s", "long_name": "TDB seconds past J2000"}),
            "utc": ("et", table["utc"].to_numpy(zero_copy_only=False)),
            "xyz": ["x", "y", "z"],
        },
        attrs={"frame": frame, **provenance_text(kernels=kernels_of(used))},
    )
    return dataset


def compare_kernels(
    a: Paths, b: Paths, *, t0: Any = None, t1: Any = None
) -> Dataset:
    """Compare the orbits and attitudes of two kernel sets: the deviation of each from the mean of both.

    Parameters
    ----------
    a, b
        Metakernels (``.tm``), or kernels in load order.
    t0, t1
        First and last instant, UTC as text or datetime; by default the whole time that both sets cover.

    Returns
    -------
    xarray.Dataset
        ``position_m`` with dimensions ``set``, ``et`` and ``axis`` (radial, along-track, cross-track of the mean
        orbit); where the sets contain attitudes, ``attitude_arcsec`` with dimensions ``set``, ``et_attitude`` and
        ``axis``. ``b`` minus ``a`` is twice the deviation of ``b``. Epochs are 1 s apart, or farther apart if there
        would be more than 10,000. ``attrs["areograph"]``, JSON, contains the statistics.

    Raises
    ------
    UsageError
        If both sets contain the same kernels.
    CoverageError
        If the sets cover no common time.
    """
    xarray = optional("xarray")
    if (t0 is None) != (t1 is None):
        raise UsageError("only one of t0 and t1 is given; expected both, or neither")
    utc = None if t0 is None else [utc_text(time) for time in (t0, t1)]
    if utc is not None and None in utc:
        raise UsageError(f"t0 and t1 are {t0!r} and {t1!r}; expected UTC as text or datetime")
    text, used = _native.compare_kernels([("a", kernels_at(a)), ("b", kernels_at(b))], utc)
    answer = json.loads(text)
    orbit, attitude = answer["orbit"], answer.get("attitude")
    variables = {
        "position_m": (
            ("set", "et", "axis"),
            numpy.array([each.pop("radial_along_cross_m") for each in orbit["sets"]]),
            {"units": "m"},
        )
    }
    coords: dict[str, Any] = {"set": ["a", "b"], "et": orbit.pop("epochs_et_s"), "axis": _AXES}
    if attitude is not None:
        turns = [each.pop("radial_along_cross_arcsec") for each in attitude["sets"]]
        variables["attitude_arcsec"] = (
            ("set", "et_attitude", "axis"),
            numpy.array(turns),
            {"units": "arcsec"},
        )
        coords["et_attitude"] = attitude.pop("epochs_et_s")
    kernels = {name: kernels_of(each) for name, each in zip("ab", used, strict=True)}
    attrs = provenance_text(kernels=kernels, statistics=answer)
    dataset: Dataset = xarray.Dataset(variables, coords=coords, attrs=attrs)
    return dataset


def _utc_texts(et: Any) -> list[str] | None:
    """Return times in UTC as text, or None for numbers."""
    one = utc_text(et)
    if one is not None:
        return [one]
    if not isinstance(et, Iterable):
        return None
    texts = [utc_text(time) for time in et]
    found = [text for text in texts if text is not None]
    return found if found and len(found) == len(texts) else None
