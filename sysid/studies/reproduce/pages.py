"""The results of the experiment as a page and as Markdown, in the same chapters, and as JSON."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

import mecanum_env
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.report import write_page
from sysid.studies.reproduce import published, tables
from sysid.studies.reproduce.charts import charts, page_figure
from sysid.studies.reproduce.contenders import CONTENDERS, USABLE_RMS_RPM, Rate
from sysid.studies.reproduce.experiment import Reproduction
from sysid.studies.reproduce.tables import Table, comparison_table, verdict
from sysid.studies.reproduce.why import comparisons

FORMAT: Final = "mecanum-reproduce/1"
_TEMPLATE: Final = Path(__file__).with_name("page.html")


@dataclass(frozen=True)
class Chapter:
    """One part of the results."""

    title: str
    text: str
    charts: tuple[str, ...]
    """Names in `charts`."""
    tables: tuple[Table, ...]


def chapters(found: Reproduction) -> list[Chapter]:
    """Return the results in the order of the paper."""
    return [
        Chapter(
            "Success and stability from random starts (section 4.1)",
            "Every gradient method descends from the same random starts. The paper reports 10; more show "
            "how certain that is. The curves show all thresholds at once: how large a share of the starts "
            "ends with an rms at or below each value.",
            ("starts",),
            (
                tables.starts_table(found),
                tables.fates_table(found),
                comparison_table(found, "starts"),
                tables.law_table(found),
            ),
        ),
        Chapter(
            "Step responses (Fig. 3) and their metrics (Fig. 4)",
            "The test steps took no part in any fit.",
            ("fig3-steps", "fig4-metrics"),
            (
                tables.metric_table(found),
                comparison_table(found, "metrics"),
                tables.speed_table(found),
                tables.error_table(found),
            ),
        ),
        Chapter(
            "Beyond the linear range (Fig. 5)",
            "No linear law has a ceiling. Limiting its command adds one; output error can also estimate it.",
            ("fig5-beyond",),
            (comparison_table(found, "beyond"),),
        ),
        Chapter(
            "Random inputs (Table 1, Fig. 6)",
            "Five trials of 5.2 s: five holds longer than the drive settles and five shorter, in random "
            "order.",
            ("fig6-random",),
            (tables.trial_table(found), comparison_table(found, "trials")),
        ),
        Chapter(
            "Time and memory (Table 2)", "", (), (tables.cost_table(found), comparison_table(found, "cost"))
        ),
        Chapter(
            "The robot (Fig. 7)",
            "The wheel that output error identified, four times, under the robot on its rollers in MuJoCo: "
            "rest, 3 s of the command, stop. The paper measured a real robot; its losses are effects that "
            "a free wheel does not have, so a simulation without them must lose less.",
            ("fig7-robot",),
            (tables.robot_table(found), comparison_table(found, "robot")),
        ),
    ]


def reproduction_markdown(found: Reproduction, pictures: str) -> str:
    """Return all results as Markdown; `pictures` is the folder of the PNG files, relative to it."""
    parts = [
        "# Results of `python -m sysid.studies.reproduce`",
        f"Written by the command itself (seed {found.seed}, {found.effort.starts} starts); do not edit. "
        "What it does: [Reproducing the paper](../reproduce.md).",
        verdict(found),
    ]
    for chapter in chapters(found):
        parts += [f"## {chapter.title}", chapter.text]
        parts += [f"![{name}]({pictures}/{name}.png)" for name in chapter.charts]
        for table in chapter.tables:
            parts += [f"### {table.title}", table.markdown(), table.note]
    return "\n\n".join(part for part in parts if part) + "\n"


def write_reproduction_page(found: Reproduction, path: Path) -> None:
    """Write the page."""
    figures: dict[str, dict[str, Any]] = {}
    grids: dict[str, tuple[int, list[str]]] = {}
    for chart in charts(found):
        names = [f"{chart.name}-{i}" for i in range(len(chart.panels))]
        figures.update(zip(names, map(page_figure, chart.panels), strict=True))
        grids[chart.name] = (chart.columns, names)
    write_page(
        path,
        _TEMPLATE,
        figures,
        verdict=verdict(found),
        chapters=chapters(found),
        grids=grids,
        provenance=f"mecanum-tankendo {mecanum_env.__version__}, seed {found.seed}",
    )


def reproduction_json(found: Reproduction) -> dict[str, Any]:
    """Return all results as a JSON object, with null for infinite and missing numbers.

    Curves are rounded to six significant digits, single numbers are not.
    """
    laws = {
        name: {
            **{key: getattr(estimate.law, key) for key in COEFFICIENTS},
            "sample_period_s": estimate.law.sample_period_s,
            "pole_magnitudes": np.abs(estimate.law.poles),
            "stable": estimate.law.is_stable,
            "rms_rpm": estimate.rms_rpm,
            "starts": [
                {"initial": s.initial, "rms_rpm": s.rms_rpm, "stable": s.stable, "iterations": s.iterations}
                for s in estimate.starts
            ],
        }
        for name, estimate in found.estimates.items()
    }
    return {
        "format": FORMAT,
        "version": mecanum_env.__version__,
        "seed": found.seed,
        "effort": _plain(found.effort),
        "methods": {name: contender.label for name, contender in CONTENDERS.items()},
        "definitions": {
            "success": f"rms within 5 % of {found.best_rms_rpm:.4f} rpm, the best of a stable law",
            "usable": f"rms at most {USABLE_RMS_RPM:.3f} rpm: H at most {published.OPTIMAL_COST_RPM2} rpm^2",
        },
        "best_rms_rpm": found.best_rms_rpm,
        "sigma_rpm": found.sigma_rpm,
        "fitted_ceiling_rpm": _plain(found.fitted_ceiling_rpm),
        "laws": _plain(laws),
        "starts": {"ten": _plain(found.ten_starts), "many": _plain(found.many_starts)},
        "steps": {"target": _plain(found.target), "models": _plain(found.models)},
        "errors": _plain(found.errors),
        "costs": _plain(found.costs),
        "robot": _plain(found.robot),
        "responses": {
            "steps": _plain(found.shown),
            "beyond": _plain(found.beyond),
            "beyond_limited": _plain(found.beyond_limited),
            "trials": _plain(found.trials),
        },
        "comparisons": _plain(comparisons(found)),
    }


def _plain(value: Any) -> Any:
    """Return a value as JSON can hold it, like `mecanum_env.files.plain_json`, but with arrays rounded."""
    if isinstance(value, Rate):
        return {key: getattr(value, key) for key in ("count", "of", "share", "low", "high")}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray):
        return [_rounded(x) for x in value.tolist()]
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def _rounded(value: float) -> float | None:
    return float(f"{value:.6g}") if math.isfinite(value) else None
