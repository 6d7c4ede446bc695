"""Random effects between command and wheel law, for tests that compare implementations of the drive."""

from hypothesis import strategies as st

from mecanum_env.model import cause_of
from mecanum_env.model.static_map import map_parameters

SPEEDS = st.floats(-120.0, 120.0)
BRAKES = st.just(0.0) | st.floats(10.0, 1e5)


@st.composite
def curves(draw, number=SPEEDS):
    """Return the parameters of a static map, mirrored or not."""
    knots = sorted(draw(st.lists(number, min_size=1, max_size=5, unique=True)))
    if draw(st.booleans()):
        knots = sorted({abs(knot) for knot in knots})
    elif knots[-1] < 0.0:
        knots.append(0.0)
    values = sorted(draw(number) for _ in knots)
    if knots[0] >= 0.0:
        values = sorted(abs(value) for value in values)
        values[0] = values[0] if knots[0] > 0.0 else 0.0
    return map_parameters(knots, values)


SET_POINT_EFFECTS = {
    "command_deadband": {"threshold_rpm": st.floats(0.0, 60.0)},
    "command_deadband/subtract": {"threshold_rpm": st.floats(0.0, 60.0)},
    "speed_gain": {"gain": st.floats(0.5, 1.5)},
    "direction_asymmetry": {"reverse_ratio": st.floats(0.5, 1.5)},
    "battery_sag": {"drop_per_s": st.floats(0.0, 2.0)},
    "battery_sag/voltage": {"per_volt": st.floats(0.0, 0.5)},
    "warm_up": {"share": st.floats(-0.9, 0.9), "time_constant_s": st.floats(0.01, 10.0)},
    "warm_up/cold": {"share": st.floats(-0.9, 0.49), "time_constant_s": st.floats(0.01, 10.0)},
    "static_map": curves(),
    "speed_saturation": {"limit_rpm": st.floats(10.0, 150.0), "softness_rpm": st.floats(0.0, 200.0)},
    "acceleration_limit": {"limit_rpm_s": st.floats(10.0, 1e5), "brake_rpm_s": BRAKES},
    "acceleration_limit/s_curve": {
        "limit_rpm_s": st.floats(10.0, 1e5),
        "jerk_rpm_s2": st.floats(100.0, 1e7),
        "brake_rpm_s": BRAKES,
    },
}
"""Effect -> strategies for its parameters, or one for all of them."""
LAW_EFFECTS = {
    "speed_saturation/supply": {"limit_rpm": st.floats(10.0, 150.0), "per_volt": st.floats(0.0, 0.5)},
    "acceleration_limit/drive": {"limit_rpm_s": st.floats(10.0, 1e5), "brake_rpm_s": BRAKES},
}
"""The same for effects that bound what the law does."""


def one_form_each(effects):
    """Return the effects without all forms of a cause but the last."""
    last = {cause_of(name): name for name in effects}
    return {name: values for name, values in effects.items() if last[cause_of(name)] == name}


def some_of(effects):
    """Return a strategy for any of the effects, given as SET_POINT_EFFECTS, in one form of each cause."""
    optional = {
        name: st.fixed_dictionaries(values) if isinstance(values, dict) else values
        for name, values in effects.items()
    }
    return st.fixed_dictionaries({}, optional=optional).map(one_form_each)
