"""The experiment as JSON: format "mecanum-reproduce/1"."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

import mecanum_env
from mecanum_env.law.coefficients import COEFFICIENTS
from sysid.studies.reproduce import published
from sysid.studies.reproduce.contenders import CONTENDERS
from sysid.studies.reproduce.experiment import Reproduction
from sysid.studies.reproduce.starts import USABLE_RMS_RPM, Rate
from sysid.studies.reproduce.why import comparisons

FORMAT: Final = "mecanum-reproduce/1"


def reproduction_json(found: Reproduction) -> dict[str, Any]:
    """Return all results as a JSON object, with null for infinite and missing numbers.

    Curves are rounded to six significant digits, single numbers are not.
    """
    laws = {
        name: {
            **{key: getattr(estimate.law, key) for key in COEFFICIENTS},
            "sample_period_s": estimate.law.sample_period_s,
            "pole_magnitudes": np.abs(estimate.law.poles),
            "stable": estimate.law.is_stable,
            "rms_rpm": estimate.rms_rpm,
            "starts": [
                {"initial": s.initial, "rms_rpm": s.rms_rpm, "stable": s.stable, "iterations": s.iterations}
                for s in estimate.starts
            ],
        }
        for name, estimate in found.estimates.items()
    }
    return {
        "format": FORMAT,
        "version": mecanum_env.__version__,
        "seed": found.seed,
        "effort": _plain(found.effort),
        "methods": {name: contender.label for name, contender in CONTENDERS.items()},
        "definitions": {
            "success": f"rms within 5 % of {found.best_rms_rpm:.4f} rpm, the best of a stable law",
            "usable": f"rms at most {USABLE_RMS_RPM:.3f} rpm: H at most {published.OPTIMAL_COST_RPM2} rpm^2",
        },
        "best_rms_rpm": found.best_rms_rpm,
        "sigma_rpm": found.sigma_rpm,
        "fitted_ceiling_rpm": _plain(found.fitted_ceiling_rpm),
        "laws": _plain(laws),
        "starts": {"ten": _plain(found.ten_starts), "many": _plain(found.many_starts)},
        "steps": {"target": _plain(found.target), "models": _plain(found.models)},
        "errors": _plain(found.errors),
        "costs": _plain(found.costs),
        "robot": _plain(found.robot),
        "responses": {
            "steps": _plain(found.shown),
            "beyond": _plain(found.beyond),
            "beyond_limited": _plain(found.beyond_limited),
            "trials": _plain(found.trials),
        },
        "comparisons": _plain(comparisons(found)),
    }


def _plain(value: Any) -> Any:
    """Return a value as JSON can hold it, like `mecanum_env.files.plain_json`, but with arrays rounded."""
    if isinstance(value, Rate):
        return {
            "count": value.count,
            "of": value.of,
            "share": value.share,
            "low": value.low,
            "high": value.high,
        }
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray):
        return [_rounded(x) for x in value.tolist()]
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def _rounded(value: float) -> float | None:
    return float(f"{value:.6g}") if math.isfinite(value) else None
