"""Loading at `import mujoco`, from an installed package, for exactly a MuJoCo that it was compiled for."""

import os
import shutil
import subprocess
import sys
import sysconfig
from importlib.metadata import entry_points
from pathlib import Path

import mujoco
import pytest

import mecanum_env.plugin
from mecanum_env.errors import BackendError
from mecanum_env.plugin import library_path, register

XML = """
<mujoco>
  <size nuser_actuator="16"/>
  <default><general biastype="affine" biasprm="0 0 -5"/></default>
  <extension><plugin plugin="mecanum.wheel"/></extension>
  <worldbody><body><joint name="j"/><geom size="0.1"/></body></worldbody>
  <actuator>
    <plugin plugin="mecanum.wheel" joint="j" dynprm="0.5 0 0 0.5 0 0 0.01 0.1 1 100" user="0 0 1"/>
  </actuator>
</mujoco>
"""

BY_ENTRY_POINT = pytest.mark.skipif(mujoco.__version__ < "4", reason="MuJoCo 3 knows no entry points")


def python(code: str, folder, *options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *options, "-c", code]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)


@BY_ENTRY_POINT
def test_import_mujoco_alone_is_enough_to_read_a_file(tmp_path):
    (tmp_path / "wheel.xml").write_text(XML)
    done = python(
        "import warnings; warnings.simplefilter('error')\n"
        "import mujoco, sys\n"
        "heavy = [name for name in ('scipy', 'gymnasium', 'matplotlib') if name in sys.modules]\n"
        "print(mujoco.MjModel.from_xml_path('wheel.xml').nplugin, heavy)",
        tmp_path,
    )
    assert (done.stdout.strip(), done.stderr) == ("1 []", "")


def test_the_entry_point_is_installed():
    (entry,) = (e for e in entry_points(group="mujoco.plugins") if e.name == "mecanum_wheel")
    assert entry.load() is register


def test_mujoco_3_is_registered_by_the_package_and_4_by_its_entry_point(monkeypatch):
    called = []
    monkeypatch.setattr(mecanum_env.plugin, "register", lambda: called.append(1))
    for version, times in (("4.0.1", 0), ("3.17.0", 1)):
        monkeypatch.setattr(mujoco, "mj_versionString", lambda version=version: version)
        mecanum_env.plugin.register_if_mujoco_did_not()
        assert len(called) == times


def test_registering_again_changes_nothing():
    register()
    assert mujoco.MjModel.from_xml_string(XML).nplugin == 1


def test_another_mujoco_is_refused_before_the_library_is_loaded(monkeypatch):
    monkeypatch.setattr(mujoco, "mj_versionString", lambda: "5.0.0")
    monkeypatch.setattr(mujoco, "mj_loadPluginLibrary", lambda _: pytest.fail("loaded"))
    with pytest.raises(
        BackendError, match=r"compiled for mujoco .*, but mujoco 5\.0\.0 runs; .*pip install mujoco==[34]"
    ):
        register()


def test_a_missing_library_says_how_to_build_it(tmp_path, monkeypatch):
    with pytest.raises(BackendError, match=r"mecanum_wheel-mujoco-4\.0\.0\.so is not in .*pip install"):
        library_path("4.0.0", [str(tmp_path)])
    monkeypatch.setattr(mecanum_env.plugin, "__path__", [str(tmp_path)])
    monkeypatch.setattr(mecanum_env.plugin, "__version__", "0.0.0")
    with pytest.raises(BackendError, match="is not in"):
        register()


@BY_ENTRY_POINT
def test_import_mujoco_goes_on_and_warns_without_the_library(tmp_path):
    """MuJoCo turns what an entry point raises into a warning."""
    done = python(
        "import sys, mecanum_env.plugin as p\n"
        f"p.__path__ = [{str(tmp_path)!r}]; p.installed_folders = list\n"
        "import mujoco; print(mujoco.MjModel.from_xml_string('<mujoco/>').nbody)",
        tmp_path,
    )
    assert done.stdout.strip() == "1"
    assert "RuntimeWarning: Failed to load mujoco plugin entry point mecanum_wheel" in done.stderr
    assert "compile it: `pip install" in done.stderr


