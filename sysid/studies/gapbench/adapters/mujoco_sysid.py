"""mujoco.sysid with all parameters of a wheel free; the one that has changed most, significantly, is named.

A hinge with a velocity actuator. Inertia, friction, gain, delay, torque limit and speed limit are fitted to
the nominal logs, and again, from there, to the changed ones. Two fits are compared by their own intervals.
"""

from __future__ import annotations

import contextlib
import io
import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import mujoco
import numpy as np
from mujoco import sysid

from mecanum_env.statistics import rms
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.logs import Run
from sysid.studies.gapbench.adapters.fitting import Logs, independent
from sysid.studies.gapbench.adapters.residuals import has_changed
from sysid.studies.gapbench.case_folder import CHANNEL
from sysid.studies.gapbench.cases import Answer, BenchCase

_XML: Final = """
<mujoco>
  <option timestep="{step}" integrator="implicitfast"><flag contact="disable" gravity="disable"/></option>
  <worldbody>
    <body>
      <joint name="wheel" type="hinge" axis="0 1 0" armature="0.05"/>
      <geom type="sphere" size="0.01" mass="1e-6"/>
    </body>
  </worldbody>
  <actuator>
    <general name="drive" joint="wheel" gainprm="1" biastype="affine" biasprm="0 0 -1"
             forcelimited="true" forcerange="-100 100" ctrllimited="true" ctrlrange="-100 100"/>
  </actuator>
  <sensor><jointvel name="speed" joint="wheel"/></sensor>
</mujoco>
"""
_RUNS: Final = 6
"""Runs of each set of logs that are fitted."""
_ITERATIONS: Final = 15
_STEPS_PER_SAMPLE: Final = 4
_STEPS_S: Final = (0.001, 0.005)
"""Shortest and longest step of the physics."""
_SIGNIFICANT: Final = 3.0
"""Standard deviations."""
_EXPLAINED: Final = 0.8
"""Error left, over that before, below which something is explained."""


@dataclass(frozen=True)
class Free:
    """A parameter of the wheel, in units of its usual size."""

    start: float
    low: float
    high: float
    names: tuple[tuple[str, ...], ...]
    """What a change of it stands for, as candidates."""


FREE: Final[Mapping[str, Free]] = {
    "inertia": Free(0.05, 0.002, 1.0, (("load_inertia",), ("sensor_lowpass",))),
    "gain": Free(1.0, 0.3, 1.7, (("speed_gain",), ("sensor_scale",), ("viscous_friction",))),
    "friction": Free(0.1, 0.0, 5.0, (("coulomb_friction",),)),
    "delay": Free(0.05, 0.0, 0.4, (("command_latency",), ("sensor_latency",))),
    "torque": Free(20.0, 0.2, 30.0, (("acceleration_limit",),)),
    "ceiling": Free(20.0, 1.0, 30.0, (("speed_saturation",),)),
}
"""Name -> parameter: kg m2, 1, N m, s, N m, rad/s, for a servo of 1 N m s/rad."""


def answer(case: BenchCase) -> Answer:
    """Return what the largest significant change between both fits stands for."""
    if not has_changed(case):
        return Answer("no_gap")
    nominal, changed = (Recordings(Logs(logs.runs).chosen[:_RUNS]) for logs in (case.nominal, case.changed))
    before = nominal.fit({name: free.start for name, free in FREE.items()})
    after = changed.fit(before.values)
    predictions = tuple(Recordings((_at_rest(run),)).predictions(after.values)[0] for run in case.test)
    sizes = {
        name: abs(after.values[name] - before.values[name]) / (free.high - free.low)
        for name, free in FREE.items()
        if abs(after.values[name] - before.values[name])
        > _SIGNIFICANT * math.hypot(before.deviations[name], after.deviations[name])
    }
    if not sizes or after.rms_rpm > _EXPLAINED * changed.rms_error(before.values):
        return Answer("unexplained", predictions=predictions)
    names = FREE[max(sizes, key=lambda name: sizes[name])].names
    if len(names) > 1:
        return Answer("ambiguous", candidates=names, predictions=predictions)
    return Answer("named", {names[0][0]: {}}, predictions=predictions)


def _at_rest(run: Run) -> Run:
    """Return a run without measurements with zeros in their place, which only its length is read from."""
    return replace(run, channels={CHANNEL: np.zeros(run.time_s.size)})


@dataclass(frozen=True)
class WheelFit:
    """Parameters fitted to some recordings."""

    values: Mapping[str, float]
    deviations: Mapping[str, float]
    rms_rpm: float


