"""What `python -m sysid.logs check` says of a dataset: in words, and for machines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mecanum_env.files import plain_json
from sysid.logs.findings import KINDS
from sysid.logs.noise import noise_from_repeats
from sysid.logs.runs import SPLITS, UNITS, Dataset, Run


def describe(dataset: Dataset, *, all_findings: bool = False) -> str:
    """Return a table of the runs, then findings (one per kind, or `all_findings`), then the noise floor."""
    count = {name: len(dataset.split(name)) for name in SPLITS}
    split = ", ".join(f"{number} {name}" for name, number in count.items() if number)
    runs = "1 run" if len(dataset.runs) == 1 else f"{len(dataset.runs)} runs"
    sequences = f"{len(dataset.groups())} command sequences"
    lines = [f"{dataset.name}: {dataset.level} log, {runs} ({split}), {sequences}"]
    lines += [*_channels(dataset.runs), "", *_table(dataset.runs), ""]
    lines += [*_findings(dataset, all_findings), ""]
    noise = noise_from_repeats(dataset.runs)
    if noise is None:
        lines.append("noise floor: unknown, no two runs have the same commands (record repeats to get one)")
    else:
        for name, item in noise.items():
            lines.append(
                f"noise floor of {name}: {item.std:.3g} {UNITS[name]} +- {100 * item.relative_error:.2g} % "
                f"(repeats of {item.groups} sequences)"
            )
    return "\n".join(lines)


def dataset_json(dataset: Dataset) -> dict[str, Any]:
    """Return the runs of a dataset, what was noticed and the noise floor of its channels in JSON's types."""
    noise = noise_from_repeats(dataset.runs) or {}
    runs = [
        {
            **{name: getattr(run, name) for name in ("file", "group", "split", "duration_s")},
            **{"rows": run.time_s.size, "median_interval_s": run.median_interval_s},
            **{"commands": len(run.command_rows()), "measured": list(run.channels)},
        }
        for run in dataset.runs
    ]
    found: dict[str, Any] = plain_json(
        {
            **{"name": dataset.name, "level": dataset.level, "runs": runs},
            "findings": [finding.to_json() for finding in dataset.findings],
            "noise_floor": {name: {"std": item.std, "unit": UNITS[name]} for name, item in noise.items()},
        }
    )
    return found


def _channels(runs: Sequence[Run]) -> list[str]:
    """Return one line per set of measured channels."""
    sets: dict[tuple[str, ...], list[str]] = {}
    for run in runs:
        sets.setdefault(tuple(run.channels), []).append(run.file)
    if len(sets) == 1:
        return ["measured: " + ", ".join(runs[0].channels)]
    return [f"measured in {len(f)} runs ({f[0]} ...): {', '.join(names)}" for names, f in sets.items()]


def _table(runs: Sequence[Run]) -> list[str]:
    rows = [("run", "group", "split", "rows", "seconds", "Hz", "commands")]
    for run in runs:
        numbers = str(run.time_s.size), f"{run.duration_s:.2f}", f"{1.0 / run.median_interval_s:.4g}"
        rows.append((run.file, run.group, run.split, *numbers, str(len(run.command_rows()))))
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    align = (str.ljust, str.ljust, str.ljust, str.rjust, str.rjust, str.rjust, str.rjust)
    return [
        "  ".join(place(cell, w) for place, cell, w in zip(align, row, widths, strict=True)).rstrip()
        for row in rows
    ]


def _findings(dataset: Dataset, every: bool) -> list[str]:
    if not dataset.findings:
        return ["nothing odd found"]
    lines = ["noticed:"]
    for kind in KINDS:
        found = [finding for finding in dataset.findings if finding.kind == kind]
        if not found:
            continue
        files = {finding.file for finding in found if finding.file}
        where = f" [{len(files)} of {len(dataset.runs)} runs]" if files else ""
        lines.append(f"- {kind}: {KINDS[kind]}{where}")
        lines += [
            f"    {f.file + ': ' if f.file else ''}{f.message}" for f in (found if every else found[:1])
        ]
        if len(found) > 1 and not every:
            lines.append(f"    and {len(found) - 1} more (--all-findings)")
    return lines
