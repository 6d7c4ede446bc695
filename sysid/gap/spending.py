"""False alarms over all studies of the same logs: each new study spends half of what the earlier ones left.

Whoever studies the same logs again and again, with other models or other effects to look for, finds something
by chance sooner or later. The levels of all studies of the same logs therefore add up to no more than twice
that of a single one: by the union bound that is the probability of any false alarm among them. (Spending a
level on hypotheses that come one after the other: Foster and Stine, J. R. Statist. Soc. B 70:429, 2008; with
halves, and without winning any back.) The same study again, of the same logs with the same model and
settings, has the level that it had, and spends nothing.

What was spent is written where the studies' results are: into gap.json, and into the provenance of the model.
So it needs no place of its own, and says nothing of other logs.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

from mecanum_env.model import Model
from mecanum_env.model.file import model_to_dict
from sysid.gap.result import GapOptions, Spent
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.logs import Dataset

STUDIES: Final = "studies"
"""Key of what was spent, in gap.json and in a model's provenance."""
_OF_ALL: Final = 2.0
"""Level of all studies together, in those of a single one."""
_NO_MATTER: Final = ("jobs", "adopt", "next_experiment", "fitted_on", "fitted_here", "notes", "earlier")
"""Options that no decision depends on, or that are described otherwise."""


@dataclass(frozen=True)
class Budget:
    """The level of a study, and all studies of its logs that are known, this one included."""

    level: float
    studies: tuple[Spent, ...]

    @property
    def notes(self) -> tuple[str, ...]:
        """What the report says of it, in sentences: nothing about a first study."""
        others = len(self.studies) - 1
        if self.level == THRESHOLDS.false_alarm or others < 1:
            return ()
        times = "once" if others == 1 else f"{others} times"
        return (
            f"these logs were studied {times} in another way: noise alone is taken for an effect with a "
            f"probability of {self.level:.2%} in this study, so that all of them stay below "
            f"{_OF_ALL * THRESHOLDS.false_alarm:.0%}",
        )


def budget_of(dataset: Dataset, model: Model, options: GapOptions) -> Budget:
    """Return the probability of a false alarm that a study may spend.

    Earlier studies are those of the options, and those that the model was made by. Logs without a checksum,
    which were read from no files, are not recognised again: their study has the level of a single one.
    """
    alone = THRESHOLDS.false_alarm
    if not dataset.sha256:
        return Budget(alone, ())
    stated = read_spent(model.provenance.get(STUDIES))
    known = {one.study: one for one in (*stated, *options.earlier) if one.data_sha256 == dataset.sha256}
    key = _key(dataset, model, options)
    earlier = tuple(sorted(known.values(), key=lambda one: (-one.level, one.study)))
    if key in known:
        return Budget(known[key].level, earlier)
    left = _OF_ALL * alone - sum(one.level for one in earlier)
    if left <= 0.0:
        # Studies that did not know of each other have spent more than there was.
        left = min(one.level for one in earlier)
    return Budget(0.5 * left, (*earlier, Spent(dataset.sha256, key, 0.5 * left)))


def with_studies(model: Model, studies: Sequence[Spent]) -> Model:
    """Return a model that says which studies of which logs made it; those of other logs stay."""
    logs = {one.data_sha256 for one in studies}
    others = [one for one in read_spent(model.provenance.get(STUDIES)) if one.data_sha256 not in logs]
    stated = [asdict(one) for one in (*others, *studies)]
    return replace(model, provenance={**model.provenance, STUDIES: stated}) if stated else model


def studies_near(out: Path) -> tuple[Spent, ...]:
    """Return what the studies spent whose gap.json lies in the folder `out` or in one beside it.

    Files that are no results of a study are passed over.
    """
    folders = [out, *sorted(path for path in out.resolve().parent.glob("*") if path.is_dir())]
    found: dict[Spent, None] = {}
    for folder in folders:
        try:
            stated = json.loads((folder / "gap.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            continue
        if isinstance(stated, Mapping):
            found.update(dict.fromkeys(read_spent(stated.get(STUDIES))))
    return tuple(found)


def read_spent(value: Any) -> tuple[Spent, ...]:
    """Return what studies spent from the list in a file; what is no such entry is left out."""
    return tuple(_entries(value if isinstance(value, list) else []))


def _entries(rows: Iterable[Any]) -> Iterable[Spent]:
    for row in rows:
        if isinstance(row, Mapping):
            logs, study, level = (row.get(name) for name in ("data_sha256", "study", "level"))
            if isinstance(logs, str) and isinstance(study, str) and isinstance(level, float) and level > 0.0:
                yield Spent(logs, study, level)


def _key(dataset: Dataset, model: Model, options: GapOptions) -> str:
    """Return a checksum of all that decides: the logs, the model apart from its history, and the settings."""
    settings = {name: value for name, value in vars(options).items() if name not in _NO_MATTER}
    described = {name: value for name, value in model_to_dict(model).items() if name != "provenance"}
    fitted_on = None if options.fitted_on is None else options.fitted_on.sha256
    whole = [dataset.sha256, fitted_on, described, settings]
    return hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()[:16]
