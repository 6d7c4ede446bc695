"""Which sizes of an effect are simulated first, to see what it does to these logs."""

import pytest

from mecanum_env.effects import CATALOGUE
from mecanum_env.model import paper_model
from sysid.gap.search.responses import _trials

MODEL = paper_model()


@pytest.mark.parametrize(("name", "parameter"), [("weak_servo", "servo_n_m_s_rad"), ("low_grip", "friction")])
def test_what_can_only_get_much_worse_is_looked_at_worse(name: str, parameter: str) -> None:
    (first, *_) = _trials(MODEL, CATALOGUE[name], 0.15, 1.0)
    chosen, place, _, _ = first
    assert chosen.model(MODEL, place).effects[name][parameter] < getattr(MODEL.robot, parameter)


@pytest.mark.parametrize("name", [name for name, effect in CATALOGUE.items() if effect.acts_in("rollers")])
def test_every_size_that_is_looked_at_changes_the_model_and_is_within_bounds(name: str) -> None:
    for chosen, place, _, size in _trials(MODEL, CATALOGUE[name], 0.15, 1.0):
        assert ((place >= 0.0) & (place <= 1.0)).all()
        assert size > 0.0
        assert chosen.model(MODEL, place) != MODEL
