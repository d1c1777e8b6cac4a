"""Mars Global Surveyor data: SPICE kernels, MOLA shots and MOC images to validated photogrammetric products.

Longitudes are east and latitudes areocentric, in degrees, in IAU 2000; lengths are in metres and times in TDB seconds
past J2000 (ET). Names of columns end in their unit. Results carry their provenance in ``attrs["areograph"]``, Arrow
tables in the schema metadata ``areograph``. Long calls release the global interpreter lock and stop on Ctrl-C.

The command ``areograph`` of the same wheel is the program.
"""

import importlib
import os
import sys
from typing import TYPE_CHECKING, Any


def _load_native() -> None:
    # Other packages, such as spiceypy, export the symbols of their CSPICE to the whole process. Without this flag,
    # calls from areograph would be bound to them, and would read and unload the kernels of these packages.
    flags = sys.getdlopenflags()
    sys.setdlopenflags(flags | getattr(os, "RTLD_DEEPBIND", 0))
    try:
        importlib.import_module("areograph._native")
    finally:
        sys.setdlopenflags(flags)


_load_native()

from ._native import VERSION as __version__  # noqa: E402
from .errors import (  # noqa: E402
    AreographError,
    CoverageError,
    FileAccessError,
    InputError,
    InternalError,
    InvalidProducts,
    UsageError,
)

if TYPE_CHECKING:
    from .archives import fetch
    from .cameras import ground_to_image, image_to_ground, load, orientation
    from .kernels import compare_kernels, spacecraft_state
    from .results import Result, open_result
    from .shots import check_ranges, read_pedr, search_shots, tracks
    from .sites import Check, Plan, Stage, check, plan, run

__all__ = [
    "AreographError",
    "Check",
    "CoverageError",
    "FileAccessError",
    "InputError",
    "InternalError",
    "InvalidProducts",
    "Plan",
    "Result",
    "Stage",
    "UsageError",
    "__version__",
    "check",
    "check_ranges",
    "compare_kernels",
    "fetch",
    "ground_to_image",
    "image_to_ground",
    "load",
    "open_result",
    "orientation",
    "plan",
    "read_pedr",
    "run",
    "search_shots",
    "spacecraft_state",
    "tracks",
]

# Loaded when they are used: the command starts without NumPy and PyArrow.
_MODULES = {
    "archives": ["fetch"],
    "cameras": ["ground_to_image", "image_to_ground", "load", "orientation"],
    "kernels": ["compare_kernels", "spacecraft_state"],
    "results": ["Result", "open_result"],
    "shots": ["check_ranges", "read_pedr", "search_shots", "tracks"],
    "sites": ["Check", "Plan", "Stage", "check", "plan", "run"],
}


def __getattr__(name: str) -> Any:
    for module, names in _MODULES.items():
        if name in names:
            return getattr(importlib.import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
