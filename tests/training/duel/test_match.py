"""Matches of two controllers, and what the command prints."""

import pytest

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from training.duel.__main__ import main
from training.duel.match import play_match, player_factory


def test_a_player_against_itself_wins_as_often_as_it_loses():
    # Each seed is fought from both sides, so this is exact.
    result = play_match(player_factory("sidestep"), player_factory("sidestep"), 4)
    assert (result.won, result.points) == (result.lost, result.points_against)


def test_who_never_moves_loses_to_who_steps_aside():
    result = play_match(player_factory("still"), player_factory("sidestep"), 4)
    assert result.lost > result.won


def test_exchanged_players_exchange_the_result():
    one = play_match(player_factory("retreat"), player_factory("sidestep"), 4)
    other = play_match(player_factory("sidestep"), player_factory("retreat"), 4)
    assert (one.won, one.lost, one.points) == (other.lost, other.won, other.points_against)


def test_the_bundled_policy_fights_too():
    assert play_match(player_factory("policy"), player_factory("still"), 2).bouts == 2


def test_the_oracle_is_refused_since_it_needs_the_simulator():
    with pytest.raises(InputError, match="oracle"):
        player_factory("oracle")


def test_the_command_prints_shares_with_intervals(capsys):
    assert run(main, ["still", "retreat", "--episodes", "2"], "duel") == 0
    assert "B retreat  1.00 (0.34 .. 1.00)" in capsys.readouterr().out
