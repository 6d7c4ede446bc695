"""The sizes of an effect that are simulated to measure its response."""

import pytest

from mecanum_env.effects import CATALOGUE
from mecanum_env.model import paper_model
from sysid.gap.search.data import known_effects
from sysid.gap.search.responses import _trials

MODEL = paper_model()


@pytest.mark.parametrize(("name", "parameter"), [("weak_servo", "servo_n_m_s_rad"), ("low_grip", "friction")])
def test_a_parameter_that_can_mostly_fall_is_tried_lower(name: str, parameter: str) -> None:
    (first, *_) = _trials(MODEL, CATALOGUE[name], 0.15, 1.0)
    chosen, place, _, _ = first
    assert chosen.model(MODEL, place).effects[name][parameter] < getattr(MODEL.robot, parameter)


@pytest.mark.parametrize("name", [name for name, effect in CATALOGUE.items() if effect.acts_in("rollers")])
def test_every_size_changes_the_model_and_is_within_bounds(name: str) -> None:
    for chosen, place, _, size in _trials(MODEL, CATALOGUE[name], 0.15, 1.0):
        assert ((place >= 0.0) & (place <= 1.0)).all()
        assert size > 0.0
        assert chosen.model(MODEL, place) != MODEL


def test_a_ripple_is_tried_with_sine_and_cosine_at_every_frequency() -> None:
    trials = _trials(MODEL, CATALOGUE["encoder_eccentricity"], 0.15, 1.0)
    values = [chosen.model(MODEL, place).effects["encoder_eccentricity"] for chosen, place, _, _ in trials]
    tried = {(round(one["per_turn"]), round(one["phase_deg"])) for one in values}
    per_turn = CATALOGUE["encoder_eccentricity"].parameters[0]
    assert tried == {(turns, phase) for turns in per_turn.scan or () for phase in (0, 90)}
    assert len(trials) == len(tried)


def test_an_effect_that_is_not_searched_is_not_tried():
    left = {name for name, effect in CATALOGUE.items() if not effect.searched}
    assert "static_map" in left
    assert not left & {*known_effects("bench"), *known_effects("robot"), *known_effects("robot", "planar")}
