"""Sites: plans, checks and runs."""

from __future__ import annotations

import json
import os
import warnings
from dataclasses import dataclass
from typing import Any

from . import _native
from ._common import StrPath
from .results import Result, open_result


@dataclass(frozen=True)
class Stage:
    """A stage of a run."""

    name: str
    #: Whether a run would execute the stage; otherwise the stored output is kept.
    runs: bool
    #: The input that has changed, or why the output is kept.
    because: str


@dataclass(frozen=True)
class Plan:
    """Stages of a run, in order."""

    site: str
    stages: list[Stage]

    @property
    def to_run(self) -> list[Stage]:
        """Stages that a run would execute; empty if the products are up to date."""
        return [stage for stage in self.stages if stage.runs]


@dataclass(frozen=True)
class Check:
    """Configuration, inputs and coverage of a site, and the verdict of a run."""

    site: str
    #: Whether no known cause would stop a run or make its products invalid.
    ready: bool
    #: Causes that would stop a run, or make its products invalid, with advice.
    failures: list[str]
    findings: list[str]
    #: The verdict, as in the manifest; None if a run would fail, or if the verdict was not computed.
    verdict: dict[str, Any] | None


def plan(site: StrPath, *, out: StrPath = "out") -> Plan:
    """List the stages that a run of a site would execute, and why.

    Parameters
    ----------
    site
        Site file (TOML).
    out
        Folder of the products of all sites.
    """
    answer = _answer(_native.plan(os.fspath(site), os.fspath(out)))
    stages = [Stage(stage["stage"], stage["runs"], stage["because"]) for stage in answer["stages"]]
    return Plan(answer["site"], stages)


def check(site: StrPath, *, out: StrPath = "out", full: bool = False) -> Check:
    """Examine the configuration, the inputs and the kernel coverage of a site.

    Failures are part of the result; only an unreadable configuration raises an exception.

    Parameters
    ----------
    site, out
        As for `plan`. If the products in ``out`` are up to date, their verdict is returned.
    full
        Compute every stage for the verdict if the products are not up to date; no product is written.
    """
    answer = _answer(_native.check(os.fspath(site), os.fspath(out), full))
    return Check(
        answer["site"], answer["ready"], answer["failures"], answer["findings"], answer["verdict"]
    )


def run(site: StrPath, *, out: StrPath = "out", force: bool = False) -> Result:
    """Run a site from its kernels to its products, and open them.

    Only stages whose inputs have changed are executed. Products are published completely or not at all; invalid
    products are published too: see `Result.valid` and `Result.reasons`.

    Parameters
    ----------
    site, out
        As for `plan`; products go to a folder of the site in ``out``.
    force
        Execute every stage.

    Raises
    ------
    UsageError, InputError, CoverageError, FileAccessError
        If the run fails; products of an earlier run remain unchanged.
    """
    answer = _answer(_native.run(os.fspath(site), os.fspath(out), force))
    return open_result(answer["folder"])


def _answer(answered: tuple[str, list[str]]) -> Any:
    text, remarks = answered
    for remark in remarks:
        warnings.warn(remark, UserWarning, stacklevel=3)
    return json.loads(text)
