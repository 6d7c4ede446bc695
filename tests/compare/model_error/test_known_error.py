"""What a model errs by in the commands of its fit is taken off new logs in the same commands."""

from __future__ import annotations

import numpy as np

from mecanum_env.model import paper_model
from sysid.compare.model_error import without_known_error
from sysid.compare.predicted import predict
from sysid.logs import BenchCommand, Run

MODEL = paper_model()
TIME_S = np.arange(0.0, 3.0, 0.02)


def a_run(file: str, level_rpm: float, error_rpm: float) -> Run:
    """Return a step whose speed is what the model predicts, and from 1 s on an error."""
    command = BenchCommand(np.where(TIME_S < 0.5, 0.0, level_rpm))
    bare = Run(file, file, "fit", TIME_S, command, {"speed_rpm": np.zeros(TIME_S.size)})
    speed = predict(MODEL, bare)["speed_rpm"] + np.where(TIME_S < 1.0, 0.0, error_rpm)
    return Run(file, file, "fit", TIME_S, command, {"speed_rpm": speed})


def left(run: Run) -> float:
    """Return what is left of the error, which is the same at all times from 1 s on [rpm]."""
    rest = run.channels["speed_rpm"] - predict(MODEL, run)["speed_rpm"]
    assert np.ptp(rest[TIME_S > 1.0]) < 1e-6
    return float(rest[-1])


def test_one_odd_run_of_the_fit_is_not_the_models_error() -> None:
    of_fit = [a_run(f"old{i}", 60.0, error) for i, error in enumerate((4.0, 40.0, 5.0))]
    (new,) = without_known_error(MODEL, [a_run("new", 60.0, 7.0)], of_fit)
    assert np.isclose(left(new), 2.0)


def test_a_run_of_the_fit_is_beside_the_others() -> None:
    of_fit = [a_run("one", 60.0, 4.0), a_run("other", 60.0, 5.0)]
    assert np.allclose([left(run) for run in without_known_error(MODEL, of_fit, of_fit)], [-1.0, 1.0])


def test_other_commands_tell_nothing() -> None:
    run = a_run("new", 60.0, 7.0)
    assert without_known_error(MODEL, [run], [a_run("old", 90.0, 4.0)]) == (run,)
