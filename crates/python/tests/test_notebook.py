"""The notebook, cell after cell, against the adjustment that it shows."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import matplotlib
import pytest
from conftest import Mission

matplotlib.use("Agg")

NOTEBOOK = Path(os.environ.get("AREOGRAPH_NOTEBOOK", "first_site.ipynb"))


@pytest.mark.skipif(not NOTEBOOK.is_file(), reason="AREOGRAPH_NOTEBOOK names no file")
def test_the_notebook_runs_and_shows_the_adjustment(
    mission: Mission, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    result = mission.gusev
    monkeypatch.setenv("AREOGRAPH_SITE", str(result.folder))
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert all(cell["outputs"] for cell in code), "the notebook is kept with its outputs"
    names: dict[str, Any] = {"display": print}
    for number, cell in enumerate(code, 1):
        exec(compile("".join(cell["source"]), f"cell {number}", "exec"), names)
    printed = capsys.readouterr().out
    assert f"{result.site} {result.verdict}" in printed
    adjustment = json.loads((result.folder / "adjustment.json").read_text())
    for column, when in (("above_surface_m", "before"), ("adjusted_above_surface_m", "after")):
        heights = adjustment[when]["heights"]["above_surface_m"]
        assert f"median of {column}: {heights['median']:.3f} m of {heights['n']} tie points" in printed
    for image in result.images:
        assert f"{image} adjusted: " in printed
