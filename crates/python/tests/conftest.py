"""A synthetic mission and its products, made with the command and the functions of the installed package."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
import spiceypy

import areograph as ag


@dataclass(frozen=True)
class Mission:
    """Folders of the mission and of its products."""

    folder: Path
    out: Path

    @property
    def kernels(self) -> Path:
        return self.folder / "kernels" / "nav.tm"

    @property
    def pedr(self) -> Path:
        return self.folder / "pedr"

    def site(self, name: str) -> Path:
        return self.folder / "sites" / f"{name}.toml"

    @property
    def gusev(self) -> ag.Result:
        return ag.run(self.site("gusev_crater"), out=self.out)


@contextmanager
def cspice(mission: Mission) -> Iterator[None]:
    """Load the kernels of the mission into the CSPICE of spiceypy, where paths are relative to the current folder."""
    before = Path.cwd()
    os.chdir(mission.kernels.parent)
    try:
        spiceypy.furnsh(mission.kernels.name)
        yield
    finally:
        spiceypy.kclear()
        os.chdir(before)


def areograph(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the command of the wheel."""
    command = ["areograph", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def pytest_configure(config: pytest.Config) -> None:
    """Write the mission and run a site before tests are collected: some are made for every product."""
    folder = Path(tempfile.mkdtemp(prefix="areograph-"))
    config.add_cleanup(lambda: shutil.rmtree(folder))
    wrote = areograph("--quiet", "scene", "mission", folder / "mission")
    assert wrote.returncode == 0, wrote.stderr
    MISSIONS.append(Mission(folder / "mission", folder / "out"))
    os.environ["AREOGRAPH_SITE"] = str(MISSIONS[0].gusev.folder)


MISSIONS: list[Mission] = []


@pytest.fixture(scope="session")
def mission() -> Mission:
    return MISSIONS[0]
