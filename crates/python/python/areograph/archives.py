"""Files from the archives of the mission."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from . import _native
from ._common import StrPath, optional, provenance

if TYPE_CHECKING:
    from pandas import DataFrame


def fetch(
    site: StrPath,
    into: StrPath | None = None,
    *,
    plan_only: bool = False,
    archives: StrPath | None = None,
) -> DataFrame:
    """Fetch the files that a site needs from the archives of the mission.

    Transfers are resumed and verified; a file appears complete or not at all. Files that exist are not replaced.

    Parameters
    ----------
    site
        Site file (TOML); its inputs may be missing.
    into
        Folder of ``fetch.json`` and of copies of the indexes; by default the folder of the site file.
    plan_only
        Only list the files, from the copies of the indexes: no archive is contacted.
    archives
        Table of other hosts, in the form of ``config/archives/mgs.toml``.

    Returns
    -------
    pandas.DataFrame
        ``kind``, ``file``, ``url``, ``bytes``, ``md5``, ``status`` and ``why`` of every file. The status of a file that
        could not be fetched begins with ``failed``. ``attrs["areograph"]["notes"]`` lists needs that no archive meets.
    """
    pandas = optional("pandas")
    rows, notes = _native.fetch(
        os.fspath(site),
        None if into is None else os.fspath(into),
        plan_only,
        None if archives is None else os.fspath(archives),
    )
    names = ["kind", "file", "url", "bytes", "md5", "status", "why"]
    frame: DataFrame = pandas.DataFrame(rows, columns=names).astype({"bytes": "Int64"})
    frame.attrs = provenance(notes=notes)
    return frame
