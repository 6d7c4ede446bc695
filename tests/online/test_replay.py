import json
import math

import numpy as np
import pytest
from PIL import Image

from mecanum_env.cli import run
from mecanum_env.errors import InputError
from mecanum_env.law import WheelLaw
from mecanum_env.law.metrics import law_step_metrics
from mecanum_env.model import write_model
from sysid.fit.estimators import WheelRun
from sysid.logs import read_dataset
from sysid.online import OnlineEstimator, OnlineOptions, first_order_law, law_metrics, mean_lag_s, track
from sysid.online.__main__ import main
from sysid.online.replay import replay, replay_path, tick_speeds
from sysid.studies.synthetic import random_samples, random_stable_law

PERIOD = 1.0 / 120.0


def write_log(path, command, speed, period_s=PERIOD):
    rows = [f"{k * period_s:.9f},{r:g},{y:g}" for k, (r, y) in enumerate(zip(command, speed, strict=True))]
    path.write_text("time_s,command_rpm,speed_rpm\n" + "\n".join(rows) + "\n")


@pytest.fixture
def changing_log(tmp_path, law):
    """Two runs: ten seconds of the paper's law, then ten of one twice as slow."""
    slow = WheelLaw(0.92, 0.0, 0.0, 0.08, 0.0, 0.0, PERIOD)
    folder = tmp_path / "bench"
    folder.mkdir()
    rng = np.random.default_rng(1)
    for name, one in (("run_1.csv", law), ("run_2.csv", slow)):
        data = random_samples([(one, 1200)], rng)
        write_log(folder / name, data.command_rpm, data.speed_rpm)
    return folder, slow


def wheel_run(ticks, speeds, n):
    return WheelRun(
        np.zeros(n), np.array(ticks, float), np.array(speeds, float), np.ones(len(ticks)), 0.0, PERIOD
    )


def test_close_samples_are_interpolated_and_lone_ones_go_to_the_nearest_tick():
    found = tick_speeds(wheel_run([0.5, 1.5, 7.9, 11.0], [10.0, 20.0, 30.0, 40.0], 12))
    expected = np.full(12, math.nan)
    expected[[0, 1, 2, 8, 11]] = [10.0, 15.0, 20.0, 30.0, 40.0]
    np.testing.assert_array_equal(found, expected)


def test_samples_on_the_ticks_are_taken_as_they_are():
    speeds = np.random.default_rng(0).standard_normal(50)
    np.testing.assert_allclose(tick_speeds(wheel_run(np.arange(50), speeds, 50)), speeds, rtol=1e-15)


def test_a_replay_follows_the_law_from_run_to_run(changing_log, law):
    folder, slow = changing_log
    (found,) = replay(read_dataset(folder))
    assert found.files == ("run_1.csv", "run_2.csv")
    first, last = found.history.law(found.run_start[1] - 1), found.history.law(-1)
    assert mean_lag_s(first) == pytest.approx(mean_lag_s(law), abs=1e-3)
    assert mean_lag_s(last) == pytest.approx(mean_lag_s(slow), abs=1e-3)
    assert len(found.history.speed_rpm) == found.run_start[1] + 1199


def test_a_sparse_log_gets_a_law_as_slow_as_its_samples(tmp_path):
    rng = np.random.default_rng(2)
    write_log(tmp_path / "run.csv", np.repeat(rng.integers(-50, 51, 100), 20), np.zeros(2000), 0.05)
    assert replay_path(read_dataset(tmp_path)).sample_period_s == pytest.approx(0.05)
    assert replay_path(read_dataset(tmp_path), 0.01).sample_period_s == 0.01


def test_mean_lag_is_the_area_between_step_and_response():
    rng = np.random.default_rng(3)
    for _ in range(20):
        law = random_stable_law(rng, PERIOD)
        area = np.sum(1.0 - law.simulate(np.ones(2000))) * PERIOD
        assert mean_lag_s(law) == pytest.approx(area, rel=1e-8)


