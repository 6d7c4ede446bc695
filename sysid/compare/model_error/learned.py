"""What the logs of a fit teach about the model's own error, for a study of other logs.

In the logs of the fit the whitened residual is r = K f + e: the columns K (N, q) are what uncertain
parameters change and the shape of the model's error (`sysid.compare.model_error.shape`), f are their unknown
factors, and e is the rest. The factors of the parameters are almost free, those of the shape are normal with
a variance for each group of columns, found by maximum likelihood (EM). Given r, f is normal with mean m and
covariance P. In other logs the model then errs by K m, and is uncertain by columns K P^(1/2). What no factor
explains, judged on groups of runs that were left out, stays as an error of unknown shape
(`sysid.compare.model_error.size`). Of a robot the factors differ from one command sequence to another
(`sysid.compare.model_error.varying`).

So a study of new logs compares two sets of logs: an error that the first has, too, is no new effect. (Model
discrepancy: Kennedy and O'Hagan, J. R. Statist. Soc. B 63:425, 2001.)
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.effects.scale import Scale
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.measured import Observations, most_active, observe
from sysid.compare.model_error.adopted import as_fitted
from sysid.compare.model_error.elsewhere import change
from sysid.compare.model_error.familiar import are_familiar
from sysid.compare.model_error.freedom import freedom_of_each
from sysid.compare.model_error.marginal import Marginal
from sysid.compare.model_error.nuisance import adopted_variants, fitted_variants
from sysid.compare.model_error.shape import Key, ShapeBasis
from sysid.compare.model_error.size import FACTORS, ModelError, Residual, estimate_model_error
from sysid.compare.model_error.steady_gain import unreached_share, with_other_gain
from sysid.compare.model_error.suspects import suspect_columns
from sysid.compare.model_error.varying import VaryingPosterior, columns_of_sequences
from sysid.compare.model_error.whitening import Whitener
from sysid.compare.noise import Noise, measure_noise
from sysid.compare.predicted import SimulationSettings, Simulators
from sysid.compare.search_space import scale_of
from sysid.logs import Dataset

_PARAMETER_SIGMAS: Final = 10.0
"""Prior standard deviation of a parameter, in its stated ones: the logs that gave these decide."""
_FITTED, _ADOPTED = -1, -2
"""Numbers of the groups of factors that are no shapes: what was fitted to these logs, and what these do not
decide: what a study of others added, and a steady speed that they never show."""
_ROUNDS: Final = 30  # of EM
_LEAST_SIZE: Final = 1e-9
_FOLD_S: Final = 4.0
"""Length of the pieces [s] that are left out in turn where there are too few groups of runs."""
_FEWEST_FOLDS: Final = 3
_OTHER_COMMANDS: Final = {"bench": 4.0, "robot": 1.0}
"""Factor from the unexplained error in groups of runs that were left out to that in logs of other commands.
Calibrated on drawn drives (python -m sysid.studies.zoo --bench 90 --robot 0): with 1, 2 and 4 logs in which
nothing had changed were called a gap in 5, 2 and 0 of 22 cases; with 7 fewer hidden effects were found. Of
robots what every effect would do is known, too: with 1 logs in which nothing had changed cost .9 of what is
expected in the same commands, and .96 in others."""

_ROBOT_FACTORS: Final = (0.4, 0.5, 0.63, 0.8)
"""Factors on the error of a robot below `FACTORS`: what differs between command sequences is counted beside
it, and so may explain most of it."""


@dataclass(frozen=True, eq=False)
class Learned:
    """The posterior of a model's own error, given the logs of its fit."""

    model: Model
    """The model that errs; in the logs of its fit, without what came later."""
    basis: ShapeBasis
    keys: tuple[Key, ...]
    """Columns of the shape, after those of the parameters."""
    scale: Scale
    """What the sizes of effects are in proportion to."""
    mean: FloatArray
    """Posterior mean of the factors, shape (q,)."""
    root: FloatArray
    """Root of their posterior covariance, shape (q, q)."""
    error: ModelError
    """What no factor explains, in the commands of the logs of the fit."""
    prior: FloatArray
    """Standard deviation of each factor before the logs of the fit were seen, shape (q,)."""
    varying: FloatArray
    """Standard deviation by which each factor differs from one command sequence to another, shape (q,)."""
    freedom: float
    """Degrees of freedom that each command sequence adds to those of a mean squared residual."""
    simulators: Simulators
    """Of the logs of the fit."""
    whitener: Whitener
    """Of the residual in the logs of the fit."""
    unreached: float = 0.0
    """Share of its steady speed that a wheel on the bench is short of throughout the logs of the fit."""

    @property
    def is_bench(self) -> bool:
        """Whether the logs of the fit are of a wheel on the bench."""
        return is_bench(self.simulators.full.observations)

    def knows(self, observations: Observations) -> bool:
        """Return whether the commands of bench logs are among those of the logs of the fit."""
        return self.is_bench and are_familiar(observations, self.whitener.observations)

    @property
    def noise_ratio(self) -> float:
        """The model's mean squared error over single samples of the logs of its fit, in noise variances."""
        blocks, noise = self.simulators.full.observations.blocks, self.whitener.noise.sigma
        predicted = self.simulators.averaged.predictions(as_fitted(self.model))
        squares = sum(
            (float(block.weight @ (block.value - p) ** 2) + block.repeat_squares) / noise[block.channel] ** 2
            for block, p in zip(blocks, predicted, strict=True)
        )
        return squares / sum(float(block.weight.sum()) for block in blocks)

    def error_in(self, observations: Observations) -> ModelError:
        """Return what no factor explains in other logs."""
        if self.knows(observations):
            return self.error
        return self.error.scaled(_OTHER_COMMANDS["bench" if self.is_bench else "robot"])

    def error_of(
        self, observations: Observations, noise: Noise, left: Sequence[FloatArray], simulators: Simulators
    ) -> ModelError:
        """Return what no factor explains in other logs, where a set of effects has `left` so much of them.

        In other commands a drive may err by several times as much as in those of its fit. But it does not err
        by more than the best set leaves: the factor is the smallest one, of 1 to that of `error_in`, with
        which that costs no more than there are values.
        """
        most = self.error_in(observations)
        columns = self.columns(simulators)
        for factor in FACTORS:
            error = self.error.scaled(factor)
            whitener = Whitener(observations, noise, error)
            uncertain = Marginal(self.uncertain(whitener.whiten(columns), observations))
            values = uncertain.of(whitener.whiten(left))
            if float(values @ values) <= values.size:
                return error
        return most

    def before(self) -> Learned:
        """Return what is known of the factors without the logs of the fit."""
        return replace(self, mean=np.zeros(self.mean.size), root=np.diag(self.prior))

    def columns(self, simulators: Simulators, at: Model | None = None) -> list[FloatArray]:
        """Return K for the observations of some simulators: an array (m, q) for each block.

        They are taken where the model `at` moves the robot, one with further effects; by default where the
        model does that errs.
        """
        of_fit = simulators is self.simulators
        # The logs of the fit, and others that hold their commands, do not show the steady speed.
        unreached = 0.0 if of_fit or self.knows(simulators.full.observations) else self.unreached
        return _columns(
            self.model, self.basis, self.keys, self.scale, simulators, unreached, of_fit=of_fit, at=at
        )

    def expected_error(
        self, whitener: Whitener, simulators: Simulators, at: Model | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return what the model errs by in other logs, (N,), and what is unknown of it, columns (N, p).

        Both are whitened, and taken where the model `at` moves the robot.
        """
        columns = whitener.whiten(self.columns(simulators, at))
        return columns @ self.mean, self.uncertain(columns, whitener.observations)

    def uncertain(self, columns: FloatArray, observations: Observations) -> FloatArray:
        """Return what is still unknown of the model's error, (N, p).

        `columns` (N, q) are K for some `observations`, whitened.
        """
        own = columns_of_sequences(columns, self.varying, _folds(observations))
        return np.concatenate([columns @ self.root, *own], axis=1)


def learn(model: Model, dataset: Dataset, settings: SimulationSettings | None = None) -> Learned:
    """Return what the logs of a fit teach about the model's own error.

    Raises:
        InputError: the logs have no measured sample, or the model cannot be simulated.
        SimulationDivergedError: the state stopped being finite.
    """
    observations = observe(most_active(dataset))
    noise = measure_noise(dataset, observations)
    simulators = Simulators.of(observations, settings or SimulationSettings())
    then = as_fitted(model)
    predicted = simulators.averaged.predictions(then)
    basis = ShapeBasis.of(then, observations, predicted)
    keys = tuple(sorted(basis.columns(then, observations, predicted)))
    scale = scale_of(model, [run for situation in observations.situations for run in situation.runs])
    columns = _columns(model, basis, keys, scale, simulators, of_fit=True)
    unreached = unreached_share(then, observations) if is_bench(observations) else 0.0
    residual = [block.value - p for block, p in zip(observations.blocks, predicted, strict=True)]
    added = len(adopted_variants(model)) + is_bench(observations)
    fitted = columns[0].shape[1] - len(keys) - added
    group_of = np.array([*[_FITTED] * fitted, *[_ADOPTED] * added, *_group_numbers(keys)])
    folds = _folds(observations)
    white = Whitener(observations, noise, None)
    found = _Posterior.of(white.whiten(residual), white.whiten(columns), group_of)
    error = _left(observations, noise, residual, columns, found, white, folds, dataset.sha256)
    for factor in FACTORS if is_bench(observations) else (*_ROBOT_FACTORS, *FACTORS):
        scaled = error.scaled(factor)
        whitener = Whitener(observations, noise, scaled)
        r, k = whitener.whiten(residual), whitener.whiten(columns)
        if is_bench(observations):
            posterior: _Posterior | VaryingPosterior = _Posterior.of(r, k, group_of, variance=1.0)
        else:
            posterior = VaryingPosterior.of(r, k, folds, _prior_sizes(group_of), group_of)
        costs = posterior.left_out_costs(r, k, folds)
        if float(np.sum(costs)) <= r.size:
            break
    values, vectors = np.linalg.eigh(posterior.covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    prior, varying = posterior.precision**-0.5, posterior.varying
    sizes = np.array([np.count_nonzero(folds == fold) for fold in np.unique(folds)])
    return Learned(
        model,
        basis,
        keys,
        scale,
        posterior.mean,
        root,
        scaled,
        prior,
        varying,
        freedom_of_each(costs / sizes),
        simulators,
        whitener,
        unreached,
    )


def is_bench(observations: Observations) -> bool:
    """Return whether some observations are of a wheel on the bench."""
    return observations.situations[0].runs[0].level == "bench"


def _prior_sizes(group_of: npt.NDArray[np.intp]) -> FloatArray:
    """Return the standard deviation of each factor before any logs are seen, (q,); of shapes the start."""
    return np.where(group_of < 0, np.where(group_of == _ADOPTED, 1.0, _PARAMETER_SIGMAS), 1e-3)


@dataclass(frozen=True, eq=False)
class _Posterior:
    """The factors given a whitened residual."""

    mean: FloatArray
    covariance: FloatArray
    precision: FloatArray
    """Of the prior of each factor, shape (q,)."""
    variance: float
    """Of what is left, relative to the noise."""

    @classmethod
    def of(
        cls,
        residual: FloatArray,
        columns: FloatArray,
        group_of: npt.NDArray[np.intp],
        variance: float | None = None,
    ) -> _Posterior:
        """Return the posterior; the `variance` of what is left is estimated, at least 1, if not given."""
        gram, aim = columns.T @ columns, columns.T @ residual
        size = _prior_sizes(group_of)
        left = 1.0 if variance is None else variance
        for _ in range(_ROUNDS):
            covariance = np.asarray(np.linalg.inv(gram / left + np.diag(size**-2.0)), float)
            mean = covariance @ aim / left
            squares = mean**2 + np.diag(covariance)
            for group in np.unique(group_of[group_of >= 0]):
                mine = group_of == group
                size[mine] = np.sqrt(np.mean(squares[mine])) + _LEAST_SIZE
            if variance is None:
                rest = residual - columns @ mean
                freedom = residual.size - float(np.sum(covariance * gram)) / left
                left = max(1.0, float(rest @ rest) / max(1.0, freedom))
        covariance = np.asarray(np.linalg.inv(gram / left + np.diag(size**-2.0)), float)
        return cls(covariance @ aim / left, covariance, size**-2.0, left)

    @property
    def varying(self) -> FloatArray:
        """Return zeros (q,): these factors do not differ between command sequences."""
        return np.zeros(self.mean.size)

    def left_out(
        self, residual: FloatArray, columns: FloatArray, mask: npt.NDArray[np.bool_]
    ) -> tuple[FloatArray, FloatArray]:
        """Return the mean and covariance of the factors without the values of a `mask` (N,)."""
        others = columns[~mask]
        information = others.T @ others / self.variance + np.diag(self.precision)
        covariance = np.asarray(np.linalg.inv(information), float)
        return covariance @ (others.T @ residual[~mask]) / self.variance, covariance

    def left_out_costs(
        self, residual: FloatArray, columns: FloatArray, folds: npt.NDArray[np.intp]
    ) -> FloatArray:
        """Return e' C^-1 e of each fold, (f,), with e the error of what the others predict."""
        costs = []
        for fold in np.unique(folds):
            mask = folds == fold
            mean, covariance = self.left_out(residual, columns, mask)
            e, k = residual[mask] - columns[mask] @ mean, columns[mask]
            along = k.T @ e
            inner = np.linalg.inv(covariance) + k.T @ k
            costs.append(float(e @ e - along @ np.linalg.solve(inner, along)))
        return np.array(costs)


def _left(
    observations: Observations,
    noise: Noise,
    residual: Sequence[FloatArray],
    columns: Sequence[FloatArray],
    found: _Posterior,
    whitener: Whitener,
    folds: npt.NDArray[np.intp],
    data_sha256: str,
) -> ModelError:
    """Return the error that the factors do not explain in pieces of the logs that are left out."""
    r, k = whitener.whiten(residual), whitener.whiten(columns)
    error, variance = np.zeros(r.size), np.zeros(r.size)
    plain = np.concatenate(columns)
    for fold in np.unique(folds):
        mask = folds == fold
        mean, covariance = found.left_out(r, k, mask)
        error[mask] = np.concatenate(residual)[mask] - plain[mask] @ mean
        variance[mask] = np.sum((plain[mask] @ covariance) * plain[mask], axis=1)
    parts = []
    for block, rows in zip(observations.blocks, whitener.slices, strict=True):
        run = observations.situations[block.situation].runs[0]
        known = noise.variance(block, run) + variance[rows]
        parts.append(Residual(run, block.channel, block.time_s, error[rows], known))
    return estimate_model_error(parts, data_sha256)


def _columns(
    model: Model,
    basis: ShapeBasis,
    keys: Sequence[Key],
    scale: Scale,
    simulators: Simulators,
    unreached: float = 0.0,
    *,
    of_fit: bool,
    at: Model | None = None,
) -> list[FloatArray]:
    """Return K; in logs `of_fit` without what came after them, in others where the model `at` is.

    Of a wheel on the bench the last of the columns that are no shapes is a gain that is larger by a share,
    `unreached`.
    """
    observations = simulators.full.observations
    at_the_time = as_fitted if of_fit else _as_it_is
    model, varied = at_the_time(model), (fitted_variants(model), adopted_variants(model))
    here = at or model
    shapes = basis.columns(model, observations, simulators.averaged.predictions(here))
    moved, added = (
        [change(simulators.smooth, at_the_time(variant), model, here) for variant in variants]
        for variants in varied
    )
    suspects = [] if is_bench(observations) else suspect_columns(model, scale, simulators, here)
    if is_bench(observations):
        known = [np.zeros(block.value.size) for block in observations.blocks]
        other = with_other_gain(model, unreached)
        added.append(change(simulators.smooth, other, model, here) if unreached > 0.0 else known)
    found = []
    for index, block in enumerate(observations.blocks):
        parts = [column[index] for column in (*moved, *suspects, *added)]
        parts += [shapes[key][index] if key in shapes else np.zeros(block.value.size) for key in keys]
        found.append(np.stack(parts, axis=1) if parts else np.zeros((block.value.size, 0)))
    return found


def _as_it_is(model: Model) -> Model:
    return model


def _group_numbers(keys: Sequence[Key]) -> list[int]:
    groups = {key[:2]: number for number, key in enumerate(keys)}
    return [groups[key[:2]] for key in keys]


def _folds(observations: Observations) -> npt.NDArray[np.intp]:
    """Return for each value the number of its fold: its group of runs, or a piece of it."""
    names = {situation.group for situation in observations.situations}
    parts = []
    for block in observations.blocks:
        group = zlib.crc32(observations.situations[block.situation].group.encode())
        piece = 0 if len(names) >= _FEWEST_FOLDS else np.floor(block.time_s / _FOLD_S).astype(np.intp)
        parts.append(np.full(block.value.size, group, np.intp) + piece)
    return np.concatenate(parts)
