"""One bench case per seed: a drive, what is hidden in it, and the logs of both states."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np

from sysid.studies.zoo.cases.bench.change import Change
from sysid.studies.zoo.cases.bench.changes import CHANGES, TWINS, UNSEEN_WHEN_GENTLE, change_of, slow_twins
from sysid.studies.zoo.cases.bench.outsiders import FAR_OUTSIDERS, NEAR_OUTSIDERS, Outsider
from sysid.studies.zoo.cases.bench.plans import CASE_PLANS, FIT_PLANS, GENTLE, Commands, plan
from sysid.studies.zoo.cases.bench.size import TARGETS, Apply, Solved, Yardstick, solve_size
from sysid.studies.zoo.cases.case import Case, Driven, Hidden, Kind
from sysid.studies.zoo.cases.layouts import LAYOUTS, STANDARD, Layout, draw_layout, layout_again
from sysid.studies.zoo.drives.draw import draw_drive
from sysid.studies.zoo.drives.drive import Drive, Family
from sysid.studies.zoo.drives.families import FAMILIES

BLOCK: Final = 50
"""Seeds after which the kinds come again."""

SHARES: Final[dict[Kind, int]] = {
    "quiet": 13,
    "single": 20,
    "pair": 5,
    "triple": 2,
    "twin": 2,
    "untestable": 2,
    "near_outsider": 3,
    "far_outsider": 3,
}
"""Cases of each kind in a block."""

_MEMBER_TARGETS: Final = (0.5, TARGETS[1])
"""Wanted traces of each effect of a pair or triple: one that cannot be seen would make it a single."""
_HIDDEN_TARGETS: Final = (3.0, TARGETS[1])
"""Wanted traces of an untestable effect in logs that would show it."""
_UNSEEN: Final = 0.1
"""Trace of an untestable effect in the logs of its case, at most."""
_DRIVES_PER_FAMILY: Final = 4
_TRIES: Final = 4
"""Drives and plans that are tried where the wanted trace is out of reach."""
_ENOUGH: Final = 0.7
"""Share of the wanted trace that is taken as reached."""

# Stages of the generators: [seed, stage, ...].
KINDS, FORMS, FAMILY, LAYOUT, COMMANDS, SIZE, CHANGE, DRIVE, PARTNERS, NOISE = range(10)

T = TypeVar("T")


@dataclass(frozen=True)
class _Asked:
    """What a seed asks for."""

    seed: int
    kind: Kind
    layout: Layout
    driven: Driven
    changes: tuple[Change, ...]
    outsider: Outsider | None
    level: float
    """Place in the range of sizes, 0 to 1."""


@dataclass(frozen=True)
class _Try:
    """One answer to what a seed asks for."""

    nominal: Drive
    changed: Drive
    plan: str
    hidden: tuple[Hidden, ...]
    signal: float
    miss: float
    """How far from what was wanted, 0 or more."""


def draw_bench_case(seed: int, driven: Driven = "other") -> tuple[Case, Drive, Drive]:
    """Return the case of a seed with its nominal and its changed drive: always the same.

    `driven` says which commands its logs drive.
    """
    kind, turn = kind_of(seed)
    layout = draw_layout(_rng(seed, LAYOUT))
    if driven == "same":
        layout = layout_again(layout, STANDARD)
        # Gentle commands are not those of a fit.
        kind = "quiet" if kind == "untestable" else kind
    changes, outsider = _changes(seed, kind, turn)
    asked = _Asked(seed, kind, layout, driven, changes, outsider, _level(kind, turn))
    best: _Try | None = None
    for attempt in range(_TRIES):
        tried = _try(asked, attempt)
        if best is None or tried.miss < best.miss:
            best = tried
        if best.miss == 0.0:
            break
    assert best is not None
    case = Case(
        seed=seed,
        level="bench",
        kind=kind,
        family=best.nominal.family,
        plan=best.plan,
        layout=layout.name,
        hidden=best.hidden,
        outsider=outsider.words if outsider else "",
        twins=_twins(changes, best.changed, layout),
        signal=best.signal,
        driven=driven,
    )
    return case, best.nominal, best.changed


def kind_of(seed: int) -> tuple[Kind, int]:
    """Return the kind of a seed's case, and how many seeds from 0 on have had it before.

    The order within a block is shuffled once and the same in all blocks, so that any block of consecutive
    seeds has every kind, wherever it begins.
    """
    kinds = [kind for kind, share in SHARES.items() for _ in range(share)]
    order = _rng(BLOCK, KINDS).permutation(BLOCK)
    block, place = divmod(seed, BLOCK)
    kind = kinds[order[place]]
    before = sum(kinds[i] == kind for i in order[:place])
    return kind, block * SHARES[kind] + before


def fit_commands(seed: int, drive: Drive) -> list[Commands]:
    """Return the command sequences of a seed's nominal logs."""
    return study_commands(seed, _fit_plan(seed), STANDARD, drive, nominal=True)


