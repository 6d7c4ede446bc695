from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mecanum_env.errors import InputError
from mecanum_env.mjcf import bench_spec, planar_spec, robot_spec
from mecanum_env.mjcf.geometry import wheel_geometry
from mecanum_env.mjcf.masses import robot_masses, surely_possible
from mecanum_env.mjcf.physics import wheel_inertia
from mecanum_env.mjcf.plants import wheel_armature
from mecanum_env.model import Robot, paper_model


def mass_matrix(mj_model):
    data = mujoco.MjData(mj_model)
    mujoco.mj_forward(mj_model, data)
    full = np.zeros((mj_model.nv, mj_model.nv))
    mujoco.mj_fullM(mj_model, data, full)
    return data, full


@settings(max_examples=15, deadline=None)
@given(
    st.floats(0.01, 0.2), st.floats(0.03, 0.5), st.floats(0.03, 0.5), st.floats(0.05, 200), st.integers(4, 16)
)
def test_the_compiled_robot_has_the_mass_and_yaw_inertia_of_the_model(radius, a, b, mass, rollers):
    robot = Robot(radius, a, b, mass, yaw_inertia_kg_m2=mass * 0.5 * (a**2 + b**2 + radius**2))
    robot = replace(robot, rollers_per_wheel=rollers)
    compiled = robot_spec(replace(paper_model(), robot=robot), visuals=False).compile()
    data, full = mass_matrix(compiled)
    assert compiled.body("base").subtreemass[0] == pytest.approx(mass, rel=1e-12)
    assert full[0, 0] == pytest.approx(mass, rel=1e-12)
    assert full[5, 5] == pytest.approx(robot.yaw_inertia_kg_m2, rel=1e-9)
    np.testing.assert_allclose(data.subtree_com[compiled.body("base").id][:2], 0.0, atol=1e-12)


def test_the_packaged_robot_has_the_mass_and_yaw_inertia_of_its_file(rollers, packaged):
    _, full = mass_matrix(rollers)
    assert full[0, 0] == pytest.approx(packaged.robot.mass_kg, rel=1e-12)
    assert full[5, 5] == pytest.approx(packaged.robot.yaw_inertia_kg_m2, rel=1e-9)


def test_what_is_seen_does_not_weigh(packaged, rollers):
    bare = robot_spec(packaged, visuals=False).compile()
    assert bare.ngeom < rollers.ngeom
    np.testing.assert_array_equal(bare.body_mass, rollers.body_mass)
    np.testing.assert_array_equal(bare.body_inertia, rollers.body_inertia)


def test_wheels_heavier_than_the_yaw_inertia_are_refused(packaged):
    robot = replace(packaged.robot, yaw_inertia_kg_m2=0.2)
    with pytest.raises(InputError, match=r"yaw_inertia_kg_m2 = 0\.2 is less than"):
        robot_spec(replace(packaged, robot=robot))


def test_the_bench_wheel_turns_like_the_wheels_on_the_robot(packaged, rollers):
    """With its rollers held still, a wheel on the robot has the moment of inertia of the one on the bench."""
    bench = mass_matrix(bench_spec(packaged).compile())[1][0, 0]
    _, full = mass_matrix(rollers)
    dof = rollers.joint("wheel_rl").dofadr[0]
    assert full[dof, dof] == pytest.approx(bench, rel=1e-9)
    geometry = wheel_geometry(packaged.robot.wheel_radius_m, packaged.robot.rollers_per_wheel)
    assert bench == pytest.approx(robot_masses(packaged.robot).wheel_spin_inertia(geometry), rel=1e-9)


def test_the_planar_plant_carries_the_wheels_inertia_as_armature(packaged):
    robot = packaged.robot
    _, full = mass_matrix(planar_spec(packaged).compile())
    translation, rotation = wheel_armature(robot)
    np.testing.assert_allclose(
        np.diag(full), np.add([robot.mass_kg] * 2 + [robot.yaw_inertia_kg_m2], [translation] * 2 + [rotation])
    )
    # 4 J / R^2 forward and 4 J k^2 / R^2 in yaw, but for what the rollers give.
    geometry = wheel_geometry(robot.wheel_radius_m, robot.rollers_per_wheel)
    spin = robot_masses(robot).wheel_spin_inertia(geometry)
    k = robot.half_wheelbase_m + robot.half_track_m
    assert translation == pytest.approx(4 * spin / robot.wheel_radius_m**2, rel=0.02)
    assert rotation == pytest.approx(4 * spin * k**2 / robot.wheel_radius_m**2, rel=0.02)


@pytest.mark.parametrize("mass_kg", [2.0, 20.0, 300.0])
def test_what_is_surely_possible_is_not_refused(mass_kg):
    robot = Robot(mass_kg=mass_kg, yaw_inertia_kg_m2=0.1 * mass_kg)
    least = robot.yaw_inertia_kg_m2 - robot_masses(robot).base.moments[2]
    above, below = (replace(robot, yaw_inertia_kg_m2=share * least) for share in (1 + 1e-6, 1 - 1e-6))
    assert surely_possible(above)
    assert robot_masses(above).base.moments[2] > 0.0
    assert not surely_possible(below)
    with pytest.raises(InputError, match="less than the wheels alone"):
        wheel_inertia(below)
