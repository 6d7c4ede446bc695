"""What a certificate holds, and its JSON file."""

from __future__ import annotations

import os
import types
import typing
from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, Final

from mecanum_env.errors import InputError
from mecanum_env.files import write_json
from mecanum_env.outputs import require_whole
from mecanum_env.reading import read_json
from training.certify.checks import Check
from training.certify.plants import APART, HELD_OUT
from training.certify.results import Timing, TrackingResult, VariantResult, worst_of
from training.certify.thresholds import Thresholds
from training.certify.warning import WarningCurve

FORMAT: Final = "mecanum-certificate/1"


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
        """The result on the plant with the smallest success, the first of several.

        Held-out rows and the adversary do not count.
        """
        return worst_of([plant for plant in self.plants if plant.group not in APART])

    @property
    def held_out(self) -> tuple[VariantResult, ...]:
        """The results on plants and against opponents that no training has seen."""
        return tuple(plant for plant in self.plants if plant.group == HELD_OUT)

    @property
    def all_checks(self) -> tuple[Check, ...]:
        """All checks, that of the time per command last."""
        return (*self.checks, self.timing_check)

    @property
    def passed(self) -> bool:
        """Whether every check passed; one that is undecided has not."""
        return all(check.passed for check in self.all_checks)


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
        missing = [one.name for one in fields(kind) if one.name not in value and one.default is MISSING]
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