def case_commands(case: Case, drive: Drive) -> list[Commands]:
    """Return the command sequences of a case's logs, made for the drive before its change."""
    return _case_commands(case.seed, case.plan, layout_of(case), case.driven, drive)


def layout_of(case: Case) -> Layout:
    """Return the layout of a case's logs."""
    layout = next(layout for layout in LAYOUTS if layout.name == case.layout)
    return layout_again(layout, STANDARD) if case.driven == "same" else layout


def study_commands(seed: int, name: str, layout: Layout, drive: Drive, *, nominal: bool) -> list[Commands]:
    """Return the command sequences of a plan in a study, one per group of repeats.

    A seed has others for its nominal logs (`nominal`) than for those of its case.
    """
    return [
        plan(
            name,
            drive.top_rpm,
            layout.seconds,
            drive.link.period_s,
            _rng(seed, COMMANDS, int(nominal), i),
        )
        for i in range(layout.sequences)
    ]


def _fit_plan(seed: int) -> str:
    return str(_rng(seed, NOISE).choice(FIT_PLANS))


def _case_commands(seed: int, name: str, layout: Layout, driven: Driven, drive: Drive) -> list[Commands]:
    if driven == "same":
        return fit_commands(seed, drive)[: layout.sequences]
    return study_commands(seed, name, layout, drive, nominal=False)


def _changes(seed: int, kind: Kind, turn: int) -> tuple[tuple[Change, ...], Outsider | None]:
    """Return what is hidden in the turn-th case of a kind; over the turns, everything comes equally often."""
    if kind == "near_outsider":
        return (), _in_turn(NEAR_OUTSIDERS, turn)
    if kind == "far_outsider":
        return (), _in_turn(FAR_OUTSIDERS, turn)
    if kind == "single":
        return (_in_turn([c for c in CHANGES if (c.name, c.form) not in TWINS], turn),), None
    if kind == "twin":
        return (change_of(*_in_turn(tuple(TWINS), turn)),), None
    if kind == "untestable":
        return (change_of(*_in_turn(UNSEEN_WHEN_GENTLE, turn)),), None
    count = {"pair": 2, "triple": 3}.get(kind, 0)
    chosen: list[Change] = [_in_turn(CHANGES, turn)] if count else []
    for i in _rng(seed, PARTNERS).permutation(len(CHANGES)):
        if len(chosen) < count and all(_separate(CHANGES[i], other) for other in chosen):
            chosen.append(CHANGES[i])
    return tuple(chosen), None


def _separate(one: Change, other: Change) -> bool:
    """Return whether two changes can be told apart in one study, and do not need different drives."""
    forms = {one.form, other.form}
    return (
        one.name != other.name
        and other.name not in TWINS.get((one.name, one.form), ())
        and forms != {"droop", "washed_out"}
    )


def _in_turn(of: Sequence[T], turn: int) -> T:
    """Return the item whose turn it is; every round is shuffled on its own."""
    around, place = divmod(turn, len(of))
    return of[int(_rng(around, FORMS, len(of)).permutation(len(of))[place])]


def _level(kind: Kind, turn: int) -> float:
    """Return the turn-th case's place in the range of sizes, 0 to 1, spread by the golden ratio."""
    return (list(SHARES).index(kind) / len(SHARES) + turn * 0.6180339887498949) % 1.0


def _wanted(level: float, kind: Kind, member: int) -> float:
    """Return the trace that the member-th effect of a case should leave, log-uniform over its range."""
    low, high = TARGETS
    if kind in ("pair", "triple"):
        low, high = _MEMBER_TARGETS
    elif kind == "untestable":
        low, high = _HIDDEN_TARGETS
    return float(low * (high / low) ** ((level + 0.382 * member) % 1.0))


