"""Regions of the error: each sample lies in one region, and an error is found where it was added."""

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.kinematics import command_to_wheels
from sysid.gap.report.samples import HeldCommand, Samples
from sysid.gap.report.where import phases, regions
from sysid.gap.result import Region

TIME = np.arange(0.0, 6.0, 0.01)
CHANGES = np.array([0.5, 1.5, 2.5, 3.5, 4.5])
LEVELS = np.array([[40.0], [100.0], [-60.0], [-20.0], [0.0]])
BENCH = HeldCommand(CHANGES, LEVELS)


def bench(error: np.ndarray, **more: object) -> Samples:
    still = np.zeros(TIME.size)
    return Samples("speed_rpm", TIME, error, still, more.pop("after", still), BENCH, **more)


def robot(channel: str, error: np.ndarray, *commands: tuple[float, float, float], **more: object) -> Samples:
    changes = np.linspace(0.0, TIME[-1], len(commands) + 1)[:-1]
    wheels = HeldCommand(changes, command_to_wheels(*np.array(commands, float).T))
    return Samples(channel, TIME, error, np.zeros(TIME.size), np.zeros(TIME.size), wheels, **more)


def part(found: tuple[Region, ...], dimension: str, channel: str = "speed_rpm") -> dict[str, Region]:
    return {r.region: r for r in found if r.dimension == dimension and r.channel == channel}


def test_a_staircase_has_every_phase_in_order():
    names = phases(TIME, BENCH)
    order = names[np.concatenate([[True], names[1:] != names[:-1]])]
    assert list(order) == [
        "rest", "start", "steady", "rising", "steady", "reversal", "steady", "falling", "steady", "coasting",
        "rest",
    ]  # fmt: skip
    assert np.sum(names == "reversal") == pytest.approx(30, abs=1)


def test_a_pulse_shorter_than_the_settling_is_not_steady():
    pulse = HeldCommand(np.array([1.0, 1.1]), np.array([[50.0], [0.0]]))
    names = phases(TIME, pulse)
    assert set(names[(TIME > 1.11) & (TIME < 1.39)]) == {"coasting"}


def test_a_slow_ramp_in_small_steps_is_rising():
    times = np.arange(0.0, 5.0, 0.02)
    ramp = HeldCommand(times, 50.0 + 10.0 * times[:, None])
    assert set(phases(TIME[(TIME > 1.0) & (TIME < 4.9)], ramp)) == {"rising"}


def test_a_body_that_turns_round_reverses():
    there_and_back = HeldCommand(np.array([0.0, 3.0]), np.array([[50.0, 10.0, 0.0], [-50.0, 10.0, 0.0]]))
    names = phases(TIME, there_and_back)
    assert list(dict.fromkeys(names)) == ["start", "steady", "reversal", "steady"][:3]
    assert names[305] == "reversal"


def test_an_error_is_found_where_it_was_added():
    error = np.where((TIME >= 2.5) & (TIME < 2.8), 8.0, 0.1)
    found = regions([bench(error, after=error)])
    reversal = part(found, "phase")["reversal"]
    assert reversal.share > 0.99
    assert reversal.rms == pytest.approx(8.0)
    assert reversal.rms_after == 0.0
    assert part(found, "direction")["backward"].share > 0.99
    assert part(found, "speed")["40 .. 80 rpm"].share > 0.99
    assert part(found, "time")["middle"].share > 0.99


def test_shares_of_a_dimension_sum_to_one_and_the_largest_come_first():
    rng = np.random.default_rng(0)
    found = regions([bench(rng.standard_normal(TIME.size), battery_v=np.linspace(12.6, 11.1, TIME.size))])
    for dimension in {region.dimension for region in found}:
        pieces = part(found, dimension).values()
        assert sum(r.share for r in pieces) == pytest.approx(1.0)
        assert sum(r.samples for r in pieces) == TIME.size
    assert [r.share for r in found] == sorted((r.share for r in found), reverse=True)
    assert set(part(found, "battery")) == {"11.10 .. 11.60 V", "11.60 .. 12.10 V", "12.10 .. 12.60 V"}


