"""A dataset as text for the terminal: runs, splits, findings and the noise floor."""

from __future__ import annotations

from collections.abc import Sequence

from sysid.logs.findings import KINDS, Finding
from sysid.logs.noise import noise_from_repeats
from sysid.logs.runs import SPLITS, UNITS, Dataset, Run


def describe(dataset: Dataset, *, all_findings: bool = False) -> str:
    """Return a table of the runs, then findings (one a kind, or all), then the noise that repeats give."""
    count = {name: len(dataset.split(name)) for name in SPLITS}
    split = ", ".join(f"{number} {name}" for name, number in count.items() if number)
    runs = "1 run" if len(dataset.runs) == 1 else f"{len(dataset.runs)} runs"
    title = (
        f"{dataset.name}: {dataset.level} log, {runs} ({split}), {len(dataset.groups())} command sequences"
    )
    lines = [
        title,
        *_channels(dataset.runs),
        "",
        *_table(dataset.runs),
        "",
        *_findings(dataset, all_findings),
        "",
    ]
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


def _channels(runs: Sequence[Run]) -> list[str]:
    """Return one line a set of measured channels."""
    sets: dict[tuple[str, ...], list[str]] = {}
    for run in runs:
        sets.setdefault(tuple(run.channels), []).append(run.file)
    if len(sets) == 1:
        return ["measured: " + ", ".join(runs[0].channels)]
    return [f"measured in {len(f)} runs ({f[0]} ...): {', '.join(names)}" for names, f in sets.items()]


def _table(runs: Sequence[Run]) -> list[str]:
    rows = [("run", "group", "split", "rows", "seconds", "Hz", "commands")]
    for run in runs:
        times, _ = run.command_changes()
        rows.append(
            (
                run.file,
                run.group,
                run.split,
                str(run.time_s.size),
                f"{run.duration_s:.2f}",
                f"{1.0 / run.median_interval_s:.4g}",
                str(len(times)),
            )
        )
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    right = (3, 4, 5, 6)
    return [
        "  ".join(
            cell.rjust(w) if i in right else cell.ljust(w)
            for i, (cell, w) in enumerate(zip(r, widths, strict=True))
        ).rstrip()
        for r in rows
    ]


def _findings(dataset: Dataset, every: bool) -> list[str]:
    if not dataset.findings:
        return ["nothing odd found"]
    by_kind: dict[str, list[Finding]] = {kind: [] for kind in KINDS}
    for finding in dataset.findings:
        by_kind[finding.kind].append(finding)
    lines = ["noticed:"]
    for kind, found in by_kind.items():
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
