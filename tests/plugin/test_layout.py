"""From `model.json` to the numeric fields that the plugin reads, in a spec and in a compiled model."""

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.plugin.layout import (
    NO_TORQUE_LIMIT,
    USER_SIZE,
    require_valid,
    seed_links,
    state_slice,
    wheel_actuators,
    write_parameters,
)
from mecanum_env.wheel_drive.parameters import USER

FIELDS = ("actuator_dynprm", "actuator_biasprm", "actuator_user")


def values() -> dict[str, float]:
    return {
        "delay_s": 0.04,
        "command_period_s": 0.05,
        "command_quantum_rpm": 0.5,
        "saturation_rpm": 90.0,
        "servo_n_m_s_rad": 3.0,
        "servo_integral_n_m_rad": 7.0,
        "torque_limit_n_m": 2.0,
    }


def test_every_parameter_has_its_place(compile_wheels, free_model, paper):
    mjmodel = compile_wheels(free_model(**values()))
    law = paper.wheel.law
    np.testing.assert_array_equal(
        mjmodel.actuator_dynprm[0], [*law.coefficients, law.sample_period_s, 0.05, 0.5, 90.0]
    )
    np.testing.assert_array_equal(mjmodel.actuator_biasprm[0, :3], [0.0, 0.0, -3.0])
    np.testing.assert_array_equal(mjmodel.actuator_user[0], [7.0, 0.04, 2.0, *np.zeros(USER_SIZE - 3)])
    assert not mjmodel.actuator_forcelimited[0]  # the plugin limits, not MuJoCo


def test_rewriting_a_compiled_model_equals_compiling_anew(compile_wheels, free_model):
    rewritten, anew = compile_wheels(free_model(), n=2), compile_wheels(free_model(**values()), n=2)
    for actuator in wheel_actuators(rewritten):
        write_parameters(rewritten, actuator, free_model(**values()))
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(rewritten, name), getattr(anew, name))


def test_no_saturation_and_no_rounding_are_written_as_zero(compile_wheels, free_model):
    mjmodel = compile_wheels(free_model(saturation_rpm=np.inf))
    write_parameters(mjmodel, 0, free_model(saturation_rpm=np.inf), quantum_rpm=0.0)
    np.testing.assert_array_equal(mjmodel.actuator_dynprm[0, 8:], 0.0)


def test_no_torque_limit_is_written_as_a_number_that_files_can_hold(compile_wheels, free_model):
    mjmodel = compile_wheels(free_model())
    write_parameters(mjmodel, 0, free_model(), torque_limit_n_m=np.inf)
    assert mjmodel.actuator_user[0, USER.index("torque_limit_n_m")] == NO_TORQUE_LIMIT
    require_valid(mjmodel)


@pytest.mark.parametrize("limit", [0.0, -1.0, np.nan])
def test_an_impossible_torque_limit_is_refused(compile_wheels, free_model, limit):
    mjmodel = compile_wheels(free_model())
    with pytest.raises(InputError, match="torque_limit_n_m"):
        write_parameters(mjmodel, 0, free_model(), torque_limit_n_m=limit)


def test_a_wheel_with_a_law_of_its_own(compile_wheels, paper, stable_law):
    own = stable_law(np.random.default_rng(2))
    mjmodel = compile_wheels(paper, n=2)
    model = replace(paper, wheels={"fr": own})
    write_parameters(mjmodel, 0, model, "fl")
    write_parameters(mjmodel, 1, model, "fr")
    np.testing.assert_array_equal(mjmodel.actuator_dynprm[0, :6], paper.wheel.law.coefficients)
    np.testing.assert_array_equal(mjmodel.actuator_dynprm[1, :6], own.coefficients)


def test_other_actuators_are_not_wheel_drives(wheels_spec, free_model):
    spec = wheels_spec(free_model())
    spec.add_actuator(name="other", target="wheel_0").trntype = spec.actuators[0].trntype
    mjmodel = spec.compile()
    assert wheel_actuators(mjmodel) == [0]
    with pytest.raises(InputError, match=r"actuator 1 is not .*these are: \[0\]"):
        state_slice(mjmodel, 1)


def test_the_seed_of_the_link_outlasts_new_parameters(compile_wheels, free_model):
    mjmodel = compile_wheels(free_model(**values()))
    seed_links(mjmodel, 2**53 - 1)
    write_parameters(mjmodel, 0, free_model(**values() | {"saturation_rpm": 70.0}))
    assert mjmodel.actuator_user[0, USER.index("link_seed")] == 2**53 - 1
