"""A short version of the soak (`make soak`): memory stays, nothing warns."""

from tests import soak

MIB = 2**20


def test_many_episodes_keep_the_memory():
    assert soak.play(300, steps=3) < 16 * MIB


def test_random_driving_on_rollers_keeps_the_memory_and_warns_of_nothing():
    pieces, _, growth = soak.roam(0.1, piece_s=1.0)
    assert pieces == 6
    assert growth < 16 * MIB
