"""The results of the experiment as tables of strings, for the page and for Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from mecanum_env.markdown import markdown_table
from sysid.studies.reproduce import published
from sysid.studies.reproduce.contenders import COMPARED, CONTENDERS, OURS, USABLE_RMS_RPM, Rate
from sysid.studies.reproduce.experiment import Reproduction
from sysid.studies.reproduce.prediction import pooled_rms
from sysid.studies.reproduce.why import Section, comparisons, percent, printed_metrics

_EQUAL = 1e-3
"""Relative difference below which two rms values count as equal; chance moves one of 300 samples
by 4 %."""


@dataclass(frozen=True)
class Table:
    """Rows of cells; the first row is the head."""

    title: str
    rows: tuple[tuple[str, ...], ...]
    note: str = ""

    def markdown(self) -> str:
        """Return the rows as Markdown."""
        return markdown_table(self.rows[0], self.rows[1:])

    @classmethod
    def of(cls, title: str, rows: Iterable[Mapping[str, str]], note: str = "") -> Table:
        """Return a table of rows that map each column's head to a cell, with a title and a note."""
        cells = list(rows)
        return cls(title, (tuple(cells[0]), *(tuple(row.values()) for row in cells)), note)


def verdict(found: Reproduction) -> str:
    """Return the experiment's outcome in three sentences."""
    many, costs = found.many_starts, found.costs
    ours = costs[OURS]
    kkt, improved, grid = (costs[name].mean_s for name in ("kkt", "kkt-improved", "exhaustive"))
    return (
        f"Output error reaches the best law from {many[OURS].success.count} of {many[OURS].starts} random "
        f"starts ({many[OURS].stable.count} stable), the improved kkt from "
        f"{many['kkt-improved'].success.count}, the kkt as published from {many['kkt'].success.count}, "
        f"plain gradient descent from {many['gradient'].success.count}. One identification takes it "
        f"{1e3 * ours.mean_s:.0f} ms of processor time, {ratio(improved, ours.mean_s)} less than the "
        f"improved kkt, {ratio(kkt, ours.mean_s)} less than the published one, {ratio(grid, ours.mean_s)} "
        f"less than the exhaustive search. {_best_on(found)}"
    )


def _best_on(found: Reproduction) -> str:
    """Return a sentence: on how many data sets output error is best, and how far it is behind elsewhere."""
    behind = [errors.rms_rpm[OURS] / min(errors.rms_rpm.values()) for errors in found.errors]
    best = sum(excess <= 1.0 + _EQUAL for excess in behind)
    return (
        f"On {best} of {len(behind)} data sets no method is nearer to the measurements by more than "
        f"{percent(_EQUAL, 1)} (at most {percent(max(behind) - 1.0, 3)})."
    )


def ratio(large: float, small: float) -> str:
    """Return the ratio of `large` to `small` as text, such as "12 times"."""
    value = large / small
    return f"{value:.0f} times" if value >= 10.0 else f"{value:.1f} times"


def starts_table(found: Reproduction) -> Table:
    """Return success and stability from the ten random starts of the paper and from many."""
    few, lots = published.STARTS, next(iter(found.many_starts.values())).starts
    rows = (
        {
            "method": CONTENDERS[name].label,
            f"success of {few}": f"{found.ten_starts[name].success.count}",
            f"success of {lots}": _rate(many.success),
            f"usable of {few}": f"{found.ten_starts[name].usable.count}",
            f"usable of {lots}": _rate(many.usable),
            f"stable of {few}": f"{found.ten_starts[name].stable.count}",
            f"stable of {lots}": _rate(many.stable),
            "paper: success, stable": _printed(name),
        }
        for name, many in found.many_starts.items()
    )
    return Table.of(
        "Success and stability",
        rows,
        f"Success: rms within 5 % of {found.best_rms_rpm:.4f} rpm, the best of a stable law. Usable, nearer "
        f"to what the paper may have counted: rms at most {USABLE_RMS_RPM:.2f} rpm, the rms of the paper's "
        f"own optimum (H = {published.OPTIMAL_COST_RPM2} rpm^2). Either may be unstable. In brackets 95 % "
        "Wilson intervals. All methods share the same starts, A-F uniform in -1..1; the improved kkt "
        "refines them first, output error reflects unstable ones.",
    )


