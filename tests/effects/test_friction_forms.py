"""How a drive answers friction: with a loss, late, or with a loss that integral action washes out."""

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.effects.apply import changed_model, drive_parameters
from mecanum_env.effects.friction import droop_rpm, stiffness_is_known
from mecanum_env.errors import InputError
from mecanum_env.mjcf import bench_spec, planar_spec, robot_spec
from mecanum_env.plugin.layout import write_parameters
from mecanum_env.simulator import BodyCommands, drive, replay_bench
from mecanum_env.units import RAD_S_PER_RPM

TIME = np.arange(0.0, 4.0, 1 / 480)
START = np.full(TIME.shape, 60.0)
FRICTIONS = {
    "coulomb_friction": {"torque_n_m": 1.0},
    "stiction": {"breakaway_n_m": 1.0, "stribeck_rpm": 1e5},
    "viscous_friction": {"damping_n_m_s_rad": 0.2},
}


def lost(model, base, command=START, **options):
    """Return the speed that an effect takes from the wheel [rpm], at each time."""
    return replay_bench(base, TIME, command, **options) - replay_bench(model, TIME, command, **options)


@pytest.mark.parametrize("name", FRICTIONS)
def test_the_loss_is_that_of_the_report(base, name):
    loss = lost(base.with_effect(name, **FRICTIONS[name]), base)[-1]
    assert droop_rpm(name, FRICTIONS[name], base, 60.0 - loss) == pytest.approx(loss, rel=1e-6)


def test_the_loss_of_a_weak_servo_is_larger(base):
    weak = base.with_effect("weak_servo", servo_n_m_s_rad=base.robot.servo_n_m_s_rad / 4)
    values = {"torque_n_m": 0.3}
    ratio = droop_rpm("coulomb_friction", values, weak) / droop_rpm("coulomb_friction", values, base)
    assert ratio == pytest.approx(4.0)


@pytest.mark.parametrize("name", FRICTIONS)
def test_a_late_answer_ends_in_the_same_loss(base, name):
    prompt, late = (
        lost(base.with_effect(name, **FRICTIONS[name], answer_s=answer), base) for answer in (0.0, 0.1)
    )
    assert late[-1] == pytest.approx(prompt[-1], rel=1e-3)
    assert late[24] < 0.7 * prompt[24]


def test_the_answer_to_a_load_is_a_first_order_lag(base):
    """Friction that acts at once on a turning wheel: the loss grows as 1 - exp(-t / answer)."""
    model = base.with_effect("coulomb_friction", torque_n_m=1.0, answer_s=0.1)
    loss = lost(model, base, initial_rpm=60.0)
    full = droop_rpm("coulomb_friction", {"torque_n_m": 1.0}, base)
    np.testing.assert_allclose(loss, full * (1 - np.exp(-TIME / 0.1)), atol=0.02 * full)


def test_a_late_answer_does_not_delay_the_setpoint(base):
    model = base.with_effect("coulomb_friction", torque_n_m=1e-9, answer_s=0.2)
    np.testing.assert_allclose(lost(model, base), 0.0, atol=1e-6)


def test_integral_action_washes_the_loss_out(base):
    model = base.with_effect("coulomb_friction", "washed_out", torque_n_m=1.0, washout_s=0.5)
    loss = lost(model, base, initial_rpm=60.0)
    full = droop_rpm("coulomb_friction", {"torque_n_m": 1.0}, base)
    late = TIME > 0.02
    np.testing.assert_allclose(loss[late], full * np.exp(-TIME[late] / 0.5), atol=0.02 * full)


@pytest.mark.parametrize("name", FRICTIONS)
def test_a_drive_with_integral_action_reaches_its_speed(base, name):
    model = base.with_effect(name, "washed_out", **FRICTIONS[name], washout_s=0.3, answer_s=0.05)
    loss = lost(model, base)
    assert np.max(loss) > 1.0
    assert abs(loss[-1]) < 0.02


def test_friction_that_is_washed_out_holds_a_wheel_until_the_integral_has_grown(base):
    model = base.with_effect("coulomb_friction", "washed_out", torque_n_m=1.0, washout_s=0.5)
    speed = replay_bench(model, TIME, np.full(TIME.shape, 1.0))
    # 1 rpm of error asks for 0.52 N m at once, and for 1 N m after half a second.
    assert np.max(np.abs(speed[TIME < 0.35])) < 1e-6
    assert speed[-1] == pytest.approx(1.0, abs=0.1)