def test_ties_are_broken_by_name():
    found = regions([bench(np.zeros(TIME.size))])
    assert [r.share for r in found] == [0.0] * len(found)
    assert [(r.dimension, r.region) for r in found] == sorted((r.dimension, r.region) for r in found)


def test_missing_samples_are_in_no_region():
    error = np.where(TIME < 2.0, np.nan, 1.0)
    found = regions([bench(error)])
    assert sum(r.samples for r in part(found, "phase").values()) == np.sum(TIME >= 2.0)
    assert regions([bench(np.full(TIME.size, np.nan))]) == ()


def test_means_of_many_samples_weigh_more():
    ones = np.ones(TIME.size)
    found = regions([bench(ones, weight=9.0 * ones), bench(3.0 * ones, repeat=1)])
    assert part(found, "repeat")["repeat 1"].share == pytest.approx(0.5)
    assert part(found, "phase")["rest"].rms == pytest.approx(np.sqrt(18.0 / 10.0))


def test_repeats_are_compared():
    found = regions([bench(np.ones(TIME.size)), bench(3.0 * np.ones(TIME.size), repeat=1)])
    assert part(found, "repeat")["repeat 2"].share == pytest.approx(0.9)


def test_the_robot_s_directions_have_names():
    commands = [
        (0, 0, 0),
        (50, 0, 0),
        (50, 90, 0),
        (50, 180, 0),
        (50, -90, 0),
        (50, 45, 0),
        (0, 0, 30),
        (50, 0, 30),
    ]
    found = regions([robot("vx_m_s", np.ones(TIME.size), *commands)])
    assert set(part(found, "direction", "vx_m_s")) == {
        "at rest", "forward", "left", "backward", "right", "diagonal", "turning", "mixed",
    }  # fmt: skip


def test_a_wheel_stands_still_while_the_others_drive():
    # A diagonal by 45 degrees leaves fl and rr at rest.
    error = np.ones(TIME.size)
    found = regions([robot("speed_fl_rpm", error, (50, 45, 0), (50, 0, 0))])
    assert {"rest", "start", "steady"} <= set(part(found, "phase", "speed_fl_rpm"))


def test_wheels_are_compared_with_each_other():
    drive = [(50, 0, 0), (80, 0, 0)]
    parts = [robot(f"speed_{w}_rpm", (3.0 if w == "rr" else 1.0) * np.ones(TIME.size), *drive)
             for w in ("fl", "fr", "rl", "rr")]  # fmt: skip
    wheels = {r.region: r.share for r in regions(parts) if r.dimension == "wheel"}
    assert wheels == {
        "rr": pytest.approx(0.75), **{w: pytest.approx(1 / 12) for w in ("fl", "fr", "rl")},
    }  # fmt: skip


def test_the_heading_is_that_of_the_motion_in_the_world():
    # Facing +y and driving left is travelling towards -x.
    yaw = np.where(TIME < 3.0, 0.0, np.pi / 2.0)
    error = np.where(TIME < 3.0, 0.0, 1.0)
    found = regions([robot("vx_m_s", error, (50, 0, 0), (50, 90, 0), yaw_rad=yaw)])
    assert part(found, "heading", "vx_m_s")["towards -x"].share == pytest.approx(1.0)


def test_an_angle_s_error_is_within_half_a_turn():
    samples = robot("yaw_rad", np.full(TIME.size, 2.0 * np.pi + 0.1), (0, 0, 30), (0, 0, 60))
    assert samples.errors()[0] == pytest.approx(0.1)


def test_arrays_of_other_lengths_are_refused():
    with pytest.raises(InputError, match="battery_v has shape"):
        replace(bench(np.zeros(TIME.size)), battery_v=np.zeros(3))
