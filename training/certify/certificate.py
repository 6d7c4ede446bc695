"""What a certificate holds, the checks of its metrics against the thresholds, and its JSON file."""

from __future__ import annotations

import os
import types
import typing
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, Final, Literal

from mecanum_env.errors import InputError
from mecanum_env.files import write_json
from mecanum_env.outputs import require_whole
from mecanum_env.reading import read_json
from training.certify.plants import Group
from training.certify.thresholds import Thresholds
from training.certify.warning import WarningCurve
from training.evaluate import Mean, Share

FORMAT: Final = "mecanum-certificate/1"


@dataclass(frozen=True)
class VariantResult:
    """Metrics of the dodge on one plant."""

    name: str
    group: Group
    summary: str
    physics: str
    success: Share
    by_technique: Mapping[str, Share]
    """Technique of the opponent -> success."""
    failures: Mapping[str, int]
    """Reason of failure -> number of episodes."""
    change: Mean | None
    """Success minus that on the nominal plant, seed by seed; None on the nominal plant itself."""
    settling_s: Mean | None
    """Time until the robot is at maai and facing, over the episodes in which it gets there [s]."""
    overshoot: Mean | None
    saturated_share: Mean
    speed_error_m_s: Mean
    """RMS of the commanded minus the actual velocity [m/s]."""
    duration_s: Mean
    total_reward: Mean


@dataclass(frozen=True)
class TrackingResult:
    """Metrics of the tracking task on the nominal plant."""

    success: Share
    distance_error_m: Mean | None
    """RMS of distance - maai of an episode [m]; None if no episode lasted until tracking counts."""
    bearing_error_rad: Mean | None
    """RMS of the bearing of an episode [rad]."""


@dataclass(frozen=True)
class Timing:
    """Processor time per command, on the machine that wrote the certificate."""

    p50_s: float
    p99_s: float
    longest_s: float
    commands: int
    """Number of timed commands."""


@dataclass(frozen=True)
class Check:
    """The comparison of one metric with its threshold."""

    name: str
    text: str
    """The metric with its interval."""
    value: float | None
    """The worse end of the interval; None: not defined, which does not pass."""
    sense: Literal["at least", "at most"]
    limit: float
    unit: str
    """Unit of value and limit; empty for shares."""
    passed: bool


@dataclass(frozen=True)
class Certificate:
    """The results of a controller; equal for the same controller, model and seeds."""

    controller: str
    plants: tuple[VariantResult, ...]
    """The nominal one first."""
    warning: WarningCurve
    track: TrackingResult
    thresholds: Thresholds
    checks: tuple[Check, ...]
    """All but that of the time per command."""
    notes: tuple[str, ...]
    provenance: Mapping[str, str | int]
    timing: Timing = field(compare=False)
    """Depends on the machine and is ignored by `==`."""
    timing_check: Check = field(compare=False)

    @property
    def nominal(self) -> VariantResult:
        """The result on the model itself."""
        return self.plants[0]

    @property
    def worst(self) -> VariantResult:
        """The result on the plant with the smallest success, the first one of several."""
        return min(self.plants, key=lambda plant: plant.success.value)

    @property
    def all_checks(self) -> tuple[Check, ...]:
        """All checks, that of the time per command last."""
        return (*self.checks, self.timing_check)

    @property
    def passed(self) -> bool:
        """Whether every check passed."""
        return all(check.passed for check in self.all_checks)


def checks(
    nominal: VariantResult,
    worst: VariantResult,
    warning: WarningCurve,
    track: TrackingResult,
    thresholds: Thresholds,
) -> tuple[Check, ...]:
    """Return all checks except that of the time per command, from the results on these plants and tasks."""
    t = thresholds
    worst_text = f"{share_text(worst.success)} on {worst.name}"
    needed = warning.high_s if warning.needed_s is not None else None
    asked = f"warning for {warning.target:.0%} success"
    return (
        _at_least("nominal success", share_text(nominal.success), nominal.success.low, t.success),
        _at_least("worst-plant success", worst_text, worst.success.low, t.worst_success),
        _at_most(asked, warning_text(warning), needed, t.warning_s, "s"),
        _mean_at_most("tracking error", track.distance_error_m, t.tracking_m, "m"),
        _mean_at_most("settling", nominal.settling_s, t.settling_s, "s"),
        _mean_at_most("overshoot", nominal.overshoot, t.overshoot),
        _mean_at_most("commands that saturate a wheel", nominal.saturated_share, t.saturated_share),
    )