def test_of_several_frictions_the_longest_answer_and_the_strongest_integral_count(base):
    model = base.with_effect("coulomb_friction", "washed_out", torque_n_m=0.1, washout_s=0.5, answer_s=0.1)
    model = model.with_effect("stiction", "washed_out", breakaway_n_m=0.1, washout_s=0.2, answer_s=0.05)
    changed = changed_model(model, "bench")
    assert changed.robot.servo_integral_n_m_rad == base.robot.servo_n_m_s_rad / 0.2
    assert changed_model(changed, "bench") == changed
    armature = bench_spec(model).compile().dof_armature
    np.testing.assert_allclose(armature, base.robot.servo_n_m_s_rad * 0.1)


def test_the_stiffness_that_answers_is_that_of_a_weak_servo(base):
    model = base.with_effect("weak_servo", servo_n_m_s_rad=0.5).with_effect(
        "coulomb_friction", "washed_out", torque_n_m=0.1, washout_s=0.5
    )
    assert changed_model(model, "bench").robot.servo_integral_n_m_rad == 1.0


@pytest.mark.parametrize("spec", [robot_spec, planar_spec])
def test_on_the_robot_the_drives_have_rotors(base, spec):
    model = base.with_effect("coulomb_friction", torque_n_m=0.1, answer_s=0.1)
    late, plain = (spec(m).compile().dof_armature for m in (model, base))
    assert np.count_nonzero(late > plain) == (3 if spec is planar_spec else 4)


@pytest.mark.parametrize("plant", ["rollers", "planar"])
def test_on_the_robot_a_late_answer_ends_in_the_same_speed(base, plant):
    models = [base.with_effect("coulomb_friction", torque_n_m=0.5, answer_s=answer) for answer in (0.05, 0.0)]
    paths = [drive(model, BodyCommands.constant(60), 1.5, plant=plant) for model in models]
    ends = [path.wheels_rpm[-200:].mean() for path in paths]
    assert ends[0] == pytest.approx(ends[1], abs=0.1)


def test_a_rotor_cannot_be_written_into_a_compiled_model(base):
    with pytest.raises(InputError, match="compile the model anew"):
        write_parameters(
            bench_spec(base).compile(), 0, base.with_effect("coulomb_friction", torque_n_m=0.1, answer_s=0.1)
        )


@pytest.mark.parametrize("name", FRICTIONS)
def test_warming_up_takes_its_share_of_each_friction(base, name):
    rubbing = base.with_effect(name, **FRICTIONS[name])
    model = rubbing.with_effect("warm_up", "friction", share=0.6, time_constant_s=0.5)
    cold, warming = lost(rubbing, base), lost(model, base)
    settled = TIME > 0.5
    expected = cold[settled] * (1 - 0.6 * (1 - np.exp(-TIME[settled] / 0.5)))
    # A slower wheel has less viscous friction, too.
    np.testing.assert_allclose(warming[settled], expected, rtol=0.05)


@pytest.mark.parametrize("name", FRICTIONS)
def test_a_cold_bearing_has_more_of_each_friction(base, name):
    rubbing = base.with_effect(name, **FRICTIONS[name])
    own = next(iter(FRICTIONS[name].values()))
    more = {"damping_n_m_s_rad" if name == "viscous_friction" else "torque_n_m": 0.5 * own}
    model = rubbing.with_effect("warm_up", "cold_friction", **more, time_constant_s=0.5)
    warm, warming = lost(rubbing, base), lost(model, base)
    settled = TIME > 0.5
    expected = warm[settled] * (1 + 0.5 * np.exp(-TIME[settled] / 0.5))
    # A slower wheel has less viscous friction, too.
    np.testing.assert_allclose(warming[settled], expected, rtol=0.05)


@pytest.mark.parametrize("stuck", [{}, {"stiction": {"breakaway_n_m": 0.3}}])
@pytest.mark.parametrize("rubs", [{}, {"coulomb_friction": {"torque_n_m": 0.1}}])
def test_a_warm_bearing_has_the_frictions_of_the_model_again(base, rubs, stuck):
    warm = replace(base, effects={**rubs, **stuck, "viscous_friction": {"damping_n_m_s_rad": 0.02}})
    more = {"torque_n_m": 0.2, "damping_n_m_s_rad": 0.05}
    own, cold = (drive_parameters(m).load for m in (warm, warm.with_effect("warm_up/cold_friction", **more)))
    dry, damp = 1.0 - cold.friction_warm_share, 1.0 - cold.viscous_warm_share
    found = (dry * cold.coulomb_n_m, dry * cold.breakaway_n_m, damp * cold.viscous_n_m_s_rad)
    assert found == pytest.approx((own.coulomb_n_m, own.breakaway_n_m, own.viscous_n_m_s_rad), abs=1e-12)
    added = cold.coulomb_n_m + cold.breakaway_n_m - own.coulomb_n_m - own.breakaway_n_m
    assert added == pytest.approx(more["torque_n_m"])


