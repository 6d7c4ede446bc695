"""The geometry of each technique: where the tip is, what hits and what misses."""

import numpy as np
import pytest

from mecanum_env.mjcf.chassis import SWORD_M
from mecanum_env.tankendo.constants import DIFFICULTIES, GUARD_TIP_M, TECHNIQUES, Rules, opponent_for
from mecanum_env.tankendo.fighter import strike_margin
from mecanum_env.tankendo.sword import GUARD_HEIGHT_M, StrikeTimes, Sword

NAMES = [technique.name for technique in TECHNIQUES]


def strike(technique, length=1.8, warning=0.5):
    """Return a sword that rises at 1 s and strikes along x, from an opponent at the origin."""
    sword = Sword(1)
    sword.raise_s[:], sword.cut_s[:] = 1.0, 1.0 + warning - technique.swing_s
    sword.land_s[:], sword.free_s[:] = 1.0 + warning, 1.0 + warning + 0.7
    sword.raised_m[:], sword.raised_height_m[:] = technique.raised_tip_m, technique.raised_height_m
    sword.end_height_m[:], sword.end[:, 0] = technique.target_height_m, (length, 0.1)
    sword.is_feint[:] = False
    return sword


def tip_at(sword, seconds):
    """Return the tip of an opponent that stands at the origin, looking along x."""
    return np.array(sword.tip(float(seconds), (0.0, 0.0), (1.0, 0.0)))


def test_at_maai_the_tips_meet_without_crossing():
    assert Rules().maai_m == 2 * GUARD_TIP_M
    assert pytest.approx(0.53) == SWORD_M


def test_the_four_targets_and_published_speeds():
    assert NAMES == ["do", "nodo", "men", "kote"]
    assert all(0.09 <= technique.swing_s <= 0.15 for technique in TECHNIQUES)
    assert opponent_for("normal").warning_s == (0.44, 0.58)


@pytest.mark.parametrize("technique", TECHNIQUES, ids=NAMES)
def test_the_tip_goes_from_guard_back_forward_and_to_guard(technique):
    sword = strike(technique)
    guard = (GUARD_TIP_M, 0.0, GUARD_HEIGHT_M)
    np.testing.assert_allclose(tip_at(sword, 0.9), guard)
    np.testing.assert_allclose(
        tip_at(sword, float(sword.cut_s[0])), (technique.raised_tip_m, 0.0, technique.raised_height_m)
    )
    np.testing.assert_allclose(tip_at(sword, float(sword.land_s[0])), (1.8, 0.1, technique.target_height_m))
    np.testing.assert_allclose(tip_at(sword, float(sword.free_s[0])), guard, atol=1e-12)
    # Nowhere does it jump.
    times = np.arange(0.9, 2.5, 1e-4)
    path = np.array([tip_at(sword, t) for t in times])
    assert np.max(np.abs(np.diff(path, axis=0))) < 0.01


def test_how_the_tip_draws_back_tells_the_technique():
    drawn = {t.name: np.array([t.raised_tip_m, t.raised_height_m]) for t in TECHNIQUES}
    guard = np.array([GUARD_TIP_M, GUARD_HEIGHT_M])
    places = [*drawn.values(), guard]
    nearest = min(np.linalg.norm(a - b) for i, a in enumerate(places) for b in places[:i])
    assert nearest > 10 * 0.01  # ten times the sensors' noise


def test_a_feint_rises_and_sinks_only():
    sword = strike(TECHNIQUES[2])
    sword.is_feint[:] = True
    sword.land_s[:] = sword.cut_s
    ahead = [tip_at(sword, t)[0] for t in np.arange(0.9, 2.5, 0.01)]
    assert max(ahead) <= GUARD_TIP_M + 1e-12
    assert tip_at(sword, float(sword.cut_s[0]))[2] == pytest.approx(TECHNIQUES[2].raised_height_m)
    assert not any(sword.step_share(float(t)) for t in np.arange(0.9, 2.5, 0.1))


def test_the_tips_velocity_is_the_change_of_its_place():
    sword = strike(TECHNIQUES[0])
    now = float(sword.cut_s[0]) + 0.05
    _, velocity = sword.tip_and_velocity(now, [0.0] * 11)
    np.testing.assert_allclose(velocity, (tip_at(sword, now) - tip_at(sword, now - 0.01)) / 0.01)


@pytest.mark.parametrize("technique", TECHNIQUES, ids=NAMES)
@pytest.mark.parametrize("angle", [0.0, 2.0])
def test_what_a_strike_hits(technique, angle):
    """Width, depth and blade of each technique, along any direction."""
    cos, sin = np.cos(angle), np.sin(angle)
    along = 1.8 * np.array([[cos], [sin]])

    def hits(behind, across):
        target = np.array([[behind * cos - across * sin], [behind * sin + across * cos]])
        return bool(
            strike_margin(
                target,
                along,
                width_m=np.array([technique.width_m]),
                depth_m=np.array([technique.depth_m]),
                blade_m=np.array([technique.blade_m]),
            )[0]
            <= 0.0
        )

    hair = 1e-6
    assert hits(0.0, 0.0)
    for side in (-1, 1):
        assert hits(0.0, side * (technique.width_m / 2 - hair))
        assert not hits(0.0, side * (technique.width_m / 2 + hair))
    assert hits(technique.depth_m - hair, 0.0)
    assert not hits(technique.depth_m + hair, 0.0)
    assert hits(-technique.blade_m + hair, 0.0)
    assert not hits(-technique.blade_m - hair, 0.0)


def test_a_thrust_hits_all_along_and_a_cut_with_the_end_of_the_blade_only():
    assert [t.blade_m > SWORD_M for t in TECHNIQUES] == [True, True, False, False]


def test_levels_differ_in_one_direction():
    easy, normal, hard = (opponent_for(name) for name in DIFFICULTIES)
    for name, sign in (("sight_delay_s", -1), ("extra_reach_m", 1), ("feint_probability", 1), ("lead", 1)):
        a, b, c = (sign * getattr(level, name) for level in (easy, normal, hard))
        assert a <= b <= c
    assert easy.warning_s > normal.warning_s > hard.warning_s


@pytest.mark.parametrize("is_feint", [False, True])
def test_an_estimator_finds_the_simulators_tip_in_the_shares_of_the_phases(is_feint):
    sword = strike(TECHNIQUES[1])
    sword.is_feint[:] = is_feint
    if is_feint:
        sword.land_s[:] = sword.cut_s
    times = StrikeTimes(sword.raise_s, sword.cut_s, sword.land_s, sword.free_s, sword.is_feint)
    for seconds in np.arange(0.9, 2.5, 0.01):
        shares, tip = times.shares(seconds), tip_at(sword, seconds)
        assert shares.height(sword.raised_height_m, sword.end_height_m)[0] == tip[2]
        if is_feint or seconds <= sword.cut_s[0]:
            drawn = shares.ahead(sword.raised_m)
            assert shares.place(drawn, drawn, GUARD_TIP_M)[0] == pytest.approx(tip[0], abs=1e-12)
        assert times.step_share(seconds)[0] == sword.step_share(float(seconds))
