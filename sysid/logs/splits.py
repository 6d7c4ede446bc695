"""Repeats, groups and splits: which runs had the same commands, and which of them fit, validate and test.

Two runs are repeats if their commands start alike and change to the same values after the same times, counted
from the first change, within two sample intervals (at least 20 ms). How long they were recorded before the
first change and after the last does not matter. A group stated in `dataset.toml` takes precedence.

Splits that `dataset.toml` does not state are deterministic and hold out whole groups, since a repeat of a
fitted sequence tests the noise and not the model. With three or more groups, a fifth (rounded, at least one)
is for validation and as many for test. The groups are ordered by the rms of their command; the held-out
ones are spread evenly over that order, and the largest is always fitted, so that the fit covers the range.
With fewer groups, repeats are split instead, if there are any; a single run is fitted. Groups that are stated
to be fitted take no part in this: recordings can be added for the fit, and what is held out stays the same.
If `dataset.toml` states what is held out, the rest is fitted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.statistics import rms
from mecanum_env.units import FloatArray
from sysid.logs.findings import Finding
from sysid.logs.runs import SPLITS, Run, Split

_VALUE_TOLERANCE_RPM: Final = 1e-6
"""Commands of repeats differ by no more than this [rpm]."""
_TIME_TOLERANCE_S: Final = 0.02
"""Command changes of repeats may always differ by this [s]."""


@dataclass(frozen=True, eq=False)
class CommandSequence:
    """A run's commands, independent of when the recording was started."""

    after_s: FloatArray
    """Times of the changes [s] after the first one, shape (m,)."""
    wheels_rpm: FloatArray
    """Wheel commands [rpm] before the first change and after each, shape (m + 1, 1 or 4)."""
    tolerance_s: float
    """Largest difference between the times of repeats [s]."""


def command_sequence(run: Run) -> CommandSequence:
    """Return the command sequence of a run."""
    times, wheels = run.command_changes()
    after = times[1:] - times[1] if len(times) > 1 else np.empty(0)
    return CommandSequence(after, wheels, max(_TIME_TOLERANCE_S, 2.0 * run.median_interval_s))


def are_repeats(one: CommandSequence, other: CommandSequence) -> bool:
    """Return whether two runs were given the same commands at the same times."""
    if one.wheels_rpm.shape != other.wheels_rpm.shape:
        return False
    if np.max(np.abs(one.wheels_rpm - other.wheels_rpm)) > _VALUE_TOLERANCE_RPM:
        return False
    difference_s = np.abs(one.after_s - other.after_s)
    return bool(np.all(difference_s <= max(one.tolerance_s, other.tolerance_s)))


def group_names(runs: Sequence[Run], stated: Mapping[str, str]) -> tuple[list[str], list[Finding]]:
    """Return the group of each run, and a finding for each run whose commands differ from its stated group's.

    A run whose file has no group `stated` takes that of a run with the same commands; a new group is named
    after its first file.
    """
    sequences = [command_sequence(run) for run in runs]
    findings = []
    members: dict[str, CommandSequence] = {}
    for run, sequence in zip(runs, sequences, strict=True):
        group = stated.get(run.file)
        if group is not None and not are_repeats(members.setdefault(group, sequence), sequence):
            findings.append(Finding(run.file, "group", 1.0, details={"group": group}))
    names = []
    for run, sequence in zip(runs, sequences, strict=True):
        group = stated.get(run.file)
        if group is None:
            same = (name for name, first in members.items() if are_repeats(first, sequence))
            group = next(same, None)
        if group is None:
            group = stem = run.file.split(".")[0]
            count = 1
            while group in members:
                count += 1
                group = f"{stem}_{count}"
            members[group] = sequence
        names.append(group)
    return names, findings


def assign_splits(runs: Sequence[Run], stated: Mapping[str, Split]) -> tuple[list[Split], list[Finding]]:
    """Return the split of each run, and findings about what is held out.

    Runs whose file has no split `stated` take the one that is stated most often in their group.
    """
    splits: dict[str, Split] = dict(stated)
    groups: dict[str, list[Run]] = {}
    for run in runs:
        groups.setdefault(run.group, []).append(run)
    for members in groups.values():
        counts = Counter(stated[run.file] for run in members if run.file in stated)
        if counts:
            common = counts.most_common(1)[0][0]
            splits.update({run.file: common for run in members if run.file not in stated})
    open_groups = {name: members for name, members in groups.items() if members[0].file not in splits}
    if set(stated.values()) <= {"fit"}:
        splits.update(_split_groups(open_groups) if len(open_groups) >= 3 else _split_repeats(open_groups))
    else:
        splits.update(_complete(open_groups, set(stated.values())))
    chosen = [splits[run.file] for run in runs]
    return chosen, _split_findings([replace(run, split=s) for run, s in zip(runs, chosen, strict=True)])


def _by_size(groups: Mapping[str, Sequence[Run]]) -> list[list[Run]]:
    """Return the groups ordered by the rms of their command, then by name."""
    names = sorted(groups, key=lambda name: (rms(groups[name][0].command.wheels_rpm), name))
    return [list(groups[name]) for name in names]


def _split_groups(groups: Mapping[str, Sequence[Run]]) -> dict[str, Split]:
    ordered = _by_size(groups)
    held_out = 2 * max(1, round(len(ordered) / 5))
    roles: list[Split] = ["fit"] * len(ordered)
    for index in range(held_out):
        position = int((index + 0.5) * (len(ordered) - 1) / held_out)
        roles[position] = "validation" if index % 2 else "test"
    return {run.file: role for role, members in zip(roles, ordered, strict=True) for run in members}


def _split_repeats(groups: Mapping[str, Sequence[Run]]) -> dict[str, Split]:
    """Split one or two groups: the last repeat tests, the last but one of three or more validates."""
    splits: dict[str, Split] = {run.file: "fit" for members in groups.values() for run in members}
    for members in groups.values():
        if len(members) >= 2:
            splits[members[-1].file] = "test"
        if len(members) >= 3:
            splits[members[-2].file] = "validation"
    if len(groups) == 2 and "test" not in splits.values():
        splits[_by_size(groups)[0][0].file] = "test"
    return splits


def _complete(groups: Mapping[str, Sequence[Run]], stated: set[Split]) -> dict[str, Split]:
    """Split the groups that `dataset.toml` does not state: into the splits it lacks, else into fit."""
    ordered = _by_size(groups)
    splits: dict[str, Split] = {run.file: "fit" for members in ordered for run in members}
    lacking: list[Split] = [name for name in ("test", "validation") if name not in stated]
    # The largest group is fitted, unless the user has stated what to fit.
    spare = ordered if "fit" in stated else ordered[:-1]
    for role, members in zip(lacking, spare, strict=False):
        splits.update({run.file: role for run in members})
    return splits


def _split_findings(runs: Sequence[Run]) -> list[Finding]:
    if len(runs) == 1:
        return [Finding("", "split", 1.0, variant="one run", details={"split": runs[0].split})]
    findings = [
        Finding("", "split", 0.0, variant="no run", details={"split": name})
        for name in SPLITS
        if not any(run.split == name for run in runs)
    ]
    fitted = {run.group for run in runs if run.split == "fit"}
    shared = sorted({run.group for run in runs if run.split != "fit"} & fitted)
    if shared:
        details = {"groups": ", ".join(shared[:3])}
        findings.append(Finding("", "split", float(len(shared)), variant="shared groups", details=details))
    return findings