def test_the_droop_of_a_cold_bearing_is_that_of_its_torque_and_its_damping(base):
    parts = {"coulomb_friction": {"torque_n_m": 0.2}, "viscous_friction": {"damping_n_m_s_rad": 0.05}}
    cold = {"torque_n_m": 0.2, "damping_n_m_s_rad": 0.05}
    droops = [droop_rpm(name, values, base, 60.0) for name, values in parts.items()]
    assert droop_rpm("warm_up/cold_friction", cold, base, 60.0) == pytest.approx(sum(droops))


@pytest.mark.parametrize("more", [{"torque_n_m": 0.2}, {"damping_n_m_s_rad": 0.02}])
def test_a_cold_bearing_has_friction_where_the_model_has_none(base, more):
    lasting = base.with_effect("coulomb_friction" if "torque_n_m" in more else "viscous_friction", **more)
    fading = base.with_effect("warm_up", "cold_friction", **more, time_constant_s=0.5)
    cold, warming = lost(lasting, base), lost(fading, base)
    settled = TIME > 0.5
    np.testing.assert_allclose(
        warming[settled], cold[settled] * np.exp(-TIME[settled] / 0.5), rtol=0.05, atol=0.02
    )


@pytest.mark.parametrize("plant", ["rollers", "planar"])
@pytest.mark.parametrize(
    ("name", "value", "ratio"),
    [("coulomb_friction", {"torque_n_m": 0.2}, 1.5), ("viscous_friction", {"damping_n_m_s_rad": 0.03}, 1.8)],
)
def test_on_the_robot_a_bearing_that_stays_cold_has_more_friction(base, plant, name, value, ratio):
    warm = base.with_effect(name, **value)
    more = {key: (ratio - 1.0) * size for key, size in value.items()}
    cold = warm.with_effect("warm_up", "cold_friction", **more, time_constant_s=1e4)
    none, loss, more = (
        drive(m, BodyCommands.constant(60), 2.0, plant=plant).wheels_rpm[-200:].mean()
        for m in (base, warm, cold)
    )
    assert (none - more) / (none - loss) == pytest.approx(ratio, abs=0.04)


@pytest.mark.parametrize("plant", ["rollers", "planar"])
@pytest.mark.parametrize("name", ["coulomb_friction", "viscous_friction"])
def test_on_the_robot_a_warm_bearing_loses_less(base, plant, name):
    cold = base.with_effect(name, **FRICTIONS[name])
    warm = cold.with_effect("warm_up", "friction", share=0.6, time_constant_s=0.1)
    none, loss, less = (
        drive(m, BodyCommands.constant(60), 2.0, plant=plant).wheels_rpm[-200:].mean()
        for m in (base, cold, warm)
    )
    assert (none - less) / (none - loss) == pytest.approx(0.4, abs=0.04)


def test_without_friction_nothing_warms_up(base):
    model = base.with_effect("warm_up", "friction", share=0.6, time_constant_s=0.5)
    np.testing.assert_array_equal(replay_bench(model, TIME, START), replay_bench(base, TIME, START))


def test_a_weaker_answer_than_the_models_own_integral_changes_nothing_of_it(base):
    own = replace(base, robot=replace(base.robot, servo_integral_n_m_rad=100.0))
    slow, first = (
        own.with_effect("coulomb_friction", form, torque_n_m=0.3, **more)
        for form, more in (("washed_out", {"washout_s": 3.0}), ("droop", {}))
    )
    np.testing.assert_array_equal(replay_bench(slow, TIME, START), replay_bench(first, TIME, START))


def test_droop_is_in_rpm_of_the_wheel(base):
    assert droop_rpm("coulomb_friction/washed_out", {"torque_n_m": 0.5}, base) == pytest.approx(
        0.5 / base.robot.servo_n_m_s_rad / RAD_S_PER_RPM
    )


def test_a_stiffness_is_known_if_a_model_states_one(base):
    assert not stiffness_is_known(base)
    assert stiffness_is_known(replace(base, robot=replace(base.robot, servo_n_m_s_rad=0.4)))
    assert stiffness_is_known(base.with_effect("weak_servo", servo_n_m_s_rad=1.0))
    assert stiffness_is_known(replace(base, uncertainty={"robot": {"servo_n_m_s_rad": 0.1}}))
