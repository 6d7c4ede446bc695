"""The sizes of an effect that are simulated to measure its response."""

import numpy as np
import pytest

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.scale import REFERENCE
from mecanum_env.model import paper_model
from mecanum_env.simulator import replay_bench
from sysid.compare.least_squares import Fitted
from sysid.compare.search_space import EffectSet, effect_set
from sysid.gap.search.known_effects import known_effects
from sysid.gap.search.responses import Response, _trials, growths
from sysid.gap.search.sets import EMPTY

MODEL = paper_model()


@pytest.mark.parametrize(("name", "parameter"), [("weak_servo", "servo_n_m_s_rad"), ("low_grip", "friction")])
def test_a_parameter_that_can_mostly_fall_is_tried_lower(name: str, parameter: str) -> None:
    (first, *_) = _trials(MODEL, CATALOGUE[name], 0.15, REFERENCE)
    chosen, place, _, _ = first
    assert chosen.model(MODEL, place).effects[name][parameter] < getattr(MODEL.robot, parameter)


@pytest.mark.parametrize("name", [name for name, effect in CATALOGUE.items() if effect.acts_in("rollers")])
def test_every_size_changes_the_model_and_is_within_bounds(name: str) -> None:
    for chosen, place, _, size in _trials(MODEL, CATALOGUE[name], 0.15, REFERENCE):
        assert ((place >= 0.0) & (place <= 1.0)).all()
        assert size > 0.0
        assert chosen.model(MODEL, place) != MODEL


def test_a_ripple_is_tried_at_a_given_frequency_with_the_phase_left_open() -> None:
    trials = _trials(MODEL, CATALOGUE["encoder_eccentricity"], 0.15, REFERENCE, 7)
    values = [chosen.model(MODEL, place).effects["encoder_eccentricity"] for chosen, place, _, _ in trials]
    assert values
    assert all(one["per_turn"] == 7.0 and "phase_deg" not in one for one in values)


def test_a_limit_is_tried_with_a_brake_of_its_own_and_without() -> None:
    trials = _trials(MODEL, CATALOGUE["acceleration_limit"], 0.15, REFERENCE)
    values = [chosen.model(MODEL, place).effects["acceleration_limit"] for chosen, place, _, _ in trials]
    ratios = {round(one["brake_rpm_s"] / one["limit_rpm_s"], 6) for one in values if "brake_rpm_s" in one}
    assert ratios == {0.5, 2.0}
    assert any("brake_rpm_s" not in one for one in values)


def test_a_map_is_searched_from_a_straight_line() -> None:
    commands = np.linspace(-REFERENCE.top_rpm, REFERENCE.top_rpm, 31)
    straight = effect_set(MODEL, ["static_map"])
    model = straight.model(MODEL, straight.start())
    time = np.arange(commands.size) * 0.2
    there = replay_bench(model, time, commands)
    np.testing.assert_allclose(there, replay_bench(MODEL, time, commands), atol=1e-9)
    assert {coordinate.parameter for coordinate in straight.coordinates} == {
        f"value_{i}_rpm" for i in range(1, 6)
    }


def test_what_is_random_or_the_same_as_another_form_is_not_tried():
    for effects in (known_effects("bench"), known_effects("robot"), known_effects("robot", "planar")):
        assert not {"command_latency/jitter", "command_loss"} & set(effects)
    assert "sensor_latency/wheels" not in known_effects("bench")
    assert "sensor_latency/wheels" in known_effects("robot")


def test_a_softer_drive_is_no_news_on_the_bench_where_only_its_friction_shows() -> None:
    assert "weak_servo" not in known_effects("bench")
    assert "weak_servo" in known_effects("robot")


@pytest.mark.parametrize(("wary", "moved"), [(False, 2), (True, 1)])
def test_two_limits_of_which_either_may_hide_the_other_are_not_added_up_for_a_little_more(
    wary: bool, moved: int
) -> None:
    both = effect_set(MODEL, ["body_speed_limit"])
    rest = np.array([-10.0, -2.0, 0.0])
    library = [
        Response(EffectSet(both.names, (one,), both.fixed), np.array([0.5]), change, False, 0.5)
        for one, change in zip(both.coordinates, np.diag([10.0, 2.0, 0.0])[:2], strict=True)
    ]
    parent = Fitted(EMPTY, np.zeros(0), rest, np.zeros((3, 0)))
    (grown,) = growths(MODEL, parent, library, wary=wary)
    assert np.count_nonzero(grown.place != grown.candidate.start()) == moved
