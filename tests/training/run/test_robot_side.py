"""The robot's side: it obeys one session, and stands still when nobody speaks to it."""

import numpy as np
import pytest

from training.drivers.interface import CHANNELS, STOPPED_S, WATCHDOG_S, Sample
from training.drivers.packets import Begin, Order, Packet, Stop
from training.run.robot_side import RobotSide

VALUES = (0.0,) * len(CHANNELS)


class ToyWorld:
    """A world in which a fight lasts as many periods as it is told."""

    period_s, observation_delay_s = 0.1, 0.05

    def __init__(self):
        self.outcome, self.observation = "ready", np.zeros(20)
        self.driven, self.seeds, self.lasts = [], [], 1000

    def begin(self, seed):
        self.seeds.append(seed)
        self.driven, self.outcome = [], "fighting"
        return [Sample(0.0, VALUES)]

    def step(self, command):
        self.driven.append(command)
        self.observation = np.full(20, float(len(self.driven)))
        if len(self.driven) == self.lasts:
            self.outcome = "won"
        start_s = 0.1 * (len(self.driven) - 1)
        return [Sample(start_s + 0.025 * i, VALUES) for i in range(1, 5)]


@pytest.fixture
def world():
    return ToyWorld()


@pytest.fixture
def journal():
    return []


@pytest.fixture
def robot(world, journal):
    return RobotSide(world, 20_000, lambda *entry: journal.append(entry))


def order(number, command, session=1, fight=0):
    return Packet(session, fight, Order(number, command))


def until(robot, end_s, packets=()):
    """Let time pass in steps of 5 ms, with packets (time, packet) that come; return the reports."""
    waiting, reports = sorted(packets, key=lambda pair: pair[0]), []
    for now_s in np.arange(0.0, end_s + 1e-9, 0.005):
        while waiting and waiting[0][0] <= now_s:
            robot.hear(waiting.pop(0)[1], now_s)
        reports += robot.pass_time(now_s)
    return reports


def spoken(last_s, command=(60, 0, 0)):
    """Return a begin and a command every 25 ms until `last_s`."""
    times = np.arange(0.01, last_s, 0.025)
    return [(0.0, Packet(1, 0, Begin())), *((t, order(i, command)) for i, t in enumerate(times))]


def test_before_a_fight_it_says_and_does_nothing(robot, world):
    assert until(robot, 1.0, [(0.1, order(1, (60, 0, 0)))]) == []
    assert world.driven == []


def test_it_drives_what_it_is_told(robot, world):
    until(robot, 0.5, spoken(1.0))
    assert set(world.driven) == {(60, 0, 0)}


@pytest.mark.parametrize("last_s", np.arange(0.3, 0.45, 0.01))
def test_silence_at_any_moment_stops_the_motors_in_time_and_for_good(robot, world, journal, last_s):
    packets = spoken(last_s)
    reports = until(robot, 1.5, packets)
    stopped_s, command, why = journal[-1]
    assert (command, why) == ((0, 0, 0), "stopped")
    assert WATCHDOG_S <= stopped_s - packets[-1][0] <= STOPPED_S - 0.04
    assert world.driven[-1] == (0, 0, 0)
    assert reports[-1].body.outcome == "stopped"


def test_a_robot_that_never_hears_a_command_does_not_move(robot, world):
    until(robot, 1.0, [(0.0, Packet(1, 0, Begin()))])
    assert set(world.driven) == {(0, 0, 0)}


def test_after_a_stop_commands_no_longer_count_until_the_next_fight(robot, world):
    stop = (0.33, Packet(1, 0, Stop()))
    until(robot, 1.0, [*spoken(1.0), stop])
    assert set(world.driven[4:]) == {(0, 0, 0)}
    robot.hear(Packet(1, 1, Begin()), 1.0)
    robot.hear(order(100, (50, 0, 0), fight=1), 1.01)
    for now_s in (1.01, 1.025, 1.05):
        robot.pass_time(now_s)
    assert world.driven == [(50, 0, 0)]
    assert world.seeds == [20_000, 20_001]


def test_another_session_is_not_obeyed_until_it_begins_a_fight(robot, world):
    until(robot, 0.5, [*spoken(1.0), *((t, order(9999, (7, 7, 7), session=2)) for t in (0.2, 0.3))])
    assert (7, 7, 7) not in world.driven


def test_a_begin_that_comes_late_does_not_end_the_fight_that_followed(robot, world):
    robot.hear(Packet(1, 4, Begin()), 0.0)
    robot.hear(Packet(1, 3, Begin()), 0.01)
    assert world.seeds == [20_004]


def test_of_commands_that_overtake_each_other_the_newest_counts(robot, world):
    begin = (0.0, Packet(1, 0, Begin()))
    until(robot, 0.06, [begin, (0.02, order(2, (20, 0, 0))), (0.03, order(1, (10, 0, 0)))])
    assert world.driven == [(20, 0, 0)]


def test_an_observation_is_reported_before_its_command_is_due_and_twice(robot):
    reports = [packet.body for packet in until(robot, 0.5, spoken(1.0))]
    first = {}
    for report in reports:
        first.setdefault(report.tick, report.sent_s)
    assert first[0] == pytest.approx(-0.05)
    assert first[3] == pytest.approx(0.25)
    before_due = [report for report in reports if report.tick == 3 and report.sent_s < 0.3 - 1e-9]
    assert len(before_due) == 2


def test_samples_are_reported_when_they_are_taken_and_twice(robot):
    reports = [packet.body for packet in until(robot, 0.5, spoken(1.0))]
    times = [round(sample.time_s, 6) for report in reports for sample in report.samples]
    assert all(sample.time_s <= report.sent_s + 1e-9 for report in reports for sample in report.samples)
    assert times.count(0.2) == times.count(0.225) == 2
    assert min(times) == 0.0


def test_the_end_of_a_fight_is_told_and_stops_the_motors(robot, world, journal):
    world.lasts = 3
    reports = until(robot, 1.0, spoken(1.0))
    assert reports[-1].body.outcome == "won"
    assert journal[-1][1:] == ((0, 0, 0), "won")
    assert len(world.driven) == 3


def test_a_process_that_could_not_run_has_not_lost_its_fight(robot, world):
    until(robot, 0.3, spoken(1.0))
    driven = len(world.driven)
    (report,) = robot.pass_time(5.0)
    assert report.body.outcome == "fighting"
    assert len(world.driven) <= driven + 1
