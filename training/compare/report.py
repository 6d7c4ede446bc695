"""A comparison as text and as a Markdown page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from mecanum_env.markdown import markdown_table
from training.certify.checks import mean_text, milliseconds, share_text, warning_text
from training.certify.report import columns
from training.compare.comparison import Comparison
from training.evaluate import Share

BOUND: Final = "bound"
"""Name of the oracle's line."""
Table = Sequence[tuple[str, ...]]
"""Cells of a table, the head first."""


def comparison_table(found: Comparison) -> str:
    """Return a comparison as text: three tables with one line per controller."""
    held_out = "held out, seen by no training:"
    success, rest = columns(success_cells(found)), columns(metric_cells(found))
    return "\n".join([*success, "", held_out, *columns(held_out_cells(found)), "", *rest])


def comparison_markdown(found: Comparison, command: str) -> str:
    """Return a comparison as a Markdown page that names the command it is written by."""
    made = found.provenance
    known = "\n".join(f"- {name}: {found.settings[name]}." for name in _known(found))
    held_out = "\n".join(f"- {name}: {found.settings[name]}." for name in found.held_out)
    return f"""# Results of `python -m training.compare`

Written by `{command}`; do not edit. mecanum-tankendo {made["version"]}, MuJoCo {made["mujoco"]}, \
{made["episodes"]} episodes per number with seeds from {made["first_seed"]}.

## Success

With Wilson's 95 % interval. Every controller plays the same episodes and knows the model, not the robot \
that it is on or the opponent that it meets. The bound is the success of the oracle, which rehearses each \
episode on the very robot, in the first quarter of the episodes; see [certificates](../certify.md).

{known}

{_markdown(success_cells(found))}

## Held out

Robots and opponents that no training saw; those of [certificates](../certify.md).

{held_out}

{_markdown(held_out_cells(found))}

## Warning, tracking, time

Warning: the shortest at which the success reaches 90 %, planar plant, level normal but for the warning; see \
[certificates](../certify.md). Tracking error: root mean square of distance - maai behind an opponent that \
walks about, mean over episodes. Time: processor time per command on the machine that wrote this; the robot \
takes a command every 100 ms.

{_markdown(metric_cells(found))}
"""


def success_cells(found: Comparison) -> Table:
    """Return the cells of the success in all settings but those held out, and its bound."""
    names = _known(found)
    lines = [(name, *(_text(success, one) for one in names)) for name, success in _lines(found)]
    return [("controller", *names), *lines]


def held_out_cells(found: Comparison) -> Table:
    """Return the cells of the success on what is held out, with mean and worst of it, and its bound."""
    lines = []
    for name, success in _lines(found):
        shares = [success[one] for one in found.held_out]
        worst = min(found.held_out, key=lambda one: success[one].value)
        mean = sum(share.value for share in shares) / len(shares)
        summary = f"{mean:.2f}", f"{success[worst].value:.2f} on {worst}"
        lines.append((name, *map(share_text, shares), *summary))
    return [("controller", *found.held_out, "mean", "worst"), *lines]


def metric_cells(found: Comparison) -> Table:
    """Return the cells of the warning needed, of tracking, and of the time per command."""
    head = ("warning for 90 %", "tracking error, m", "tracking success", "time p50", "time p99")
    lines = [
        (
            label(row.controller),
            warning_text(row.warning),
            mean_text(row.track.distance_error_m),
            share_text(row.track.success),
            milliseconds(row.timing.p50_s),
            milliseconds(row.timing.p99_s),
        )
        for row in found.rows
    ]
    return [("controller", *head), *lines]


def label(controller: str) -> str:
    """Return how tables show a controller: its name, or that of its policy's file or folder."""
    return Path(controller).stem if "/" in controller or controller.endswith(".npz") else controller


def _known(found: Comparison) -> list[str]:
    return [name for name in found.settings if name not in found.held_out]


def _lines(found: Comparison) -> list[tuple[str, Mapping[str, Share]]]:
    """Return the name and the success of each line: the controllers, and the bound if it was played."""
    lines = [(label(row.controller), row.success) for row in found.rows]
    return [*lines, (BOUND, found.bound)] if found.bound else lines


def _text(success: Mapping[str, Share], name: str) -> str:
    return share_text(success[name]) if name in success else "-"


def _markdown(table: Table) -> str:
    return markdown_table(table[0], table[1:])