def timing_check(timing: Timing, thresholds: Thresholds) -> Check:
    """Return the check of the time per command."""
    text = f"p50 {milliseconds(timing.p50_s)}, p99 {milliseconds(timing.p99_s)}"
    return _at_most("time for a command, p99", text, timing.p99_s, thresholds.command_s, "s")


def share_text(found: Share) -> str:
    """Return a share with its interval, such as "0.58 (0.51 .. 0.65)"."""
    return f"{found.value:.2f} ({found.low:.2f} .. {found.high:.2f})"


def warning_text(curve: WarningCurve) -> str:
    """Return the warning needed by a curve, with its interval."""
    longest = f"more than {curve.range_s[1]:g}"
    if curve.needed_s is None:
        best = max(range(len(curve.success)), key=lambda i: curve.success[i])
        return f"not reached; at best {curve.success[best]:.2f} at {curve.warning_s[best]:.2f} s"
    low, high = (longest if end is None else f"{end:.2f}" for end in (curve.low_s, curve.high_s))
    text = f"{curve.needed_s:.2f} s ({low} .. {high})"
    return text if curve.holds_to_s is None else f"{text}, up to {curve.holds_to_s:.2f} s"


def milliseconds(seconds: float) -> str:
    """Return a time in ms as text."""
    return f"{1e3 * seconds:.3g} ms"


def mean_text(found: Mean | None, unit: str = "") -> str:
    """Return a mean with its interval in a unit; "never" for None."""
    if found is None:
        return "never"
    return f"{found.value:.2f}{' ' * bool(unit)}{unit} ({found.low:.2f} .. {found.high:.2f})"


def _at_least(name: str, text: str, value: float | None, limit: float) -> Check:
    return Check(name, text, value, "at least", limit, "", value is not None and value >= limit)


def _at_most(name: str, text: str, value: float | None, limit: float, unit: str = "") -> Check:
    return Check(name, text, value, "at most", limit, unit, value is not None and value <= limit)


def _mean_at_most(name: str, found: Mean | None, limit: float, unit: str = "") -> Check:
    return _at_most(name, mean_text(found, unit), None if found is None else found.high, limit, unit)


def certificate_to_dict(certificate: Certificate) -> dict[str, Any]:
    """Return a certificate as a JSON object.

    Only `timing`, `timing_check` and, if the time decides, `passed` depend on the machine.
    """
    head = {"format": FORMAT, "passed": certificate.passed, "worst_plant": certificate.worst.name}
    return head | asdict(certificate)


def write_certificate(certificate: Certificate, path: str | os.PathLike[str]) -> None:
    """Write a certificate to a path as JSON, whole or not at all."""
    write_json(path, certificate_to_dict(certificate))


def read_certificate(path: str | os.PathLike[str]) -> Certificate:
    """Read the certificate in a file, given by its path.

    Raises:
        InputError: there is no such file, or it is not JSON or not a certificate.
    """
    path = Path(path)
    require_whole(path)
    value = read_json(path, "make one with `python -m training.certify`")
    found = value.get("format") if isinstance(value, dict) else None
    if found != FORMAT:
        raise InputError(f'{path}: "format" is {found!r}, must be "{FORMAT}"')
    try:
        return typing.cast(Certificate, _read(Certificate, value, "certificate"))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _read(kind: Any, value: Any, where: str) -> Any:
    """Return a value of type `kind` from its JSON form; `where` names it in messages."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is types.UnionType:
        choices = [one for one in arguments if one is not types.NoneType]
        return None if value is None else _read(choices[0] if len(choices) == 1 else Any, value, where)
    if is_dataclass(kind) and isinstance(kind, type):
        if not isinstance(value, dict):
            raise InputError(f"{where}: must be an object, not {value!r}")
        hints = typing.get_type_hints(kind)
        missing = [one.name for one in fields(kind) if one.name not in value]
        if missing:
            raise InputError(f"{where}: lacks {', '.join(missing)}")
        return kind(**{n: _read(hints[n], value[n], f"{where}.{n}") for n in (f.name for f in fields(kind))})
    if origin is tuple:
        if not isinstance(value, list):
            raise InputError(f"{where}: must be a list, not {value!r}")
        kinds = arguments[:1] * len(value) if arguments[-1] is Ellipsis else arguments
        pairs = enumerate(zip(kinds, value, strict=True))
        return tuple(_read(one, item, f"{where}[{i}]") for i, (one, item) in pairs)
    if origin is not None and isinstance(value, dict):
        return {key: _read(arguments[1], item, f"{where}.{key}") for key, item in value.items()}
    if kind is float and (isinstance(value, bool) or not isinstance(value, int | float)):
        raise InputError(f"{where}: must be a number, not {value!r}")
    return value