def fates_table(found: Reproduction) -> Table:
    """Return the outcomes of the random starts."""
    rows = (
        {
            "method": CONTENDERS[name].label,
            "unstable at the start": (
                "refined first" if name == "kkt-improved" else f"{many.unstable_starts.count}"
            ),
            "usable and stable": f"{many.usable_and_stable.count}",
            "diverged": f"{many.diverged.count}",
            "out of iterations": f"{many.out_of_iterations.count}",
            "median rms [rpm]": number(float(np.median(many.rms_rpm))),
            "worst rms [rpm]": number(float(many.rms_rpm[-1])),
        }
        for name, many in found.many_starts.items()
    )
    lots = next(iter(found.many_starts.values())).starts
    return Table.of(
        f"What became of {lots} starts",
        rows,
        "Diverged: ended with an rms above the largest command, worse than a wheel at rest.",
    )


def law_table(found: Reproduction) -> Table:
    """Return every law found from the ten starts."""
    head = ("method", "A", "B", "C", "D", "E", "F", "sum", "slowest pole", "rms [rpm]")
    rows = [
        (
            CONTENDERS[name].label,
            *(f"{x:.4f}" for x in estimate.coefficients),
            f"{float(np.sum(estimate.coefficients)):.6f}",
            f"{abs(estimate.law.poles[0]):.4f}" + ("" if estimate.law.is_stable else " (unstable)"),
            number(pooled_rms(found.errors, "fit")[name]),
        )
        for name, estimate in found.estimates.items()
        if name in COMPARED
    ]
    return Table(
        "The laws",
        (head, *rows),
        f"The best of {published.STARTS} starts, used for all further results. Period 1/120 s.",
    )


def metric_table(found: Reproduction) -> Table:
    """Return steady-state error, rise and settling (Fig. 4)."""
    target = found.target
    head = (
        "",
        "error after 1 s",
        "error for ever",
        "rise [s]",
        "settling [s]",
        "paper: error, rise, settling",
    )
    measured = (target.relative_error, target.rise_s, target.settling_s)
    true = (target.true_relative_error, target.true_rise_s, target.true_settling_s)
    rows = [
        (label, f"{np.mean(error):.2e}", "", f"{np.mean(rise):.3f}", f"{np.mean(settling):.3f}", printed)
        for label, (error, rise, settling), printed in (
            ("target, measured, mean of speeds", measured, printed_metrics("target")),
            ("target, true, mean of speeds", true, ""),
        )
    ]
    rows += [
        (
            CONTENDERS[name].label,
            _figure(model.relative_error_after_1_s, ".2e"),
            _figure(model.relative_error, ".1e"),
            _figure(model.rise_s, ".3f"),
            _figure(model.settling_s, ".3f"),
            printed_metrics(name),
        )
        for name, model in found.models.items()
    ]
    return Table(
        "Steady-state error, rise and settling",
        (head, *rows),
        "Relative errors, negative = too slow. The metrics of a linear law do not depend on the speed; "
        "settling counts whole ticks of 8.3 ms. The target is not linear: the next table shows it by speed.",
    )


def speed_table(found: Reproduction) -> Table:
    """Return the target's step metrics and every method's error by speed (Fig. 4)."""
    target = found.target
    sets = [errors for errors in found.errors if errors.role == "test"]
    rows = (
        {
            "command [rpm]": f"{speed}",
            "target: error (true)": (f"{target.relative_error[i]:.1e} ({target.true_relative_error[i]:.1e})"),
            "rise [s] (true)": f"{target.rise_s[i]:.3f} ({target.true_rise_s[i]:.3f})",
            "settling [s] (true)": f"{target.settling_s[i]:.3f} ({target.true_settling_s[i]:.2f})",
            **{f"{CONTENDERS[n].label}: rms [rpm]": number(errors.rms_rpm[n]) for n in found.models},
        }
        for i, (speed, errors) in enumerate(zip(target.speeds_rpm, sets, strict=True))
    )
    return Table.of(
        "Test steps, speed by speed",
        rows,
        "Measured values are those of the mean of five repeats; true values are those of the wheel itself.",
    )


