"""Success rates: definitions, intervals and shared starts."""

import math

import numpy as np
import pytest

from sysid.studies.reproduce.contenders import (
    CONTENDERS,
    OURS,
    QUICK,
    USABLE_RMS_RPM,
    identify,
    identify_from,
    shared_starts,
)


def test_usable_is_the_papers_own_optimum():
    assert math.isclose(USABLE_RMS_RPM**2, 21.80)


def test_fewer_starts_are_the_first_of_more():
    assert shared_starts(10, 3) == shared_starts(50, 3)[:10]
    assert shared_starts(10, 3) != shared_starts(10, 4)


@pytest.mark.parametrize("name", ["output-error", "kkt", "gradient", "poles", "kkt-adaptive"])
def test_all_methods_start_from_the_same_laws(name, quick):
    initial = [start.initial for start in quick.estimates[name].starts]
    assert tuple(initial) == shared_starts(10, 0)


def test_output_error_always_succeeds_and_is_always_stable(quick):
    for rates in (quick.ten_starts[OURS], quick.many_starts[OURS]):
        assert rates.success.share == rates.stable.share == rates.success_and_stable.share == 1.0
        assert rates.unstable_starts.count > 0  # although half of its starts are not


@pytest.mark.parametrize("name", ["kkt", "poles", "kkt-improved", "kkt-adaptive", "poles-adaptive"])
def test_constrained_methods_are_always_stable(name, quick):
    assert quick.many_starts[name].stable.share == 1.0


def test_the_unconstrained_method_is_not(quick):
    assert quick.many_starts["gradient"].stable.share < 1.0


def test_adaptive_steps_get_further_than_the_constant_rate(quick):
    for name in ("gradient", "kkt", "poles"):
        fixed, adaptive = quick.many_starts[name], quick.many_starts[f"{name}-adaptive"]
        assert np.median(adaptive.rms_rpm) < 0.2 * np.median(fixed.rms_rpm)


def test_counts_are_consistent(quick):
    for rates in (*quick.ten_starts.values(), *quick.many_starts.values()):
        assert rates.success_and_stable.count <= min(rates.success.count, rates.stable.count)
        assert rates.success.count <= rates.usable.count
        assert rates.diverged.count + rates.out_of_iterations.count <= rates.starts == len(rates.rms_rpm)
        assert np.all(np.diff(rates.rms_rpm[np.isfinite(rates.rms_rpm)]) >= 0.0)


def test_one_start_alone_ends_where_it_ends_among_others(data):
    contender = CONTENDERS["kkt"]
    together = identify(data.fit_runs, contender, QUICK, 0, 3)
    alone = identify_from(data.fit_runs, contender, QUICK, 0, 2)
    np.testing.assert_allclose(
        alone.starts[0].coefficients, together.starts[2].coefficients, rtol=1e-6, atol=1e-9
    )


def test_a_search_that_diverges_alone_gives_none(data):
    fates = [identify_from(data.fit_runs, CONTENDERS["gradient"], QUICK, 0, i) for i in range(10)]
    assert any(fate is None for fate in fates)
    assert any(fate is not None for fate in fates)