def test_the_library_for_the_running_mujoco_is_found_among_others(tmp_path):
    for version in ("3.9.0", "4.0.0", "4.0.1"):
        (tmp_path / f"mecanum_wheel-mujoco-{version}.so").touch()
    assert library_path("4.0.0", [str(tmp_path)]).name == "mecanum_wheel-mujoco-4.0.0.so"
    with pytest.raises(
        BackendError, match=r"compiled for mujoco 3\.9\.0, 4\.0\.0, 4\.0\.1, but mujoco 5\.0\.0 runs"
    ):
        library_path("5.0.0", [str(tmp_path)])


def test_a_library_of_other_sources_is_refused(monkeypatch):
    monkeypatch.setattr(mujoco, "mj_loadPluginLibrary", lambda _: pytest.fail("loaded"))
    monkeypatch.setattr(mecanum_env.plugin, "sources_sha256", lambda: "of other sources")
    with pytest.raises(BackendError, match=r"was compiled from other sources; compile .*pip install"):
        register()


def installed_package(site: Path, version: str) -> Path:
    """Lay out what an installation of a version leaves in site-packages; return its library."""
    metadata = site / f"mecanum_tankendo-{version}.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: mecanum-tankendo\nVersion: {version}\n")
    (metadata / "entry_points.txt").write_text(
        "[mujoco.plugins]\nmecanum_wheel = mecanum_env.plugin:register\n"
    )
    folder = site / "mecanum_env" / "plugin"
    folder.mkdir(parents=True)
    return Path(shutil.copy(library_path(mujoco.__version__), folder))


def test_a_checkout_that_shadows_the_installed_package_uses_its_library(tmp_path, monkeypatch):
    library = installed_package(tmp_path / "site", mecanum_env.__version__)
    installed_package(tmp_path / "other", "0.0.9")
    monkeypatch.setattr(mecanum_env.plugin, "__path__", [str(tmp_path / "checkout")])
    monkeypatch.setattr(sys, "path", [str(tmp_path / "checkout"), str(tmp_path / "site")])
    assert library_path(mujoco.__version__) == library
    # Another version's library may not fit these Python files.
    monkeypatch.setattr(sys, "path", [str(tmp_path / "other")])
    with pytest.raises(BackendError, match=r"is not in .*checkout; compile it: `pip install"):
        library_path(mujoco.__version__)


@BY_ENTRY_POINT
def test_programs_run_inside_a_checkout_without_a_library(tmp_path, monkeypatch):
    checkout, site = tmp_path / "checkout", tmp_path / "site"
    without = shutil.ignore_patterns("*.so", "__pycache__")
    shutil.copytree(Path(mecanum_env.__file__).parent, checkout / "mecanum_env", ignore=without)
    (checkout / "wheel.xml").write_text(XML)
    installed_package(site, mecanum_env.__version__)
    # Without `site`, which would make an editable install take the place of the copied checkout.
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(site), sysconfig.get_path("purelib")]))
    done = python(
        "import warnings; warnings.simplefilter('error'); import mujoco, mecanum_env\n"
        "print(mujoco.MjModel.from_xml_path('wheel.xml').nplugin, *mecanum_env.__path__)",
        checkout,
        "-S",
    )
    assert (done.stdout.split(), done.stderr) == (["1", str(checkout / "mecanum_env")], "")


def test_importing_the_plugin_package_does_not_import_mujoco(tmp_path):
    done = python(
        "import sys, mecanum_env.plugin; print('mujoco' in sys.modules, 'numpy' in sys.modules)", tmp_path
    )
    assert done.stdout.split() == ["False", "False"]


def test_a_library_that_cannot_be_loaded_is_an_error_not_a_crash(tmp_path):
    (tmp_path / "mecanum_wheel-mujoco-4.0.0.so").write_bytes(b"no library")
    with pytest.raises(mujoco.FatalError, match="mecanum_wheel"):
        mujoco.mj_loadPluginLibrary(str(tmp_path / "mecanum_wheel-mujoco-4.0.0.so"))
