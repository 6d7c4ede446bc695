"""The models that a model's stated uncertainty allows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.model import Model, paper_model
from mecanum_env.simulator import replay_bench
from sysid.compare.nuisance import plausible_models


def test_effects_that_were_fitted_with_the_law_stay_within_what_can_be_simulated() -> None:
    base: Model = paper_model()
    model = base.with_effect("backlash", gap_deg=1.0).with_effect("command_latency", delay_s=0.02)
    names = [*COEFFICIENTS, "backlash.gap_deg", "command_latency.delay_s"]
    spread = np.array([*np.full(6, 1e-6), 30.0, 0.01])
    stated = {"names": names, "covariance": np.diag(spread**2).tolist()}
    found = plausible_models(replace(model, uncertainty={"joint": stated}))
    assert len(found) == len(names)
    for other in found:
        replay_bench(other, np.arange(50) * 0.01, np.full(50, 60.0))
    delays = {round(other.effects["command_latency"]["delay_s"], 6) for other in found}
    assert delays > {0.02}
