"""Exceptions by kind of failure; the message states site, stage, file, value and advice.

Every exception has the attributes ``exit_code`` (as for the command), ``site``, ``stage``, ``file`` and
``advice``.
"""

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

# Values of exceptions that are raised in Python.
AreographError.site = AreographError.stage = AreographError.file = None
AreographError.advice = ""
for _code, _kind in enumerate(
    (InternalError, UsageError, InputError, CoverageError, InvalidProducts, FileAccessError), start=1
):
    _kind.exit_code = _code
