"""A comparison as text and as Markdown."""

from __future__ import annotations

from pathlib import Path

from training.certify.judge import milliseconds, share_text
from training.certify.table import columns
from training.compare.run import Comparison, Row
from training.evaluate import Mean


def comparison_table(found: Comparison) -> str:
    """Return what was found as text: one row a controller."""
    return "\n".join(columns(cells(found)))


def comparison_markdown(found: Comparison, command: str) -> str:
    """Return what was found as a page in Markdown.

    Args:
        found: the comparison.
        command: that writes it.
    """
    head, *rows = cells(found)
    made = found.provenance
    lines = [
        "# Results of `python -m training.compare`",
        "",
        f"Written by `{command}`; do not edit. mecanum-tankendo {made['version']}, MuJoCo {made['mujoco']}, "
        f"{made['episodes']} episodes a figure with seeds from {made['first_seed']}.",
        "",
        "## Success",
        "",
        "With Wilson's 95 % interval. Every controller plays the same episodes and knows the model, not the "
        "plant that it is on.",
        "",
        *(f"- {name}: {text}." for name, text in found.settings.items()),
        "",
        *_markdown([head[: 1 + len(found.settings)], *(row[: 1 + len(found.settings)] for row in rows)]),
        "",
        "## Warning, tracking, time",
        "",
        "Warning: the shortest at which the success reaches 90 %, planar plant, level normal but for the "
        "warning; see [certificates](../certify.md). Tracking error: root mean square of distance - maai "
        "behind an opponent that walks about, mean over episodes. Time: of the processor, for one command, "
        "on the machine that wrote this; the robot takes one every 100 ms.",
        "",
        *_markdown([(head[0], *head[1 + len(found.settings) :])]
                   + [(row[0], *row[1 + len(found.settings) :]) for row in rows]),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def cells(found: Comparison) -> list[tuple[str, ...]]:
    """Return the cells of what was found, the head first."""
    head = (
        *("controller", *found.settings),
        *("warning for 90 %", "tracking error, m", "tracking success", "time p50", "time p99"),
    )
    return [head, *(_row(row, list(found.settings)) for row in found.rows)]


def label(controller: str) -> str:
    """Return the name of a controller, or of the file or folder of a policy, as tables show it."""
    return Path(controller).stem if "/" in controller or controller.endswith(".npz") else controller


def _row(row: Row, settings: list[str]) -> tuple[str, ...]:
    return (
        label(row.controller),
        *(share_text(row.success[setting]) for setting in settings),
        _warning(row),
        _mean(row.track.distance_error_m),
        share_text(row.track.success),
        milliseconds(row.timing.p50_s),
        milliseconds(row.timing.p99_s),
    )


def _warning(row: Row) -> str:
    curve = row.warning
    if curve.needed_s is None:
        return f"not reached, at best {max(curve.success):.2f}"
    high = f"more than {curve.range_s[1]:g}" if curve.high_s is None else f"{curve.high_s:.2f}"
    text = f"{curve.needed_s:.2f} s ({curve.low_s:.2f} .. {high})"
    return text if curve.holds_to_s is None else f"{text}, up to {curve.holds_to_s:.2f}"


def _mean(found: Mean | None) -> str:
    return "-" if found is None else f"{found.value:.2f} ({found.low:.2f} .. {found.high:.2f})"


def _markdown(rows: list[tuple[str, ...]]) -> list[str]:
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return [lines[0], f"|{'---|' * len(rows[0])}", *lines[1:]]
