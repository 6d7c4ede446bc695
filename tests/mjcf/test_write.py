import subprocess
import sys

import mujoco
import numpy as np
import pytest

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.files import asset_path
from mecanum_env.mjcf import robot_spec
from mecanum_env.mjcf.__main__ import main
from mecanum_env.mjcf.plants import SPECS, left_out, mjcf_text, write_models
from mecanum_env.model import paper_model, write_model


def arrays(mj_model):
    """Every array of a compiled model by name."""
    names = [name for name in dir(mj_model) if not name.startswith("_")]
    return {name: value for name in names if isinstance(value := getattr(mj_model, name), np.ndarray)}


@pytest.mark.skipif(
    int(mujoco.__version__.split(".")[0]) < 4, reason="the packaged files say which geoms cast shadows"
)
@pytest.mark.parametrize("name", SPECS)
def test_the_packaged_files_are_what_the_generator_makes(name, packaged):
    """Up to the last digits, in which mathematical libraries differ.

    To write them again: `python -m mecanum_env.mjcf --out assets`.
    """
    ours = arrays(mujoco.MjModel.from_xml_path(str(asset_path(name))))
    for field, value in arrays(SPECS[name](packaged).compile()).items():
        np.testing.assert_allclose(ours[field], value, rtol=1e-9, atol=1e-12, err_msg=field)


@pytest.mark.parametrize("name", SPECS)
def test_the_written_numbers_read_back_exactly(name, packaged):
    spec = SPECS[name](packaged)
    read = mujoco.MjModel.from_xml_string(mjcf_text(spec))
    compiled = spec.compile()
    assert read.opt.timestep == compiled.opt.timestep
    for field, value in arrays(compiled).items():
        np.testing.assert_array_equal(getattr(read, field), value, err_msg=field)


def test_writing_leaves_the_spec_alone(packaged):
    spec = SPECS["bench.xml"](packaged)
    before = spec.to_xml()
    mjcf_text(spec)
    assert spec.to_xml() == before


def test_bad_input_writes_nothing(packaged, tmp_path):
    for bad in (
        packaged.with_effect("payload", mass_kg=-1.0),
        packaged.with_effect("body_speed_limit", v_rpm=60.0),
    ):
        with pytest.raises(InputError, match=r"effects\."):
            write_models(bad, tmp_path / "out")
        assert not (tmp_path / "out").exists()


def test_a_plant_that_cannot_express_an_effect_is_left_out_with_its_reason(packaged, tmp_path):
    model = packaged.with_effect("low_grip", friction=0.1)
    assert [path.name for path in write_models(model, tmp_path)] == ["robot.xml", "bench.xml"]
    assert list(left_out(model)) == ["planar.xml"]
    assert "effects.low_grip: the planar plant cannot" in left_out(model)["planar.xml"]
    assert left_out(packaged) == {}


def test_a_model_with_effects_is_written_exactly_too(packaged):
    model = (
        packaged.with_effect("coulomb_friction", torque_n_m=0.123456789)
        .with_effect("stiction", breakaway_n_m=1 / 3, stribeck_rpm=1 / 7)
        .with_effect("roller_friction", torque_n_m=0.0123456789, damping_n_m_s_rad=1e-3 / 3)
        .with_effect("payload", mass_kg=10 / 3, height_m=1 / 3)
        .with_effect("com_offset", x_m=0.1 / 3)
        .with_effect("floor_slope", slope_deg=10 / 3, heading_deg=77.7)
        .with_effect("backlash", gap_deg=1 / 3)
        .with_effect("speed_gain", gain=0.987654321)
    )
    spec = robot_spec(model)
    read, compiled = mujoco.MjModel.from_xml_string(mjcf_text(spec)), spec.compile()
    for field, value in arrays(compiled).items():
        np.testing.assert_array_equal(getattr(read, field), value, err_msg=field)
    np.testing.assert_array_equal(read.opt.gravity, compiled.opt.gravity)


def test_the_program_writes_files_that_open(tmp_path):
    write_model(paper_model(), tmp_path / "model.json")
    command = [sys.executable, "-m", "mecanum_env.mjcf", tmp_path / "model.json", "--out", tmp_path / "mjcf"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.split() == [str(tmp_path / "mjcf" / name) for name in SPECS]
    for name in SPECS:
        assert mujoco.MjModel.from_xml_path(str(tmp_path / "mjcf" / name)).nu in (1, 4)


def test_the_program_names_a_bad_model_and_exits_with_2(tmp_path, capsys):
    (tmp_path / "model.json").write_text("{")
    assert run(main, [str(tmp_path / "model.json"), "--out", str(tmp_path / "mjcf")]) == 2
    assert "model.json, line 1" in capsys.readouterr().err
