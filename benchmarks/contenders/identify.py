"""Ways to identify a wheel from its logs: this project's, and those that a user would pick instead.

Each gets the same runs and is judged by free-running simulation of runs that it has not seen. This project's
fit takes the fit runs and decides on the validation runs; the others, which decide nothing, fit both.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import cont2discrete, lfilter

from mecanum_env.units import FloatArray
from sysid.compare.measured import start_of
from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.logs import Dataset, Run
from sysid.studies.gapbench.adapters.fitting import Logs

SPEED: Final = "speed_rpm"
_FINER: Final = 4
"""Steps of a simulation in one sampling interval."""
_ORDERS: Final = (1, 3)
"""Fewest and most poles and zeros among which ARX chooses."""
_LONGEST_DELAY_S: Final = 0.25
"""Longest delay that ARX and the output error try: the longest of this project's fit."""

Errors = Callable[[Sequence[Run]], FloatArray]
"""Measured minus simulated speed [rpm] of some runs, one after the other."""


@dataclass(frozen=True)
class Method:
    """A way to identify a wheel."""

    name: str
    fit: Callable[[Dataset], Errors]
    """Identifies; returns what judges other runs."""
    needs: tuple[str, str] | None = None
    """Module, and an attribute of it, that this project does not install by itself."""

    def load(self) -> bool:
        """Import what the method needs, so that its time is not the method's; return whether it is there."""
        if self.needs is None:
            return True
        module, attribute = self.needs
        try:
            return hasattr(importlib.import_module(module), attribute)
        except ImportError:
            return False


def ours(dataset: Dataset) -> Errors:
    """Fit as `python -m sysid.fit` does: law, delay, ceiling, and what the drive does beside its law."""
    model = fitted_model(fit_dataset(dataset))
    return lambda runs: Logs(runs).errors(model)


def ours_law(dataset: Dataset) -> Errors:
    """Fit the law, delay and ceiling alone, from three starts."""
    model = fitted_model(fit_dataset(dataset, FitOptions(effects="off", starts=3)))
    return lambda runs: Logs(runs).errors(model)


def mujoco_sysid(dataset: Dataset) -> Errors:
    """Fit a hinge with a velocity servo with mujoco.sysid: six parameters, friction and limits among them."""
    from sysid.studies.gapbench.adapters.mujoco_sysid import FREE, Recordings

    fitted = Recordings(seen(dataset)).fit({name: free.start for name, free in FREE.items()})

    def errors(runs: Sequence[Run]) -> FloatArray:
        predicted = Recordings(runs).predictions(fitted.values)
        return np.concatenate([known(run)[1] - found for run, found in zip(runs, predicted, strict=True)])

    return errors


def scipy_output_error(dataset: Dataset) -> Errors:
    """Fit gain, natural frequency, damping and delay of a second-order lag with `scipy.optimize`."""
    runs = seen(dataset)
    # What one reads off a plot: a tenth of a second, well damped, no delay to speak of.
    begin, low = (1.0, 10.0, 1.0, 0.02), (0.2, 0.5, 0.05, 0.0)
    high = (5.0, 500.0, 20.0, _LONGEST_DELAY_S)
    done = least_squares(
        lambda p: _second_order_errors(p, runs), begin, bounds=(low, high), x_scale=begin, diff_step=1e-4
    )
    return lambda others: _second_order_errors(done.x, others)


def _second_order_errors(parameters: FloatArray, runs: Sequence[Run]) -> FloatArray:
    gain, frequency, damping, delay = parameters
    errors = []
    for run in runs:
        step = interval(run) / _FINER
        clock = np.arange(0.0, run.duration_s + step, step)
        start = start_of(run).initial_rpm
        system = ([gain * frequency**2], [1.0, 2 * damping * frequency, frequency**2])
        numerator, denominator, _ = cont2discrete(system, step, "zoh")
        moved = lfilter(numerator[0], denominator, command_at(run, clock) - start / gain)
        time_s, speed = known(run)
        errors.append(speed - start - np.interp(time_s - delay, clock, moved, left=0.0))
    return np.concatenate(errors)


def sippy_arx(dataset: Dataset) -> Errors:
    """Fit an ARX model with SIPPY, whose orders and delay BIC chooses; runs are put end to end."""
    from sippy_unipi import system_identification

    runs = seen(dataset)
    step = float(np.median([interval(run) for run in runs]))
    command, speed = (np.concatenate(parts) for parts in zip(*(even(run, step) for run in runs), strict=True))
    longest = max(1, round(_LONGEST_DELAY_S / step))
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        found = system_identification(
            speed,
            command,
            "ARX",
            IC="BIC",
            tsample=step,
            na_ord=list(_ORDERS),
            nb_ord=list(_ORDERS),
            delays=[1, longest],
        )
    numerator, denominator = np.ravel(found.NUMERATOR), np.ravel(found.DENOMINATOR)

    def errors(others: Sequence[Run]) -> FloatArray:
        return np.concatenate([_arx_errors(numerator, denominator, run, step) for run in others])

    return errors


def _arx_errors(numerator: FloatArray, denominator: FloatArray, run: Run, step: float) -> FloatArray:
    gain = float(np.sum(numerator) / np.sum(denominator))
    clock = np.arange(0.0, run.duration_s + step, step)
    start = start_of(run).initial_rpm
    moved = lfilter(numerator, denominator, command_at(run, clock) - start / gain)
    time_s, speed = known(run)
    return np.asarray(speed - start - np.interp(time_s, clock, moved))


METHODS: Final = (
    Method("ours", ours),
    Method("ours, law alone", ours_law),
    Method("mujoco.sysid", mujoco_sysid, ("mujoco.sysid", "optimize")),
    Method("scipy output error", scipy_output_error),
    Method("SIPPY ARX", sippy_arx, ("sippy_unipi", "system_identification")),
)


def seen(dataset: Dataset) -> tuple[Run, ...]:
    """Return the runs that a method without decisions fits."""
    return (*dataset.split("fit"), *dataset.split("validation"))


def held_out(dataset: Dataset) -> tuple[Run, ...]:
    """Return the runs that no method has seen, one of each group of repeats."""
    return Logs(dataset.split("test")).chosen


def interval(run: Run) -> float:
    """Return the sampling interval of a run [s]."""
    return run.median_interval_s


def command_at(run: Run, clock: FloatArray) -> FloatArray:
    """Return the held command [rpm] of a bench run at some times [s]."""
    rows = np.searchsorted(run.time_s, clock + 1e-9, side="right") - 1
    return np.asarray(run.command.wheels_rpm[rows, 0])


def known(run: Run) -> tuple[FloatArray, FloatArray]:
    """Return the times [s] and speeds [rpm] of a run's samples, without missing ones."""
    there = run.finite(SPEED)
    return run.time_s[there], run.channels[SPEED][there]


def even(run: Run, step: float) -> tuple[FloatArray, FloatArray]:
    """Return command and speed [rpm] of a run at even times, a `step` [s] apart."""
    clock = np.arange(0.0, run.duration_s, step)
    return command_at(run, clock), np.interp(clock, *known(run))
