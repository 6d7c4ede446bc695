"""New logs of a robot that repeat the commands of the logs of the model's fit."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from sysid.compare.least_squares import ResidualProblem
from sysid.compare.measured import observe, pieces
from sysid.compare.model_error import DifferenceCounts, Moved, RepeatedCommands, Whitener, repeated_commands
from sysid.compare.model_error.repeated import _calibrated
from sysid.compare.model_error.series import _kept_variance
from sysid.logs import Dataset
from tests.compare.repeated_logs import GAIN, MODEL, NOISE, NOMINAL, PLANAR, logs


def compared(fitted_on: Dataset, new: Dataset) -> RepeatedCommands | None:
    return repeated_commands(MODEL, fitted_on, observe(new), PLANAR)


def ratio(found: RepeatedCommands) -> float:
    """Return the mean squared residual beside the logs of the fit, in the variance of repeats."""
    whitener = Whitener(found.observations, found.noise, None)
    problem = ResidualProblem(MODEL, whitener, PLANAR, None, found)
    # Twice the variance of repeats is counted.
    return 2.0 * float(np.mean(problem.marginal(problem.base_residual) ** 2))


def test_the_error_that_both_logs_show_is_taken_off() -> None:
    found = compared(NOMINAL, logs(GAIN, (1, 2, 3, 4), seed=11))
    assert found is not None
    assert 0.8 < ratio(found) < 1.3
    plain = Whitener(found.observations, found.noise, None)
    assert float(np.mean(ResidualProblem(MODEL, plain, PLANAR).base_residual ** 2)) > 10.0


def test_what_is_new_stays() -> None:
    found = compared(NOMINAL, logs(GAIN - 0.02, (1, 2, 3, 4), seed=11))
    assert found is not None
    assert ratio(found) > 2.0


def test_logs_that_begin_earlier_hold_the_same_commands() -> None:
    nominal, late = logs(GAIN, (1, 2, 3), seed=12), logs(GAIN, (1, 2, 3), seed=13, late_s=0.2)
    found = compared(nominal, late)
    assert found is not None
    assert ratio(found) < 1.3
    # The last .2 s of the commands are not in the late logs.
    assert compared(late, nominal) is None
    # A clock of another phase makes other commands of them.
    assert compared(nominal, logs(GAIN, (1, 2, 3), seed=13, late_s=0.25)) is None


def test_other_commands_are_no_repetition() -> None:
    assert compared(NOMINAL, logs(GAIN, (5, 6, 7), seed=11)) is None
    assert compared(NOMINAL, logs(GAIN, (1, 5, 6), seed=11)) is None


def test_of_mixed_logs_the_repeated_sequences_decide() -> None:
    found = compared(NOMINAL, logs(GAIN, (1, 2, 5), seed=11))
    assert found is not None
    groups = {found.observations.situations[block.situation].group for block in found.observations.blocks}
    assert groups == {"1", "2"}


def test_a_mean_of_more_repeats_is_known_better() -> None:
    once, thrice = (
        compared(logs(GAIN, (1, 2, 3), seed=14, repeats=n), logs(GAIN, (1, 2, 3), seed=15)) for n in (1, 3)
    )
    assert once is not None
    assert thrice is not None
    weights = [float(np.mean(one.observations.blocks[0].weight)) for one in (once, thrice)]
    np.testing.assert_allclose(weights, [1.0 / (1.0 + 1.0 / 2.0), 1.0 / (1.0 / 3.0 + 1.0 / 2.0)])
    # Without repeats nothing tells what differs from run to run.
    assert not once.scatters
    assert len(thrice.scatters) == 3
    # Three sequences with two independent differences each.
    assert (once.difference_counts.shared, thrice.difference_counts.shared) == (math.inf, 6.0)


def test_repeats_of_the_new_logs_and_of_other_commands_tell_what_varies_too() -> None:
    new = logs(GAIN, (1, 2), seed=15, repeats=3)
    found = compared(logs(GAIN, (1, 2, 3, 4, 5), seed=14), new)
    assert found is not None
    # Two sequences in both logs with one difference in the first and two in the second, and three others.
    assert found.difference_counts == DifferenceCounts(2.0 + 4.0 + 3.0, 2.0)
    # All of them have the variance of the difference of both logs, half of which is counted twice.
    white = Whitener(found.observations, found.noise, None)
    assert found.further is not None
    moved = Moved(np.zeros(white.size), MODEL.with_effect("speed_gain", gain=0.9), smooth=True)
    others = found.further.scatter(found.noise, [moved])
    own = np.stack([white.whiten(parts) for parts in found.fresh], axis=1)
    for differences in (own, others.differences):
        assert 0.8 < 2.0 * float(np.mean(differences**2)) < 1.25
    assert np.linalg.norm(others.columns) > 10.0


def of_own_gains(sequences: tuple[int, ...], seed: int) -> Dataset:
    """Return two runs of each sequence, of which the second is of a robot with another gain."""
    one, two = logs(GAIN, sequences, seed, repeats=1), logs(GAIN - 0.02, sequences, seed + 1, repeats=1)
    second = [replace(run, file=run.file.replace("_0", "_1")) for run in two.runs]
    return replace(one, runs=(*one.runs, *second))


def varying(found: RepeatedCommands) -> int:
    """Return how many means of repeats, one of each sequence, are found to vary along the gain."""
    whitener = Whitener(found.observations, found.noise, None)
    problem = ResidualProblem(MODEL, whitener, PLANAR, None, found)
    other = MODEL.with_effect("speed_gain", gain=0.97)
    (change,) = problem.changes([other], surrogate=True, reference=MODEL)
    assert change is not None
    columns = found.with_varying(whitener, [Moved(change, other, smooth=True)]).varying
    assert columns is not None
    assert columns.shape[0] == whitener.size
    return int(columns.shape[1])


def test_repeats_of_other_commands_show_what_varies_from_run_to_run() -> None:
    own, others = logs(GAIN, (1, 2), seed=14), of_own_gains((3, 4, 5), seed=30)
    found = compared(replace(own, runs=(*own.runs, *others.runs)), logs(GAIN, (1, 2), seed=15))
    assert found is not None
    assert varying(found) == 2
    assert varying(replace(found, further=None)) == 0


def test_repeats_of_the_new_logs_show_what_varies_from_run_to_run() -> None:
    found = compared(NOMINAL, of_own_gains((1, 2, 3, 4), seed=32))
    assert found is not None
    assert varying(found) == 4
    assert varying(replace(found, fresh=())) == 0


def test_changes_of_command_are_late_in_other_commands_too() -> None:
    of_fit, new = (
        logs(GAIN, which, seed, jitter_s=0.02) for which, seed in (((1, 2, 3, 4), 34), ((1, 2), 35))
    )
    found = compared(of_fit, new)
    assert found is not None
    assert found.further is not None
    assert sum(float(np.sum(part**2)) for part in found.further.late) > 0.0


def test_noise_is_not_smaller_beside_the_only_sample_of_a_channel() -> None:
    np.testing.assert_array_equal(_kept_variance(np.array([0.0, 0.5, 1.0]), np.array([0.5])), 1.0)
    between = _kept_variance(np.array([0.0, 0.5, 1.0]), np.array([0.0, 1.0]))
    np.testing.assert_array_equal(between, [1.0, 0.5, 1.0])


def test_luck_is_less_where_more_repeats_tell_the_noise() -> None:
    found = compared(logs(GAIN, (1, 2, 3, 4, 5), seed=14), logs(GAIN, (1, 2), seed=15))
    assert found is not None
    every, own = (
        np.quantile(found.luck(np.random.default_rng(0), 4000, count), 0.99)
        for count in (found.difference_counts.every, found.difference_counts.shared)
    )
    assert 1.0 < every < 0.2 * own


def test_chance_gains_more_where_fewer_runs_tell_the_noise() -> None:
    found = compared(logs(GAIN, (1, 2, 3), seed=14), logs(GAIN, (1, 2, 3), seed=15))
    assert found is not None
    few, many, endless = (
        np.quantile(found.luck(np.random.default_rng(0), 4000, n), 0.99) for n in (3.0, 12.0, math.inf)
    )
    # Chi-squared values of 3 and 12 degrees of freedom are below 0.115 and 3.57 once in a hundred times.
    np.testing.assert_allclose([few, many, endless], [3.0 / 0.115 / 2.0, 12.0 / 3.57 / 2.0, 1.0], rtol=0.1)


def test_new_samples_count_no_more_than_those_of_the_logs_that_give_the_noise() -> None:
    """Noise that grows with the speed may have been found in the one logs and not in the others."""
    new = logs(GAIN, (1, 2, 3), seed=15)
    less = [
        replace(run, weights={name: np.full(run.time_s.size, 0.25) for name in run.channels})
        for run in NOMINAL.runs
    ]
    found = compared(replace(NOMINAL, runs=tuple(less)), new)
    assert found is not None
    # Two repeats in each, of a quarter of a sample each.
    np.testing.assert_allclose(found.observations.blocks[0].weight, 1.0 / (1.0 / 0.5 + 1.0 / 0.5))


def test_noise_that_is_too_small_for_the_repeats_grows_to_twice_what_they_differ_by() -> None:
    found = compared(NOMINAL, logs(GAIN, (1, 2, 3, 4), seed=11))
    assert found is not None
    noise = found.noise
    small = replace(noise, sigma={name: 0.1 * sigma for name, sigma in noise.sigma.items()})
    grown, freedom = _calibrated(small, found.observations, found.scatters, "robot")
    whitener = Whitener(found.observations, grown, None)
    white = np.array([whitener.whiten(scatter) for scatter in found.scatters])
    np.testing.assert_allclose(2.0 * np.mean(white**2), 1.0, rtol=0.02)
    assert freedom > 10.0  # what four sequences of white noise show


def test_a_run_without_measured_samples_is_left_out() -> None:
    first, *others = NOMINAL.runs
    nothing = {name: np.full(values.size, np.nan) for name, values in first.channels.items()}
    found = compared(replace(NOMINAL, runs=(replace(first, channels=nothing), *others)), NOMINAL)
    assert found is not None
    # Of the first sequence one repeat is left, so that not all of the sequences tell what repeats differ by.
    assert not found.scatters


def test_pieces_of_a_long_run_are_found_in_the_run_that_repeats_it() -> None:
    before, after = (logs(GAIN, (1,), seed, length_s=22.0) for seed in (16, 17))
    cut = tuple(piece for run in after.runs for piece in pieces(run, MODEL.wheel.command_period_s))
    found = compared(before, replace(after, runs=cut))
    assert found is not None
    groups = [situation.group for situation in found.observations.situations]
    assert len(set(groups)) == len(groups) == len(cut) / 2 > 2
    assert ratio(found) < 1.3


def test_a_piece_of_the_fit_counts_once_beside_new_runs_of_different_stamps() -> None:
    before, after = (logs(GAIN, (1,), seed, length_s=22.0) for seed in (16, 17))
    late = logs(GAIN, (1,), 18, length_s=22.0, late_s=0.1)
    period_s = MODEL.wheel.command_period_s
    cut = tuple(piece for run in (after.runs[0], late.runs[0]) for piece in pieces(run, period_s))
    found = compared(before, replace(after, runs=cut))
    assert found is not None
    of_fit = found.whitener.observations.situations
    # Two runs were recorded for the fit.
    assert {len(situation.runs) for situation in of_fit} == {2}


def test_commands_that_act_at_other_times_are_no_noise_of_held_ones() -> None:
    late = logs(GAIN, (1, 2, 3, 4), seed=16, jitter_s=0.02)
    found = compared(late, logs(GAIN, (1, 2, 3, 4), seed=17, jitter_s=0.02))
    assert found is not None
    # Twice the variance counts, as everywhere on a robot.
    assert found.noise.sigma["speed_fl_rpm"] < 3.0 * NOISE["speed_fl_rpm"]
    assert ratio(found) < 1.5
    # One delay moves all channels until the next change, in one run.
    blocks, parts = found.observations.blocks, found.late
    assert any(np.any(part != 0.0) for part in parts)
    for column in range(parts[0].shape[1]):
        moved = [block for block, part in zip(blocks, parts, strict=True) if np.any(part[:, column] != 0.0)]
        assert len({block.situation for block in moved}) <= 1
        assert len({block.channel for block in moved}) in (0, len(found.noise.sigma))
