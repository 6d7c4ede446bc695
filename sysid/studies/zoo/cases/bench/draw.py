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
from sysid.studies.zoo.cases.bench.plans import CASE_PLANS, GENTLE, Commands, plan
from sysid.studies.zoo.cases.bench.size import TARGETS, Apply, Solved, Yardstick, solve_size
from sysid.studies.zoo.cases.case import Case, Hidden, Kind
from sysid.studies.zoo.cases.layouts import Layout, draw_layout
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
class _Try:
    """One answer to what a seed asks for."""

    nominal: Drive
    changed: Drive
    plan: str
    hidden: tuple[Hidden, ...]
    signal: float
    miss: float
    """How far from what was wanted, 0 or more."""


def draw_bench_case(seed: int) -> tuple[Case, Drive, Drive]:
    """Return the case of a seed with its nominal and its changed drive: always the same."""
    kind, turn = kind_of(seed)
    layout = draw_layout(_rng(seed, LAYOUT))
    changes, outsider = _changes(seed, kind, turn)
    best: _Try | None = None
    for attempt in range(_TRIES):
        tried = _try(seed, attempt, kind, layout, changes, outsider, _level(kind, turn))
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


def _try(
    seed: int,
    attempt: int,
    kind: Kind,
    layout: Layout,
    changes: tuple[Change, ...],
    outsider: Outsider | None,
    level: float,
) -> _Try:
    """Draw a drive that can have the changes, and commands; size the changes by their wanted traces."""
    nominal = _drive(seed, attempt, kind, layout, changes, outsider)
    rng = _rng(seed, COMMANDS, 2, attempt)
    name = str(rng.choice((*CASE_PLANS, GENTLE) if kind == "quiet" else CASE_PLANS))
    commands = study_commands(seed, name, layout, nominal, nominal=False)
    yardstick = Yardstick(nominal, commands, seed)

    def solved(apply: Apply, member: int) -> Solved:
        target = _wanted(level, kind, member)
        return solve_size(apply, nominal, target, yardstick, (seed, CHANGE, attempt, member))

    if kind == "quiet":
        return _Try(nominal, nominal, name, (), 0.0, 0.0)
    if outsider:
        found = solved(outsider.apply, 0)
        miss = _miss(found.signal, _wanted(level, kind, 0))
        return _Try(nominal, found.drive, name, (), found.signal, miss)
    changed, hidden, miss = nominal, [], 0.0
    for member, change in enumerate(changes):
        found = solved(change.apply, member)
        before = changed
        changed = change.apply(before, found.size, _rng(seed, CHANGE, attempt, member))
        hidden.append(change.hidden(before, changed, found.signal))
        miss += _miss(found.signal, _wanted(level, kind, member))
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


def _drive(
    seed: int,
    attempt: int,
    kind: Kind,
    layout: Layout,
    changes: tuple[Change, ...],
    outsider: Outsider | None,
) -> Drive:
    """Return a drive that can have the changes, of the seed's family if that is possible."""
    families = _family_order(seed)
    for i in range(_DRIVES_PER_FAMILY * len(families)):
        family = families[i // _DRIVES_PER_FAMILY]
        key = _rng(seed, DRIVE, attempt, i).integers(1 << 31)
        drive = layout.sensed(draw_drive(int(key), family))
        # A logged battery dips when the motor starts, which tells a late command from a late sensor.
        able = kind != "twin" or not drive.battery.logged
        able = able and all(change.possible(drive) for change in changes)
        if able and (not outsider or outsider.possible(drive)):
            return drive
    what = outsider.words if outsider else ", ".join(f"{c.name}/{c.form}" for c in changes)
    raise RuntimeError(f"seed {seed}: no drive of the zoo can have {what}")


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
