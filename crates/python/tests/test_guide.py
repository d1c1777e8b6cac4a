"""The examples of the guide, as they stand."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import pytest
from conftest import Mission

CHAPTER = Path(os.environ.get("AREOGRAPH_GUIDE", "python.md"))


@pytest.mark.skipif(not CHAPTER.is_file(), reason="AREOGRAPH_GUIDE names no file")
def test_the_examples_of_the_chapter_run(
    mission: Mission, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mission").symlink_to(mission.folder)
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"(?ms)^```python\n(.*?)^```", CHAPTER.read_text(encoding="utf-8"))
    assert len(blocks) == 3
    names: dict[str, Any] = {}
    for block in blocks:
        exec(block, names)
    printed = capsys.readouterr().out
    assert "<Result gusev_crater: valid;" in printed
    # The position that the second example began with.
    assert "5000.000 512.000 True" in printed


def test_every_function_is_in_the_table_of_the_chapter() -> None:
    import areograph as ag

    if not CHAPTER.is_file():
        pytest.skip("AREOGRAPH_GUIDE names no file")
    rows = "".join(line for line in CHAPTER.read_text(encoding="utf-8").splitlines() if line.startswith("| `"))
    functions = {name for name in ag.__all__ if name.islower() and name != "__version__"}
    assert functions == set(re.findall(r"`([a-z_]+)\(", rows))
