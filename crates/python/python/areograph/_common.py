"""Paths, optional packages and provenance, as the modules of the package use them."""

from __future__ import annotations

import datetime
import importlib
import json
import os
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy

from . import _native
from .errors import UsageError

if TYPE_CHECKING:
    from numpy.typing import NDArray

StrPath: TypeAlias = "str | os.PathLike[str]"
Paths: TypeAlias = "StrPath | Sequence[StrPath]"


def kernels_at(paths: Paths) -> list[str]:
    """Return kernels as a list of files."""
    files = paths_of(paths)
    folder = next((path for path in files if os.path.isdir(path)), None)
    if folder is not None or not files:
        found = "no kernels" if folder is None else f"kernels are the folder {folder}"
        raise UsageError(f"{found}; expected a metakernel (.tm), or kernels in load order")
    return files


def paths_of(paths: Paths) -> list[str]:
    """Return one path or several as a list."""
    if isinstance(paths, str | os.PathLike):
        return [os.fspath(paths)]
    return [os.fspath(path) for path in paths]


def optional(module: str) -> Any:
    """Import a module of an optional package."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        message = f"{package} cannot be imported ({error}); install it with pip"
        raise ImportError(message) from error


def column(values: Any, name: str = "a value") -> NDArray[numpy.float64]:
    """Return numbers as a contiguous array of one dimension; masked values are NaN."""
    array = numpy.ma.asanyarray(values) if numpy.ma.isMaskedArray(values) else numpy.asarray(values)
    if array.dtype.kind not in "biuf":
        raise UsageError(f"{name} is of type {array.dtype}; expected numbers")
    array = array.astype(numpy.float64)
    if isinstance(array, numpy.ma.MaskedArray):
        array = array.filled(numpy.nan)
    return numpy.ascontiguousarray(array).reshape(-1)


def utc_text(time: Any) -> str | None:
    """Return a date and time as UTC text; None for other types."""
    if isinstance(time, str):
        return time
    if isinstance(time, datetime.datetime):
        if time.tzinfo is not None:
            time = time.astimezone(datetime.timezone.utc).replace(tzinfo=None)
        return str(time.isoformat(timespec="microseconds"))
    if isinstance(time, numpy.datetime64):
        return str(numpy.datetime_as_string(time, unit="us"))
    return None


def kernels_of(kernels: Iterable[tuple[str, str]]) -> list[dict[str, str]]:
    """Return names and hashes of kernels for attributes."""
    return [{"name": name, "blake3": blake3} for name, blake3 in kernels]


def provenance(**of: Any) -> dict[Any, Any]:
    """Return attributes of a data frame: the version of areograph and these entries."""
    return {"areograph": {"version": _native.VERSION, **of}}


def provenance_text(**of: Any) -> dict[Any, Any]:
    """Return attributes of a dataset: those of `provenance` as JSON, which NetCDF files can store."""
    return {name: json.dumps(value) for name, value in provenance(**of).items()}