class Recordings:
    """Runs as mujoco.sysid takes them."""

    def __init__(self, runs: Sequence[Run]) -> None:
        interval = float(np.median(np.concatenate([np.diff(run.time_s) for run in runs])))
        step = min(max(interval / _STEPS_PER_SAMPLE, _STEPS_S[0]), _STEPS_S[1])
        spec = mujoco.MjSpec.from_string(_XML.format(step=step))
        model = spec.compile()
        rest = sysid.create_initial_state(model, np.zeros(1), np.zeros(1))
        sequences = []
        for number, run in enumerate(runs):
            clock = np.arange(0.0, run.duration_s + 2.0 * step, step)
            rows = np.searchsorted(run.time_s, clock, side="right") - 1
            control = sysid.TimeSeries(clock, run.command.wheels_rpm[rows, :1] * RAD_S_PER_RPM)
            known = np.isfinite(run.channels[CHANNEL])
            speed = run.channels[CHANNEL][known, None] * RAD_S_PER_RPM
            measured = sysid.TimeSeries.from_names(run.time_s[known], speed, model)
            sequences.append(sysid.ModelSequences("wheel", spec, f"run {number}", rest, control, measured))
        self._residual = sysid.build_residual_fn(
            models_sequences=sequences, modify_residual=_delayed, n_threads=1
        )

    def fit(self, start: Mapping[str, float]) -> WheelFit:
        """Return the parameters that fit best, searched from a start, with their standard deviations."""
        parameters = _parameters(start).move_off_bounds()
        # The optimiser prints its iterations, and there is no way to tell it not to.
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            best, done = sysid.optimize(
                initial_params=parameters,
                residual_fn=self._residual,
                optimizer="mujoco",
                verbose=False,
                max_iters=_ITERATIONS,
            )
            residuals = self._residual(done.x, best)[0]
            _, halves = sysid.calculate_intervals(residuals, done.jac, alpha=0.32)
        errors = np.concatenate(residuals)
        # The interval takes all samples for independent.
        wider = math.sqrt(errors.size / independent(errors))
        spread = dict(zip(FREE, (np.asarray(halves) * wider).tolist(), strict=True))
        values = {name: float(best[name].value[0]) for name in FREE}
        return WheelFit(values, spread, rms(errors) / RAD_S_PER_RPM)

    def predictions(self, values: Mapping[str, float]) -> list[FloatArray]:
        """Return the speeds [rpm] that parameters of some values give at the samples of each run, (n,)."""
        parameters = _parameters(values)
        found = self._residual(parameters.as_vector(), parameters)[1]
        return [one[0].data[:, 0] / RAD_S_PER_RPM for one in found]

    def rms_error(self, values: Mapping[str, float]) -> float:
        """Return the rms error [rpm] of parameters of some values over all runs."""
        parameters = _parameters(values)
        residuals = self._residual(parameters.as_vector(), parameters)[0]
        return rms(np.concatenate(residuals)) / RAD_S_PER_RPM


def _parameters(values: Mapping[str, float]) -> Any:
    """Return parameters of mujoco.sysid with some values."""
    made = sysid.ParameterDict()
    for name, free in FREE.items():
        made.add(sysid.Parameter(name, values[name], free.low, free.high, modifier=_MODIFIERS.get(name)))
    return made


def _inertia(spec: Any, parameter: Any) -> None:
    spec.joint("wheel").armature = parameter.value[0]


def _friction(spec: Any, parameter: Any) -> None:
    spec.joint("wheel").frictionloss = parameter.value[0]


def _gain(spec: Any, parameter: Any) -> None:
    spec.actuator("drive").gainprm[0] = parameter.value[0]


def _torque(spec: Any, parameter: Any) -> None:
    spec.actuator("drive").forcerange = [-parameter.value[0], parameter.value[0]]


def _ceiling(spec: Any, parameter: Any) -> None:
    spec.actuator("drive").ctrlrange = [-parameter.value[0], parameter.value[0]]


_MODIFIERS: Final = {
    "inertia": _inertia,
    "friction": _friction,
    "gain": _gain,
    "torque": _torque,
    "ceiling": _ceiling,
}
"""Parameter -> what writes it into the model; the delay acts on the sensor."""


def _delayed(
    parameters: Any, predicted: Any, measured: Any, _model: Any, _all: bool, **_state: Any
) -> tuple[FloatArray, Any, Any]:
    """Return errors, predictions and measurements, with the speed seen after the delay of the parameters."""
    clock = measured.times - parameters["delay"].value[0]
    speed = np.interp(clock, predicted.times, predicted.data[:, 0], left=0.0)[:, None]
    seen = sysid.TimeSeries(measured.times, speed, measured.signal_mapping)
    return measured.data - speed, seen, measured
