"""What is packaged fits together: releases of MuJoCo, platforms, advice by how it was installed."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from mecanum_cli.doctor import EXTRAS
from mecanum_env import checkout as checkout_module
from mecanum_env.errors import install_command
from mecanum_env.plugin import build_command

SETTINGS = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))


def test_every_mujoco_that_a_wheel_has_a_plugin_for_may_be_installed():
    requirements = pytest.importorskip("packaging.requirements")

    def of_mujoco(names):
        return next(one for one in map(requirements.Requirement, names) if one.name == "mujoco").specifier

    allowed = of_mujoco(SETTINGS["project"]["dependencies"])
    # The plugin of an installation from source is built for what pip resolves from the same range.
    assert of_mujoco(SETTINGS["build-system"]["requires"]) == allowed
    assert all(release in allowed for release in SETTINGS["tool"]["mecanum"]["mujoco-releases"])


def test_windows_is_refused_at_import():
    code = "import sys; sys.platform = 'win32'; import mecanum_env"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "does not run on Windows; use Linux, macOS or WSL 2" in done.stderr


def test_advice_fits_how_the_package_was_installed(monkeypatch):
    monkeypatch.setattr(checkout_module, "checkout", lambda: Path("/here"))
    assert install_command("train") == '`pip install -c constraints.txt ".[train]"` in the checkout'
    assert "`pip install --no-build-isolation .` in the checkout" in build_command()
    monkeypatch.setattr(checkout_module, "checkout", lambda: None)
    assert install_command("train") == '`pip install "mecanum-tankendo[train]"`'
    assert "in the checkout" not in build_command()


def test_the_doctor_and_the_page_name_every_extra_for_users():
    extras = set(SETTINGS["project"]["optional-dependencies"]) - {"dev"}
    assert set(EXTRAS) == extras
    page = (Path(__file__).parents[1] / "docs" / "installation.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1] for line in page.splitlines() if line.startswith("| `")]
    assert extras == {name.strip(" `") for row in rows for name in row.split(",")}
