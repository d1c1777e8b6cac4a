"""Plans, checks and runs; the command of the wheel; the stubs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from conftest import Mission, areograph

import areograph as ag


def test_a_site_is_planned_checked_run_and_kept(mission: Mission, tmp_path: Path) -> None:
    site, out = mission.site("gusev_crater"), tmp_path / "out"
    planned = ag.plan(site, out=out)
    assert planned.site == "gusev_crater"
    assert len(planned.to_run) == len(planned.stages) > 10
    checked = ag.check(site, out=out)
    assert checked.ready and not checked.failures and checked.findings
    assert not (out / "gusev_crater").exists()
    result = ag.run(site, out=out)
    assert result.valid and result.folder == out / "gusev_crater"
    assert not ag.plan(site, out=out).to_run
    # The command reads the products of the function as its own.
    again = areograph("run", site, "--out", out)
    assert again.returncode == 0
    assert "nothing changed" in again.stdout


def test_an_invalid_site_is_published_with_reasons(mission: Mission, tmp_path: Path) -> None:
    text = mission.site("gusev_crater").read_text().replace('"../', f'"{mission.folder}/')
    site = tmp_path / "strict.toml"
    site.write_text(text.replace("\n[ties]", "\n[range_check]\nmean_max_m = 0.001\n\n[ties]", 1))
    result = ag.run(site, out=tmp_path / "out")
    assert not result.valid and result.reasons
    assert not ag.check(site, out=tmp_path / "out").ready


def test_wrong_configurations_raise_with_their_place(mission: Mission, tmp_path: Path) -> None:
    with pytest.raises(ag.InputError, match="no.toml"):
        ag.run(tmp_path / "no.toml", out=tmp_path)
    site = tmp_path / "wrong.toml"
    site.write_text('site = "a"\nkernel = 3\n')
    with pytest.raises(ag.UsageError, match=r"wrong.toml:2:1: kernel is an unknown key") as raised:
        ag.plan(site, out=tmp_path)
    assert raised.value.exit_code == 2
    text = mission.site("gusev_crater").read_text().replace('"../', f'"{mission.folder}/')
    site.write_text(text.replace("nav.tm", "gone.tm"))
    with pytest.raises(ag.AreographError, match="gone.tm"):
        ag.run(site, out=tmp_path / "out")


def test_the_command_has_its_exit_codes(mission: Mission, tmp_path: Path) -> None:
    assert areograph("--version").stdout == f"areograph {ag.__version__}\n"
    assert areograph("fly").returncode == 2
    assert areograph("run", tmp_path / "no.toml").returncode == 3
    module = [sys.executable, "-m", "areograph", "--version"]
    assert subprocess.run(module, capture_output=True, check=True, text=True).stdout.startswith("areograph ")


def test_a_service_starts_processes_of_the_wheel(tmp_path: Path) -> None:
    assert areograph("serve", "--init", tmp_path / "service").returncode == 0
    night = areograph("nightly", tmp_path / "service" / "areograph.toml")
    assert night.returncode == 0, night.stderr
    assert "4 sites compared, 4 runs, 0 failures" in night.stdout


def test_the_command_starts_without_packages_that_take_time() -> None:
    packages = ("numpy", "pandas", "pyarrow", "geopandas", "xarray")
    loaded = f"import sys, areograph.__main__; print([name for name in {packages} if name in sys.modules])"
    ran = subprocess.run([sys.executable, "-c", loaded], capture_output=True, check=True, text=True)
    assert ran.stdout.strip() == "[]"


def test_the_stubs_are_those_of_the_module() -> None:
    ran = subprocess.run(
        [sys.executable, "-m", "mypy.stubtest", "areograph._native", "--ignore-missing-stub"],
        capture_output=True,
        check=False,
        text=True,
    )
    assert ran.returncode == 0, ran.stdout


def test_a_fetch_without_indexes_states_what_to_do(mission: Mission, tmp_path: Path) -> None:
    with pytest.raises(ag.InputError, match="expected the index"):
        ag.fetch(mission.site("gusev_crater"), tmp_path, plan_only=True)
