"""Exceptions by kind of failure; the message states site, stage, file, value and what to do."""

from ._native import (
    AreographError,
    CoverageError,
    FileAccessError,
    InputError,
    InternalError,
    InvalidProducts,
    UsageError,
)

__all__ = [
    "AreographError",
    "CoverageError",
    "FileAccessError",
    "InputError",
    "InternalError",
    "InvalidProducts",
    "UsageError",
]
