"""Repeats, groups and splits: which runs had the same commands, and which of them fit, validate and test.

Repeats. Two runs are repeats when their commands start alike and change to the same values after the same
times, counted from the first change, within two sample intervals (at least 20 ms). How long they were
recorded before the first change and after the last does not matter. A group that `dataset.toml` states wins.

Splits where `dataset.toml` is silent. They are deterministic and go by whole groups, since a repeat of a
sequence that was fitted tests the noise and not the model. With three or more groups a fifth of them
(rounded, at least one) is for validation and as many for test; the groups are ordered by the rms of their
command, the held-out ones are spread evenly over that order, and the largest always fits, so that the fit
covers the range. With fewer groups repeats are split instead where there are any; one run alone fits.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mecanum_env.units import FloatArray
from sysid.logs.runs import Finding, Run, Split

VALUE_TOLERANCE_RPM = 1e-6
TIME_TOLERANCE_S = 0.02


@dataclass(frozen=True, eq=False)
class CommandSequence:
    """The shape of a run's commands, free of when the recording was started."""

    after_s: FloatArray
    """Times of the changes [s] after the first one, shape (m,)."""
    wheels_rpm: FloatArray
    """Wheel commands [rpm] before the first change and after each, shape (m + 1, 1 or 4)."""
    tolerance_s: float


def command_sequence(run: Run) -> CommandSequence:
    """Return the command sequence of a run."""
    times, wheels = run.command_changes()
    after = times[1:] - times[1] if len(times) > 1 else np.empty(0)
    return CommandSequence(after, wheels, max(TIME_TOLERANCE_S, 2.0 * run.median_interval_s))


def are_repeats(one: CommandSequence, other: CommandSequence) -> bool:
    """Return whether two runs were given the same commands at the same times."""
    if one.wheels_rpm.shape != other.wheels_rpm.shape:
        return False
    if np.max(np.abs(one.wheels_rpm - other.wheels_rpm)) > VALUE_TOLERANCE_RPM:
        return False
    apart = np.abs(one.after_s - other.after_s)
    return bool(np.all(apart <= max(one.tolerance_s, other.tolerance_s)))


def group_names(runs: Sequence[Run], stated: Mapping[str, str]) -> tuple[list[str], list[Finding]]:
    """Return the group of each run, and findings where a stated group has commands that differ.

    Args:
        runs: Their own `group` is not looked at.
        stated: Group by file name, where the user said one. A run without takes the group of a run with the
            same commands, or is named after the first such file.
    """
    sequences = [command_sequence(run) for run in runs]
    findings = []
    members: dict[str, CommandSequence] = {}
    for run, sequence in zip(runs, sequences, strict=True):
        group = stated.get(run.file)
        if group is None:
            continue
        if group not in members:
            members[group] = sequence
        elif not are_repeats(members[group], sequence):
            message = f'its commands differ from the first run of its group "{group}"; not a repeat of it'
            findings.append(Finding(run.file, "group", message, 1.0))
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
    """Return the split of each run, and what a user should know about it.

    Args:
        runs: With their groups; their own `split` is not looked at.
        stated: Split by file name, where the user said one. Other runs of a group with a stated split join
            it (its commonest one).
    """
    splits: dict[str, Split] = dict(stated)
    groups: dict[str, list[Run]] = {}
    for run in runs:
        groups.setdefault(run.group, []).append(run)
    for members in groups.values():
        said = Counter(stated[run.file] for run in members if run.file in stated)
        if said:
            splits.update({run.file: said.most_common(1)[0][0] for run in members if run.file not in stated})
    free = {name: members for name, members in groups.items() if members[0].file not in splits}
    if not stated:
        splits.update(_split_groups(free) if len(free) >= 3 else _split_repeats(free))
    else:
        splits.update(_fill_up(free, set(stated.values())))
    chosen = [splits[run.file] for run in runs]
    return chosen, _split_findings([replace(run, split=s) for run, s in zip(runs, chosen, strict=True)])


def _by_size(groups: Mapping[str, Sequence[Run]]) -> list[list[Run]]:
    """Return the groups ordered by the rms of their command, then by name."""

    def size(name: str) -> tuple[float, str]:
        return float(np.sqrt(np.mean(groups[name][0].command.wheels_rpm ** 2))), name

    return [list(groups[name]) for name in sorted(groups, key=size)]


def _split_groups(groups: Mapping[str, Sequence[Run]]) -> dict[str, Split]:
    ordered = _by_size(groups)
    held_out = 2 * max(1, round(len(ordered) / 5))
    roles: list[Split] = ["fit"] * len(ordered)
    for index in range(held_out):
        position = int((index + 0.5) * (len(ordered) - 1) / held_out)
        roles[position] = "validation" if index % 2 else "test"
    return {run.file: role for role, members in zip(roles, ordered, strict=True) for run in members}


def _split_repeats(groups: Mapping[str, Sequence[Run]]) -> dict[str, Split]:
    """Split one or two groups: the last repeat tests, the one before validates where three remain."""
    splits: dict[str, Split] = {run.file: "fit" for members in groups.values() for run in members}
    for members in groups.values():
        if len(members) >= 2:
            splits[members[-1].file] = "test"
        if len(members) >= 3:
            splits[members[-2].file] = "validation"
    if len(groups) == 2 and "test" not in splits.values():
        splits[_by_size(groups)[0][0].file] = "test"
    return splits


def _fill_up(groups: Mapping[str, Sequence[Run]], stated: set[Split]) -> dict[str, Split]:
    """Give the groups that a partly written `dataset.toml` leaves out to fit, and to what it lacks."""
    ordered = _by_size(groups)
    splits: dict[str, Split] = {run.file: "fit" for members in ordered for run in members}
    lacking: list[Split] = [name for name in ("test", "validation") if name not in stated]
    # The largest goes to fit, unless the user has named what fits.
    spare = ordered if "fit" in stated else ordered[:-1]
    for role, members in zip(lacking, spare, strict=False):
        splits.update({run.file: role for run in members})
    return splits


def _split_findings(runs: Sequence[Run]) -> list[Finding]:
    findings = []
    if len(runs) == 1:
        message = f"one run only: it is used to {runs[0].split}, and nothing is held out to check the result"
        return [Finding("", "split", message, 1.0)]
    for name in ("fit", "validation", "test"):
        if not any(run.split == name for run in runs):
            findings.append(Finding("", "split", f"no run is for {name}", 0.0))
    fitted = {run.group for run in runs if run.split == "fit"}
    shared = sorted({run.group for run in runs if run.split != "fit"} & fitted)
    if shared:
        message = (
            f"{len(shared)} group(s) are both fitted and held out ({', '.join(shared[:3])}): "
            "held-out repeats test the noise, not new commands"
        )
        findings.append(Finding("", "split", message, float(len(shared))))
    return findings
