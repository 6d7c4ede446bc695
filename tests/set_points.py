"""Random effects between command and wheel law, for tests that compare implementations of the drive."""

from hypothesis import strategies as st

from mecanum_env.model import cause_of

SET_POINT_EFFECTS = {
    "command_deadband": {"threshold_rpm": st.floats(0.0, 60.0)},
    "command_deadband/subtract": {"threshold_rpm": st.floats(0.0, 60.0)},
    "speed_gain": {"gain": st.floats(0.5, 1.5)},
    "direction_asymmetry": {"reverse_ratio": st.floats(0.5, 1.5)},
    "battery_sag": {"drop_per_s": st.floats(0.0, 2.0)},
    "warm_up": {"share": st.floats(-0.9, 0.9), "time_constant_s": st.floats(0.01, 10.0)},
    "speed_saturation": {"limit_rpm": st.floats(10.0, 150.0), "softness_rpm": st.floats(0.0, 200.0)},
    "acceleration_limit": {"limit_rpm_s": st.floats(10.0, 1e5)},
}
"""Effect -> strategies for its parameters."""


def one_form_each(effects):
    """Return the effects without all forms of a cause but the last."""
    last = {cause_of(name): name for name in effects}
    return {name: values for name, values in effects.items() if last[cause_of(name)] == name}


def some_of(effects):
    """Return a strategy for any of the effects, given as SET_POINT_EFFECTS, in one form of each cause."""
    optional = {name: st.fixed_dictionaries(values) for name, values in effects.items()}
    return st.fixed_dictionaries({}, optional=optional).map(one_form_each)