def error_table(found: Reproduction) -> Table:
    """Return every method's rms by role."""
    head = ("method", "fitted steps", "test steps", "140 rpm, limited", "random trials")
    roles = [pooled_rms(found.errors, role) for role in ("fit", "test", "beyond", "trial")]
    rows = [(CONTENDERS[name].label, *(number(role[name]) for role in roles)) for name in found.models]
    return Table(
        "rms of measured minus simulated [rpm]",
        (head, *rows),
        f"Free-running simulation. The noise alone is {found.sigma_rpm:.3f} rpm. {_best_on(found)}",
    )


def trial_table(found: Reproduction) -> Table:
    """Return the mean squared error of each random trial (Table 1)."""
    trials = [errors for errors in found.errors if errors.role == "trial"]
    head = ("MSE [rpm^2]", *(errors.name for errors in trials), "average")
    rows = []
    for name in found.models:
        values = [errors.mse_rpm2[name] for errors in trials]
        rows.append((CONTENDERS[name].label, *(number(x) for x in values), number(float(np.mean(values)))))
    return Table("Mean squared error of each trial (Table 1)", (head, *rows))


def cost_table(found: Reproduction) -> Table:
    """Return time and memory (Table 2)."""
    rows = (
        {
            "method": cost.label,
            "mean [s]": f"{cost.mean_s:.4f}",
            "median [s]": f"{cost.median_s:.4f}",
            "longest [s]": f"{cost.longest_s:.4f}",
            "repeats": f"{cost.repeats}",
            "iterations": f"{cost.mean_iterations:.0f}",
            "peak [MiB]": f"{cost.peak_memory_mib:.2f}",
            "times output error": number(cost.mean_s / found.costs[OURS].mean_s),
        }
        for cost in found.costs.values()
    )
    return Table.of(
        "One identification (Table 2)",
        rows,
        "One identification of a third-order law from one start; processor time, all in one process of one "
        "run, nothing else of this program running. Memory is the peak of Python objects and arrays, in a "
        "further call. Iterations of the exhaustive search are laws simulated: its time is a choice of "
        "grid. A search that diverges ends early, which flatters plain gradient descent. Order chosen: as "
        "`sysid.fit` runs it, from its own start, with the choice of order that no other method makes.",
    )


def robot_table(found: Reproduction) -> Table:
    """Return the robot's losses and rise times (Fig. 7)."""
    rows = (
        {
            "drive": moved.name,
            "commanded": f"{moved.commanded:.4g} {moved.unit}",
            "steady": f"{moved.steady:.4g} {moved.unit}",
            "loss": f"{moved.loss:.4f}",
            "of it wheels": f"{moved.wheel_loss:.4f}",
            "paper: loss": f"{moved.paper_loss:g}",
            "rise [s]": f"{moved.rise_s:.3f}",
            "wheels: rise [s]": f"{moved.wheel_rise_s:.3f}",
            "fall [s]": f"{moved.fall_s:.3f}",
        }
        for moved in found.robot
    )
    return Table.of(
        "Losses and rise times",
        rows,
        "Loss: (commanded - steady)/commanded. Rise and fall: 10 to 90 % of the body's speed, up and down. "
        f"The paper prints a rise of {published.ROBOT_RISE_S} s of its robot against "
        f"{published.MODEL_RISE_S} s of its model.",
    )


def comparison_table(found: Reproduction, section: Section) -> Table:
    """Return the paper's numbers of one section beside ours, and why they differ."""
    rows = tuple((c.quantity, c.paper, c.ours, c.why) for c in comparisons(found) if c.section == section)
    return Table("Beside the paper", (("", "paper", "here", "why they differ"), *rows))


def number(value: float) -> str:
    """Return a `value` as text with at most three decimals; large and infinite values are marked."""
    if not math.isfinite(value):
        return "infinite" if value > 0 else "none"
    if abs(value) >= 1e4:
        return f"{value:.0e}"
    return f"{value:.3f}" if abs(value) < 10.0 else f"{value:.1f}" if abs(value) < 1e3 else f"{value:.0f}"


def _rate(rate: Rate) -> str:
    return f"{percent(rate.share, 1)} ({100 * rate.low:.1f} to {100 * rate.high:.1f})"


def _printed(name: str) -> str:
    if name not in published.SUCCESS:
        return ""
    stable = percent(published.STABLE[name]) if name in published.STABLE else "not printed"
    return f"{percent(published.SUCCESS[name])}, {stable}"


def _figure(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "none"
