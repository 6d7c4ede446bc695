"""Success in the dodge: planning with an estimate beats a script, and harder is harder for all."""

import pytest

from mecanum_env.tankendo.constants import DIFFICULTIES


@pytest.fixture(scope="module")
def shares(successes):
    """Return the share of successes by controller and level."""
    numbers = {"sidestep": 40, "mpc": 20}
    return {
        name: [successes(name, n, difficulty=level) for level in DIFFICULTIES] for name, n in numbers.items()
    }


@pytest.mark.parametrize("name", ["sidestep", "mpc"])
def test_harder_is_harder(shares, name):
    easy, normal, hard = shares[name]
    assert easy >= normal - 0.05
    assert normal >= hard


def test_planning_beats_the_script(shares):
    assert shares["mpc"][1] >= 0.85
    assert shares["mpc"][2] >= shares["sidestep"][2] + 0.15
