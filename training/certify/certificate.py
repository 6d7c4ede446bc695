"""What a certificate holds, and its JSON file."""

from __future__ import annotations

import json
import os
import types
import typing
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, Final, Literal

from mecanum_env.errors import InputError
from mecanum_env.files import write_json
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


def certificate_to_dict(certificate: Certificate) -> dict[str, Any]:
    """Return a certificate as a JSON object.

    Only `timing`, `timing_check` and, if the time decides, `passed` depend on the machine.
    """
    head = {"format": FORMAT, "passed": certificate.passed, "worst_plant": certificate.worst.name}
    return head | asdict(certificate)


def certificate_from_dict(value: Mapping[str, Any]) -> Certificate:
    """Return the certificate in a JSON object, a value that `certificate_to_dict` returned.

    Raises:
        InputError: the format is another one, or a field is missing or of another type.
    """
    if value.get("format") != FORMAT:
        raise InputError(f'"format" is {value.get("format")!r}, must be "{FORMAT}"')
    found: Certificate = _read(Certificate, value, "certificate")
    return found


def write_certificate(certificate: Certificate, path: str | os.PathLike[str]) -> None:
    """Write a certificate to a path as JSON, whole or not at all."""
    write_json(path, certificate_to_dict(certificate))


def read_certificate(path: str | os.PathLike[str]) -> Certificate:
    """Read the certificate in a file, given by its path.

    Raises:
        InputError: there is no such file, or it is not JSON or not a certificate.
    """
    path = Path(path)
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); make one with `python -m training.certify`"
        ) from error
    except ValueError as error:
        raise InputError(f"{path}: not valid JSON ({error})") from error
    try:
        return certificate_from_dict(value if isinstance(value, dict) else {})
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
        return kind(
            **{
                one.name: _read(hints[one.name], value[one.name], f"{where}.{one.name}")
                for one in fields(kind)
            }
        )
    if origin is tuple:
        if not isinstance(value, list):
            raise InputError(f"{where}: must be a list, not {value!r}")
        kinds = arguments[:1] * len(value) if arguments[-1] is Ellipsis else arguments
        return tuple(
            _read(one, item, f"{where}[{i}]") for i, (one, item) in enumerate(zip(kinds, value, strict=True))
        )
    if origin is not None and isinstance(value, dict):
        return {key: _read(arguments[1], item, f"{where}.{key}") for key, item in value.items()}
    if kind is float and (isinstance(value, bool) or not isinstance(value, int | float)):
        raise InputError(f"{where}: must be a number, not {value!r}")
    return value
