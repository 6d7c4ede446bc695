"""Descents from afar: the deepest of several valleys is found without descending into all of them."""

import numpy as np
import pytest

from sysid.compare.least_squares import descend_from_afar, descend_from_many

TRUE = np.array([0.31, 0.72])
STARTS = list(np.random.default_rng(0).random((12, 2)))


class Counted:
    """Residuals of a wave of unknown frequency and phase, whose squares have many valleys."""

    def __init__(self) -> None:
        self.places = 0

    def __call__(self, places: np.ndarray) -> np.ndarray:
        self.places += len(places)
        return self.wave(places) - self.wave(TRUE[None])

    @staticmethod
    def wave(places: np.ndarray) -> np.ndarray:
        time = np.linspace(0.0, 1.0, 80)
        frequency, phase = places[:, :1], places[:, 1:]
        return np.sin(40.0 * frequency * time + 6.0 * phase)


def test_the_deepest_valley_is_found_from_many_places() -> None:
    cost, place = descend_from_many(Counted(), STARTS)
    assert cost < 1e-12
    assert place == pytest.approx(TRUE, abs=1e-5)


def test_most_places_lead_into_other_valleys() -> None:
    costs = [descend_from_afar(Counted(), start, 1e-3, 30)[0] for start in STARTS]
    assert sum(cost > 1.0 for cost in costs) > len(STARTS) / 2


def test_descents_that_lead_nowhere_are_given_up() -> None:
    some, every = Counted(), Counted()
    descend_from_many(some, STARTS)
    for start in STARTS:
        descend_from_afar(every, start, 1e-3, 30)
    assert some.places < 0.7 * every.places
