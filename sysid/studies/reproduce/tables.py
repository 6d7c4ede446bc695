"""The results of the experiment as tables of strings, for the page and for Markdown."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mecanum_env.markdown import markdown_table
from sysid.studies.reproduce import published
from sysid.studies.reproduce.contenders import COMPARED, CONTENDERS, OURS
from sysid.studies.reproduce.experiment import Reproduction
from sysid.studies.reproduce.prediction import pooled_rms
from sysid.studies.reproduce.starts import USABLE_RMS_RPM, Rate, StartRates
from sysid.studies.reproduce.why import Section, comparisons, percent

EQUAL = 1e-3
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
        f"less than the exhaustive search. {best_on(found)}"
    )


def best_on(found: Reproduction) -> str:
    """Return a sentence: on how many data sets output error is best, and how far it is behind elsewhere."""
    behind = [errors.rms_rpm[OURS] / min(errors.rms_rpm.values()) for errors in found.errors]
    best = sum(excess <= 1.0 + EQUAL for excess in behind)
    return (
        f"On {best} of {len(behind)} data sets no method is nearer to the measurements by more than "
        f"{percent(EQUAL, 1)} (at most {percent(max(behind) - 1.0, 3)})."
    )


def ratio(large: float, small: float) -> str:
    """Return the ratio of `large` to `small` as text, such as "12 times"."""
    value = large / small
    return f"{value:.0f} times" if value >= 10.0 else f"{value:.1f} times"


def starts_table(found: Reproduction) -> Table:
    """Return success and stability from the ten random starts of the paper and from many."""
    few, lots = published.STARTS, next(iter(found.many_starts.values())).starts
    head = (
        "method",
        f"success of {few}",
        f"success of {lots}",
        f"usable of {few}",
        f"usable of {lots}",
        f"stable of {few}",
        f"stable of {lots}",
        "paper: success, stable",
    )
    rows = [
        (
            CONTENDERS[name].label,
            _count(ten.success),
            _rate(many.success),
            _count(ten.usable),
            _rate(many.usable),
            _count(ten.stable),
            _rate(many.stable),
            _printed(name),
        )
        for name, ten, many in _both(found)
    ]
    return Table(
        "Success and stability",
        (head, *rows),
        f"Success: rms within 5 % of {found.best_rms_rpm:.4f} rpm, the best of a stable law. Usable, nearer "
        f"to what the paper may have counted: rms at most {USABLE_RMS_RPM:.2f} rpm, the rms of the paper's "
        f"own optimum (H = {published.OPTIMAL_COST_RPM2} rpm^2). Either may be unstable. In brackets 95 % "
        "Wilson intervals. All methods share the same starts, A-F uniform in -1..1; the improved kkt "
        "refines them first, output error reflects unstable ones.",
    )


def fates_table(found: Reproduction) -> Table:
    """Return the outcomes of the random starts."""
    head = (
        "method",
        "unstable at the start",
        "usable and stable",
        "diverged",
        "out of iterations",
        "median rms [rpm]",
        "worst rms [rpm]",
    )
    rows = [
        (
            CONTENDERS[name].label,
            "refined first" if name == "kkt-improved" else f"{many.unstable_starts.count}",
            f"{many.usable_and_stable.count}",
            f"{many.diverged.count}",
            f"{many.out_of_iterations.count}",
            number(float(np.median(many.rms_rpm))),
            number(float(many.rms_rpm[-1])),
        )
        for name, _, many in _both(found)
    ]
    lots = next(iter(found.many_starts.values())).starts
    return Table(
        f"What became of {lots} starts",
        (head, *rows),
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
    rows = []
    for label, (error, rise, settling), printed in (
        ("target, measured, mean of speeds", measured, _printed_metrics("target")),
        ("target, true, mean of speeds", true, ""),
    ):
        rows.append(
            (label, f"{np.mean(error):.2e}", "", f"{np.mean(rise):.3f}", f"{np.mean(settling):.3f}", printed)
        )
    for name, model in found.models.items():
        rows.append(
            (
                CONTENDERS[name].label,
                _figure(model.relative_error_after_1_s, ".2e"),
                _figure(model.relative_error, ".1e"),
                _figure(model.rise_s, ".3f"),
                _figure(model.settling_s, ".3f"),
                _printed_metrics(name),
            )
        )
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
    head = (
        "command [rpm]",
        "target: error (true)",
        "rise [s] (true)",
        "settling [s] (true)",
        *(f"{CONTENDERS[name].label}: rms [rpm]" for name in found.models),
    )
    rows = [
        (
            f"{speed}",
            f"{target.relative_error[i]:.1e} ({target.true_relative_error[i]:.1e})",
            f"{target.rise_s[i]:.3f} ({target.true_rise_s[i]:.3f})",
            f"{target.settling_s[i]:.3f} ({target.true_settling_s[i]:.2f})",
            *(number(errors.rms_rpm[name]) for name in found.models),
        )
        for i, (speed, errors) in enumerate(zip(target.speeds_rpm, sets, strict=True))
    ]
    return Table(
        "Test steps, speed by speed",
        (head, *rows),
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
        f"Free-running simulation. The noise alone is {found.sigma_rpm:.3f} rpm. {best_on(found)}",
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
    ours = found.costs[OURS]
    head = (
        "method",
        "mean [s]",
        "median [s]",
        "longest [s]",
        "repeats",
        "iterations",
        "peak [MiB]",
        "times output error",
    )
    rows = [
        (
            cost.label,
            f"{cost.mean_s:.4f}",
            f"{cost.median_s:.4f}",
            f"{cost.longest_s:.4f}",
            f"{cost.repeats}",
            f"{cost.mean_iterations:.0f}",
            f"{cost.peak_memory_mib:.2f}",
            number(cost.mean_s / ours.mean_s),
        )
        for cost in found.costs.values()
    ]
    return Table(
        "One identification (Table 2)",
        (head, *rows),
        "One identification of a third-order law from one start; processor time, all in one process of one "
        "run, nothing else of this program running. Memory is the peak of Python objects and arrays, in a "
        "further call. Iterations of the exhaustive search are laws simulated: its time is a choice of "
        "grid. A search that diverges ends early, which flatters plain gradient descent. Order chosen: as "
        "`sysid.fit` runs it, from its own start, with the choice of order that no other method makes.",
    )


def robot_table(found: Reproduction) -> Table:
    """Return the robot's losses and rise times (Fig. 7)."""
    head = (
        "drive",
        "commanded",
        "steady",
        "loss",
        "of it wheels",
        "paper: loss",
        "rise [s]",
        "wheels: rise [s]",
        "fall [s]",
    )
    rows = []
    for moved in found.robot:
        rows.append(
            (
                moved.name,
                f"{moved.commanded:.4g} {moved.unit}",
                f"{moved.steady:.4g} {moved.unit}",
                f"{moved.loss:.4f}",
                f"{moved.wheel_loss:.4f}",
                f"{moved.paper_loss:g}",
                f"{moved.rise_s:.3f}",
                f"{moved.wheel_rise_s:.3f}",
                f"{moved.fall_s:.3f}",
            )
        )
    return Table(
        "Losses and rise times",
        (head, *rows),
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


def _both(found: Reproduction) -> list[tuple[str, StartRates, StartRates]]:
    return [(name, found.ten_starts[name], many) for name, many in found.many_starts.items()]


def _count(rate: Rate) -> str:
    return f"{rate.count}"


def _rate(rate: Rate) -> str:
    return f"{percent(rate.share, 1)} ({100 * rate.low:.1f} to {100 * rate.high:.1f})"


def _printed(name: str) -> str:
    if name not in published.SUCCESS:
        return ""
    stable = percent(published.STABLE[name]) if name in published.STABLE else "not printed"
    return f"{percent(published.SUCCESS[name])}, {stable}"


def _printed_metrics(name: str) -> str:
    if name not in published.RISE_S:
        return ""
    return f"{published.STEADY_ERROR[name]:.2e}, {published.RISE_S[name]} s, {published.SETTLING_S[name]} s"


def _figure(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "none"
