"""Paths, optional packages and provenance, as the modules of the package use them."""

from __future__ import annotations

import importlib
import os
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy

from . import _native

if TYPE_CHECKING:
    from numpy.typing import NDArray

StrPath: TypeAlias = "str | os.PathLike[str]"
Paths: TypeAlias = "StrPath | Sequence[StrPath]"


def paths_of(paths: Paths) -> list[str]:
    """Return one path or several as a list."""
    if isinstance(paths, str | os.PathLike):
        return [os.fspath(paths)]
    return [os.fspath(path) for path in paths]


def optional(module: str, extra: str) -> Any:
    """Import a module of an optional package."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        message = f"{package} cannot be imported ({error}): pip install 'areograph[{extra}]'"
        raise ImportError(message) from error


def column(values: Any) -> NDArray[numpy.float64]:
    """Return numbers as a contiguous array of one dimension."""
    return numpy.ascontiguousarray(values, dtype=numpy.float64).reshape(-1)


def kernels_of(kernels: Iterable[tuple[str, str]]) -> list[dict[str, str]]:
    """Return names and hashes of kernels for attributes."""
    return [{"name": name, "blake3": blake3} for name, blake3 in kernels]


def provenance(**of: Any) -> dict[Any, Any]:
    """Return attributes of a result: the version of areograph and these entries."""
    return {"areograph": {"version": _native.VERSION, **of}}