def test_metrics_are_those_of_the_laws_and_their_errors_cover_the_truth(law, start):
    errors = []
    for seed in range(12):
        data = random_samples([(law, 900)], np.random.default_rng(300 + seed))
        history = track(OnlineEstimator(OnlineOptions(), start), data.command_rpm, data.speed_rpm)
        metrics = law_metrics(history, 400)
        errors.append((metrics.mean_lag_s[-1] - mean_lag_s(law)) / metrics.mean_lag_error_s[-1])
    assert metrics.tick.tolist() == [0, 400, 800, 899]
    assert metrics.rise_time_s[-1] == law_step_metrics(history.law(-1)).rise_time_s
    assert metrics.dominant_pole[-1] == abs(history.law(-1).poles[0])
    np.testing.assert_allclose(metrics.dc_gain, 1.0, atol=1e-9)
    assert 0.3 < np.sqrt(np.mean(np.square(errors))) < 1.3


def test_the_program_writes_results_and_a_plot(changing_log, tmp_path, capsys):
    folder, slow = changing_log
    assert run(main, [str(folder), "--out", str(tmp_path / "out")]) == 0
    shown = capsys.readouterr().out
    assert "2 run(s)" in shown
    assert "innovations are still" not in shown
    found = json.loads((tmp_path / "out" / "online.json").read_text())
    wheel = found["wheels"]["wheel"]
    assert mean_lag_s(WheelLaw(**wheel["law"])) == pytest.approx(mean_lag_s(slow), abs=1e-3)
    lengths = {len(values) for values in wheel["history"].values()}
    assert len(lengths) == 1
    assert wheel["innovation_rms_rpm"] > 0.0
    with Image.open(tmp_path / "out" / "online_wheel.png") as picture:
        assert picture.size[0] > 800
        assert np.unique(np.asarray(picture.convert("L").resize((64, 64)))).size > 10


def test_the_program_reports_a_wheel_that_no_law_describes(tmp_path, capsys):
    rng = np.random.default_rng(4)
    command = np.repeat(rng.integers(-100, 101, 100), 12).astype(float)
    write_log(tmp_path / "run.csv", command, np.rint(40.0 * rng.standard_normal(1200)))
    assert run(main, [str(tmp_path), "--out", str(tmp_path / "out")]) == 0
    assert "innovations are still" in capsys.readouterr().out


def test_the_program_refuses_bad_input_in_one_sentence(tmp_path, changing_log, capsys):
    assert run(main, [str(tmp_path / "nothing")]) == 2
    assert run(main, [str(changing_log[0]), "--memory", "0", "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.count("error: ") == 2
    assert not (tmp_path / "out").exists()


def test_a_given_model_is_where_it_starts(tmp_path, changing_log, capsys, paper):
    write_model(paper, tmp_path / "model.json")
    out = tmp_path / "out"
    assert run(main, [str(changing_log[0]), "--model", str(tmp_path / "model.json"), "--out", str(out)]) == 0
    first = json.loads((out / "online.json").read_text())["wheels"]["wheel"]["history"]["coefficients"][0]
    np.testing.assert_allclose(first, paper.wheel.law.coefficients, atol=1e-12)
    capsys.readouterr()


def test_shapes_that_disagree_are_refused(start):
    with pytest.raises(InputError, match="equal"):
        track(OnlineEstimator(OnlineOptions(), start), np.zeros(3), np.zeros(4))
    with pytest.raises(InputError, match="sample_period_s"):
        first_order_law(0.0)


@pytest.mark.parametrize(
    "folder", ["husky/left", "micromouse/closed_loop_left", "micromouse/closed_loop_right"]
)
def test_real_logs_keep_every_law_stable(folder, real_logs):
    for wheel in replay(read_dataset(real_logs / folder)):
        history = wheel.history
        margins = [history.law(k).margins.min() for k in range(0, len(history.speed_rpm), 10)]
        assert min(margins) > 0.0
        np.testing.assert_allclose(np.sum(history.coefficients, axis=1), 1.0, atol=1e-12)