def _try(asked: _Asked, attempt: int) -> _Try:
    """Draw a drive that can have the changes, and commands; size the changes by their wanted traces."""
    seed, kind, layout, outsider = asked.seed, asked.kind, asked.layout, asked.outsider
    nominal = _drive(asked, attempt)
    rng = _rng(seed, COMMANDS, 2, attempt)
    name = str(rng.choice((*CASE_PLANS, GENTLE) if kind == "quiet" else CASE_PLANS))
    if asked.driven == "same":
        name = _fit_plan(seed)
    yardstick = Yardstick(nominal, _case_commands(seed, name, layout, asked.driven, nominal), seed)

    def solved(apply: Apply, member: int) -> Solved:
        target = _wanted(asked.level, kind, member)
        return solve_size(apply, nominal, target, yardstick, (seed, CHANGE, attempt, member))

    if kind == "quiet":
        return _Try(nominal, nominal, name, (), 0.0, 0.0)
    if outsider:
        found = solved(outsider.apply, 0)
        miss = _miss(found.signal, _wanted(asked.level, kind, 0))
        return _Try(nominal, found.drive, name, (), found.signal, miss)
    changed, hidden, miss = nominal, [], 0.0
    for member, change in enumerate(asked.changes):
        found = solved(change.apply, member)
        before = changed
        changed = change.apply(before, found.size, _rng(seed, CHANGE, attempt, member))
        hidden.append(change.hidden(before, changed, found.signal))
        miss += _miss(found.signal, _wanted(asked.level, kind, member))
    if kind == "untestable":
        gentle = Yardstick(nominal, study_commands(seed, GENTLE, layout, nominal, nominal=False), seed)(
            changed
        )
        hidden = [dataclasses.replace(h, signal=gentle) for h in hidden]
        return _Try(nominal, changed, GENTLE, tuple(hidden), gentle, miss + max(gentle - _UNSEEN, 0.0))
    signal = hidden[0].signal if len(hidden) == 1 else yardstick(changed)
    return _Try(nominal, changed, name, tuple(hidden), signal, miss)


def _miss(reached: float, wanted: float) -> float:
    """Return how much of the wanted trace is missing, 0 if enough of it is there."""
    return max(_ENOUGH - reached / wanted, 0.0)


def _drive(asked: _Asked, attempt: int) -> Drive:
    """Return a drive that can have the changes, of the seed's family if that is possible."""
    families, outsider = _family_order(asked.seed), asked.outsider
    for i in range(_DRIVES_PER_FAMILY * len(families)):
        family = families[i // _DRIVES_PER_FAMILY]
        key = _rng(asked.seed, DRIVE, attempt, i).integers(1 << 31)
        drive = asked.layout.sensed(draw_drive(int(key), family))
        # A logged battery dips when the motor starts, which tells a late command from a late sensor.
        able = asked.kind != "twin" or not drive.battery.logged
        able = able and all(change.possible(drive) for change in asked.changes)
        if able and (not outsider or outsider.possible(drive)):
            return drive
    what = outsider.words if outsider else ", ".join(f"{c.name}/{c.form}" for c in asked.changes)
    raise RuntimeError(f"seed {asked.seed}: no drive of the zoo can have {what}")


def _family_order(seed: int) -> tuple[Family, ...]:
    """Return all families, beginning with the one whose turn it is."""
    names = sorted(FAMILIES)
    first = _in_turn(names, seed)
    others = [name for name in names if name != first]
    return (first, *(others[i] for i in _rng(seed, FAMILY).permutation(len(others))))


def _twins(changes: tuple[Change, ...], changed: Drive, layout: Layout) -> tuple[str, ...]:
    """Return the names that these logs cannot tell from the hidden ones."""
    names: list[str] = []
    for change in changes:
        names += TWINS.get((change.name, change.form), ())
        names += slow_twins(change, changed.controller.gain_warming_s, layout.seconds)
    hidden = {change.name for change in changes}
    return tuple(sorted(set(names) - hidden))


def _rng(*key: int) -> np.random.Generator:
    return np.random.default_rng(key)
