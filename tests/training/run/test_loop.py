"""The loop answers every reading, decides once a tick, and leaves no robot moving."""

import numpy as np
import pytest

from sysid.logs import read_dataset
from training.drivers import Reading, RobotSilentError, Sample
from training.drivers.interface import CHANNELS, SILENCE_S
from training.run.fight_log import FightLog
from training.run.loop import play, play_series
from training.run.summary import timing


class FakeDriver:
    """A robot whose readings are given; then it is silent. Waiting takes no time."""

    def __init__(self, readings):
        self.readings, self.log = list(readings), []
        self.time_s = 0.0

    def now(self):
        return self.time_s

    def begin(self, fight):
        self.log.append(("begin", fight))

    def read(self, timeout_s):
        if not self.readings:
            self.time_s += timeout_s
            return None
        self.time_s += 0.05
        return self.readings.pop(0)

    def send(self, tick, command):
        self.log.append(("send", tick, command))

    def stop(self):
        self.log.append(("stop",))


class Counting:
    """A controller whose command counts its observations."""

    def reset(self):
        self.seen = 0

    def act(self, _):
        self.seen += 1
        return self.seen, 0, 0


def reading(tick, outcome="fighting", samples=(), held=None):
    return Reading(tick, tick - 1 if held is None else held, outcome, np.zeros(20), samples)


def sample(time_s, value=1.0, command=(0, 0, 0)):
    return Sample(time_s, (value,) * len(CHANNELS), command)


def played(readings, folder, controller=None):
    driver = FakeDriver(readings)
    return driver, play(driver, controller or Counting(), 4, folder / "fight.csv", now=driver.now)


def test_it_decides_once_a_tick_and_answers_every_reading(tmp_path):
    driver, fight = played([reading(0), reading(0), reading(1), reading(1, "won")], tmp_path)
    sends = [entry[1:] for entry in driver.log if entry[0] == "send"]
    assert sends == [(0, (1, 0, 0)), (0, (1, 0, 0)), (1, (2, 0, 0))]
    assert (fight.number, fight.outcome, fight.commands, fight.missed) == (4, "won", 2, 0)


def test_an_observation_that_comes_late_is_not_answered_anew(tmp_path):
    driver, fight = played([reading(0), reading(2), reading(1), reading(2, "lost")], tmp_path)
    sends = [entry[1] for entry in driver.log if entry[0] == "send"]
    assert sends == [0, 2, 2]
    assert fight.missed == 1


def test_a_command_that_came_too_late_is_counted(tmp_path):
    _, fight = played([reading(0), reading(1, held=-1), reading(2), reading(2, "lost")], tmp_path)
    assert fight.late == 1


def test_the_fight_ends_with_a_stop(tmp_path):
    driver, _ = played([reading(0), reading(0, "won")], tmp_path)
    assert driver.log[-1] == ("stop",)


def test_silence_ends_it_with_a_stop_and_one_sentence(tmp_path):
    driver = FakeDriver([reading(0), reading(1)])
    with pytest.raises(RobotSilentError, match=rf"fight 4: nothing heard of the robot for {SILENCE_S} s"):
        play(driver, Counting(), 4, tmp_path / "fight.csv", now=driver.now)
    assert driver.log[-1] == ("stop",)
    assert driver.time_s == pytest.approx(0.1 + SILENCE_S)


def test_a_controller_that_fails_stops_the_robot(tmp_path):
    class Failing(Counting):
        def act(self, _):
            raise ZeroDivisionError

    driver = FakeDriver([reading(0)])
    with pytest.raises(ZeroDivisionError):
        play(driver, Failing(), 0, tmp_path / "fight.csv", now=driver.now)
    assert driver.log[-1] == ("stop",)


def test_the_period_and_its_jitter_are_reported(tmp_path):
    _, fight = played([reading(0), reading(1), reading(1), reading(2), reading(2, "won")], tmp_path)
    assert fight.intervals_s == pytest.approx((0.05, 0.1))
    assert timing([fight])["period_ms"] == pytest.approx(75.0)
    assert timing([fight])["jitter_ms"] == pytest.approx(25.0)


def test_a_series_logs_each_fight_in_a_file_of_its_own(tmp_path):
    samples = (sample(0.0), sample(0.025))
    driver = FakeDriver([reading(0, samples=samples), reading(0, "won")] * 2)
    done = []
    play_series(driver, Counting(), 2, tmp_path, done.append)
    assert [fight.number for fight in done] == [0, 1]
    assert [run.file for run in read_dataset(tmp_path).runs] == ["fight_0000.csv", "fight_0001.csv"]


def test_a_log_is_read_as_our_own_format_with_the_command_of_each_time(tmp_path):
    with FightLog(tmp_path / "fight.csv") as log:
        log.add((sample(0.0, command=(10, 0, 0)), sample(0.025, command=(10, 0, 0))))
        log.add((sample(0.025, command=(10, 0, 0)), sample(0.05, float("nan"), (20, 90, -5))))
    (run,) = read_dataset(tmp_path).runs
    np.testing.assert_array_equal(run.time_s, [0.0, 0.025, 0.05])
    np.testing.assert_array_equal(run.command.v_rpm, [10, 10, 20])
    np.testing.assert_array_equal(run.command.theta_deg, [0, 0, 90])
    assert np.isnan(run.channels["vx_m_s"]).tolist() == [False, False, True]


def test_rows_are_in_the_file_at_once(tmp_path):
    with FightLog(tmp_path / "fight.csv") as log:
        log.add((sample(0.0), sample(0.025)))
        assert len((tmp_path / "fight.csv").read_text(encoding="utf-8").splitlines()) == 3


def test_a_log_that_nobody_could_read_is_removed(tmp_path):
    with FightLog(tmp_path / "fight.csv") as log:
        log.add((sample(0.0),))
    assert list(tmp_path.iterdir()) == []
