"""Conversion of a wheel law to another sample period.

A law whose command is held over each tick is the zero-order-hold sampling of a continuous system

    dx/dt = Ac x + bc r,   w = (1 0 0) x,   exp([[Ac, bc], [0, 0]] t) = [[Ad, bd], [0, 1]] =: M,

with (Ad, bd) the law in observer form. Another period t' = p t has M' = M^p = exp(p log M), whose three poles
and first three samples of the impulse response give A-F. Commands that are held over ticks of both laws then
give the same speeds at all common times.

M^p is real for a whole p (slower by a whole factor: always exact) and if M has a real logarithm, which it has
without poles on the non-positive real axis. Such a pole alternates in sign from tick to tick (or is a pure
delay of one tick), which no continuous system does; `approximate=True` then finds the nearest stable law.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.linalg import fractional_matrix_power
from scipy.optimize import least_squares

from mecanum_env.errors import InputError
from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.law.metrics import step_response
from mecanum_env.units import FloatArray

_WHOLE: Final = 1e-9  # periods such as 1/120 and 1/60 are not exact doubles
_ON_THE_AXIS: Final = 1e-9
_LARGEST_REFLECTION: Final = 1.0 - 1e-9


def convert_law(law: WheelLaw, sample_period_s: float, *, approximate: bool = False) -> WheelLaw:
    """Return the law that ticks every `sample_period_s` [s] and gives the speeds of `law` at common times.

    Exact, DC gain included, for commands that are held over the ticks of both laws. Conversion to a slower
    law and back is exact if no pole turns by more than half a revolution per tick of the slower one
    (aliasing).

    If no exact law exists and `approximate` is True, return the stable law of the same DC gain whose step
    response is nearest in least squares to that of `law` (linear between its ticks).

    Raises:
        UnstableLawError: `law` is unstable.
        InputError: `sample_period_s` is not a finite number above 0, or no exact law exists and
            `approximate` is False; the message lists the poles in the way.
    """
    law.require_stable()
    if not (math.isfinite(sample_period_s) and sample_period_s > 0.0):
        raise InputError(f"sample_period_s = {sample_period_s}, must be a finite number above 0")
    ratio = sample_period_s / law.sample_period_s
    whole = round(ratio)
    matrix = _held_matrix(law)
    if whole >= 1 and abs(ratio - whole) <= _WHOLE * whole:
        return _law_of_matrix(np.linalg.matrix_power(matrix, whole), sample_period_s)
    in_the_way = [p for p in np.linalg.eigvals(matrix[:-1, :-1]) if _has_no_real_logarithm(complex(p))]
    if not in_the_way:
        return _law_of_matrix(np.real(fractional_matrix_power(matrix, ratio)), sample_period_s)
    if approximate:
        return _nearest_law(law, sample_period_s)
    raise InputError(
        f"the law has no exact equivalent at {sample_period_s:g} s: pole(s) at "
        f"{', '.join(f'{p.real:.6g}' for p in in_the_way)} on the non-positive real axis belong to no "
        f"continuous system; choose a whole multiple of {law.sample_period_s:g} s, or approximate=True"
    )


def _held_matrix(law: WheelLaw) -> FloatArray:
    """Return [[Ad, bd], [0, 1]] in observer form, without poles and zeros that cancel at z = 0."""
    poles, zeros = [law.A, law.B, law.C], [law.D, law.E, law.F]
    while len(poles) > 1 and poles[-1] == 0.0 and zeros[-1] == 0.0:
        poles.pop()
        zeros.pop()
    order = len(poles)
    matrix = np.eye(order + 1, k=1)
    matrix[:order, 0] = poles
    matrix[:order, order] = zeros
    matrix[order, order] = 1.0
    return matrix


def _law_of_matrix(matrix: FloatArray, sample_period_s: float) -> WheelLaw:
    """Return the law of [[Ad, bd], [0, 1]] from its characteristic polynomial and impulse response."""
    transition, state = matrix[:-1, :-1], matrix[:-1, -1]
    abc = np.zeros(3)
    abc[: len(state)] = -np.real(np.poly(transition))[1:]
    impulse = []
    for _ in range(3):
        impulse.append(float(state[0]))
        state = transition @ state
    d, e, f = impulse
    e, f = e - abc[0] * d, f - abc[0] * e - abc[1] * d
    if len(state) < 3:  # these poles and zeros cancelled; a rounding error must not bring them back
        f = 0.0
    if len(state) < 2:
        e = 0.0
    return WheelLaw.from_coefficients([*abc, d, e, f], sample_period_s)


def _nearest_law(law: WheelLaw, sample_period_s: float) -> WheelLaw:
    """Fit the step response by least squares over three reflection coefficients (tanh of free numbers).

    For given poles the response is linear in D, E, F, of which the DC gain leaves two free. They are solved
    for inside (variable projection), so the search has three dimensions.
    """
    slowest = max(abs(law.poles[0]), 1e-3)
    horizon_s = law.sample_period_s * (10 + math.log(1e-6) / math.log(slowest))
    ticks = min(max(math.ceil(horizon_s / sample_period_s), 10), 2_000)
    source = step_response(law, math.ceil(ticks * sample_period_s / law.sample_period_s) + 1)
    target = np.interp(
        np.arange(ticks + 1) * sample_period_s, np.arange(len(source)) * law.sample_period_s, source
    )

    def law_at(free: FloatArray) -> WheelLaw:
        abc = -_polynomial(np.tanh(free))[1:]
        return _with_best_zeros(abc, target, law.dc_gain, sample_period_s)

    # As a start, the poles in the way keep their decay and lose their sign.
    ratio = sample_period_s / law.sample_period_s
    poles = [max(abs(p), 1e-6) if _has_no_real_logarithm(p) else p for p in map(complex, law.poles)]
    start = np.array([complex(p**ratio) for p in poles])
    reflections = _reflections(np.real(np.poly(start)))
    fit = least_squares(
        lambda free: step_response(law_at(free), ticks) - target,
        np.arctanh(np.clip(reflections, -_LARGEST_REFLECTION, _LARGEST_REFLECTION)),
        x_scale="jac",
        max_nfev=200,
    )
    return law_at(fit.x)


def _has_no_real_logarithm(pole: complex) -> bool:
    return pole.real <= _ON_THE_AXIS and abs(pole.imag) <= _ON_THE_AXIS


def _with_best_zeros(abc: FloatArray, target: FloatArray, dc_gain: float, period_s: float) -> WheelLaw:
    """Return the law with these A, B, C and DC gain whose D, E fit the target step response best."""
    total = dc_gain * (1.0 - float(np.sum(abc)))  # D + E + F
    delayed = step_response(WheelLaw.from_coefficients([*abc, 1.0, 0.0, 0.0], period_s), len(target) - 1)
    basis = np.stack([np.concatenate([np.zeros(k), delayed[: len(delayed) - k]]) for k in range(3)], axis=1)
    design = basis[:, :2] - basis[:, 2:]
    (d, e), *_ = np.linalg.lstsq(design, target - total * basis[:, 2], rcond=None)
    return WheelLaw.from_coefficients([*abc, d, e, total - d - e], period_s)


def _polynomial(reflections: npt.ArrayLike) -> FloatArray:
    """Return the monic polynomial of reflection coefficients; if all are below 1, its roots are inside."""
    polynomial = np.ones(1)
    for k in np.asarray(reflections, float):
        grown = np.append(polynomial, 0.0)
        polynomial = grown + k * grown[::-1]
    return polynomial


def _reflections(polynomial: FloatArray) -> FloatArray:
    """Return the reflection coefficients of a monic polynomial with all roots inside the unit circle."""
    reflections = []
    while len(polynomial) > 1:
        k = polynomial[-1]
        reflections.append(k)
        polynomial = ((polynomial - k * polynomial[::-1]) / (1.0 - k * k))[:-1]
    return np.array(reflections[::-1])
