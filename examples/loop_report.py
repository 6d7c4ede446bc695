"""What `examples/close_the_loop.py` prints, draws and writes."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from sysid.fit import Fit
    from sysid.gap.result import GapReport
    from training.certify.certificate import Certificate
    from training.evaluate import Share

PAGE: Final = Path(__file__).with_name("close_the_loop.html")
RED, GREEN, BLUE = "#c8102e", "#0b7a75", "#1f4e79"
FIT, IMPROVED, ITSELF = "fit", "improved model", "the robot itself"
"""Models and robots of the story."""


@dataclass(frozen=True)
class Row:
    """Success of one controller on one robot."""

    controller: str
    knows: str
    """Model that the controller was made for."""
    robot: str
    """Robot or model on which it was played."""
    success: Share


def label(controller: str) -> str:
    """Return a short name of a controller: the file's name, if it is the path of a policy."""
    return Path(controller).name.replace(".npz", "")


def difference(before: Share, after: Share) -> tuple[float, float, float]:
    """Return after - before, shares of different episodes, and the 95 % interval of that difference.

    It is made of Wilson's two intervals: R. G. Newcombe, "Interval estimation for the difference between
    independent proportions: comparison of eleven methods", Statistics in Medicine 17, 1998, method 10.
    """
    change = after.value - before.value
    low = math.hypot(after.value - after.low, before.high - before.value)
    high = math.hypot(after.high - after.value, before.value - before.low)
    return change, change - low, change + high


def difference_text(before: Share, after: Share) -> str:
    """Return the change from `before` to `after` with its interval, such as "+0.30 (+0.21 .. +0.39)"."""
    change, low, high = difference(before, after)
    return f"{change:+.2f} ({low:+.2f} .. {high:+.2f})"


def holds(predicted: Share, measured: Share) -> bool:
    """Return whether the interval of the difference between predicted and measured success contains 0."""
    _, low, high = difference(predicted, measured)
    return low <= 0.0 <= high


def holds_text(predicted: Share, measured: Share) -> str:
    """Return in words whether a predicted success agrees with the measured one."""
    verdict = "contains 0: holds" if holds(predicted, measured) else "is without 0: does not hold"
    return (
        f"{predicted.value:.2f} predicted, {measured.value:.2f} on the robot; difference "
        f"{difference_text(predicted, measured)} {verdict}"
    )


def fit_text(fitted: Fit) -> str:
    """Return in words how well the bench logs were fitted."""
    best = fitted.methods[fitted.options.methods[0]]
    sigma = max(fitted.sigma_rpm.values())
    return (
        f"{best.errors['test'].rms_rpm:.2f} rpm rms on runs it never saw, where repeats differ by "
        f"{sigma:.2f} rpm; rise {best.metrics.rise_time_s:.3f} s"
    )


def warning_line(certificate: Certificate) -> str:
    """Return the warning that a certified controller needs, and whether it passed."""
    from training.certify.checks import warning_text
    from training.certify.report import verdict

    said = verdict(certificate).replace(certificate.controller, label(certificate.controller))
    return f"warning for 90 %: {warning_text(certificate.warning)}\n   {said}"


def gap_lines(report: GapReport) -> str:
    """Return what a study found: its verdict, the sizes of the effects, and equally good sets of effects."""
    from sysid.gap.wording import interval_text, set_name, unit_of, verdict_sentence

    lines = [f"{report.verdict}: {verdict_sentence(report)}"]
    for found in report.effects:
        for name, interval in found.parameters.items():
            value, ends = interval_text(interval, unit_of(found.name, name))
            often = f"in {found.selection_frequency:.0%} of resamples"
            lines.append(f"{found.name} {name} = {value} ({ends}, 90 %), {often}")
    if len(report.candidates) > 1:
        lines.append(f"tied: {' | '.join(set_name(names) for names in report.candidates)}")
    return "\n".join(f"   {line}" for line in lines)


def truth_text(truth: Mapping[str, Mapping[str, float]]) -> str:
    """Return the effects and their sizes in words."""
    from sysid.gap.wording import sizes

    return "; ".join(f"{name} {sizes(name, values)}" for name, values in truth.items())


def draw(
    out: Path, report: GapReport, rows: Sequence[Row], certificates: Sequence[Certificate]
) -> tuple[Path, ...]:
    """Draw the logs before and after, every row's success, and success against warning; return the paths.

    Args:
        out: folder to write.
        report: the study of the gap.
        rows: in the order of the story.
        certificates: of the policy on the fit, and compensated on the improved model.
    """
    from draw_gap import runs_figure

    from mecanum_env.files import atomic_path

    pictures = {
        "gap": runs_figure(report),
        "success": success_figure(rows),
        "warning": warning_figure(certificates),
    }
    paths = []
    for name, figure in pictures.items():
        paths.append(out / f"close_the_loop_{name}.png")
        with atomic_path(paths[-1]) as path:
            figure.savefig(path, dpi=90, format="png", metadata={"Software": None})
    return tuple(paths)


def success_figure(rows: Sequence[Row]) -> Any:
    """Return the figure of the rows' success with its interval, from top to bottom."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    figure = Figure(figsize=(9.0, 0.9 + 0.42 * len(rows)), layout="constrained")
    ax = figure.subplots()
    for place, row in enumerate(rows):
        real = row.robot == ITSELF
        colour = (RED if row.knows == FIT else GREEN) if real else BLUE
        share = row.success
        ax.plot([share.low, share.high], [place, place], color=colour, lw=6.0 if real else 2.5, alpha=0.35)
        ax.plot(share.value, place, "o", color=colour, ms=7.0)
        ax.annotate(
            f"{share.value:.2f}", (share.high, place), (5, -3), textcoords="offset points", fontsize=9
        )
    ax.set_yticks(range(len(rows)), [f"{label(row.controller)}  on  {row.robot}" for row in rows], fontsize=9)
    ax.invert_yaxis()
    ax.set_xlim(0.0, 1.05)
    ax.set_xlabel("share of fights won, 95 % interval")
    ax.grid(axis="x", color="#dddddd", lw=0.6)
    kinds = ((BLUE, "simulated: fit and improved model"), (RED, "the robot itself, before"), (GREEN, "after"))
    handles = [Line2D([], [], color=colour, marker="o", lw=2.5, label=label) for colour, label in kinds]
    figure.legend(handles=handles, fontsize=9, frameon=False, loc="outside upper center", ncols=3)
    return figure


def warning_figure(certificates: Sequence[Certificate]) -> Any:
    """Return the figure of success against warning time in certificates on the fit and improved model."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 3.6), layout="constrained")
    ax = figure.subplots()
    for certificate, colour, on in zip(certificates, (BLUE, GREEN), (FIT, IMPROVED), strict=True):
        curve = certificate.warning
        ax.fill_between(curve.warning_s, curve.low, curve.high, color=colour, alpha=0.18, lw=0.0)
        name = f"{label(certificate.controller)} on {on}"
        ax.plot(curve.warning_s, curve.success, color=colour, lw=2.0, label=name)
    ax.axhline(certificates[0].warning.target, color="#888888", ls=":", lw=1.0)
    ax.set_ylim(0.0, 1.02)
    ax.set_xlabel("warning: from the first visible motion of the strike to its hit [s]")
    ax.set_ylabel("success, 95 % interval")
    figure.legend(fontsize=9, frameon=False, loc="outside upper center", ncols=2)
    return figure


def summary(
    scale: Mapping[str, Any],
    fitted: Fit,
    report: GapReport,
    rows: Sequence[Row],
    truth: Mapping[str, Mapping[str, float]],
) -> dict[str, Any]:
    """Return all results of the story as a JSON object.

    Args:
        scale: how much was played.
        fitted: the fit to the bench logs.
        report: the study of the gap.
        rows: the success of every controller on every robot.
        truth: the hidden effects.
    """
    import mecanum_env

    best = fitted.methods[fitted.options.methods[0]]
    of = {(row.controller, row.robot): row.success for row in rows}
    first = rows[0].controller
    better = next(row.controller for row in rows if row.knows == IMPROVED)
    before = of[first, ITSELF]
    predictions = {
        "drop, by the fit": (of[first, FIT], before),
        "drop, by the improved model": (of[first, IMPROVED], before),
        "compensated, by the improved model": (of[better, IMPROVED], of[better, ITSELF]),
    }
    return {
        "version": mecanum_env.__version__,
        "scale": scale,
        "fit": {"test_rms_rpm": best.errors["test"].rms_rpm, "rise_time_s": best.metrics.rise_time_s},
        "gap": {
            "verdict": report.verdict,
            "effects": [asdict(found) for found in report.effects],
            "candidates": [list(names) for names in report.candidates],
            "before": report.gap.before,
            "after": report.gap.after,
            "unit": report.gap.unit,
            "noise_floor": report.gap.noise_floor,
        },
        "hidden": truth,
        "fights": [
            asdict(row) | {"controller": label(row.controller), "value": row.success.value} for row in rows
        ],
        "predictions": {
            name: {
                "predicted": predicted.value,
                "measured": measured.value,
                "difference": difference(predicted, measured),
                "holds": holds(predicted, measured),
            }
            for name, (predicted, measured) in predictions.items()
        },
        "gained": {
            label(row.controller): difference(before, row.success)
            for row in rows
            if row.robot == ITSELF and row.knows == IMPROVED
        },
    }


def write_loop_page(path: Path, story: Mapping[str, Any], fit: str, said: str) -> Path:
    """Write the page of a story beside the pictures of `draw`, and return its path.

    Args:
        path: file to write, in the folder of the story.
        story: as `summary` returns it.
        fit: how well the bench logs were fitted, in words.
        said: what the study of the gap found, in lines.
    """
    from mecanum_env.report import write_page

    fights, gained = story["fights"], story["gained"]
    real = [one for one in fights if one["robot"] == ITSELF]
    first, before, after = fights[0], real[0], real[1]

    def shown(one: Mapping[str, Any]) -> str:
        return f"{one['value']:.2f} ({one['success']['low']:.2f} .. {one['success']['high']:.2f})"

    def signed(change: Sequence[float]) -> str:
        return "{:+.2f} ({:+.2f} .. {:+.2f})".format(*change)

    write_page(
        path,
        PAGE,
        {},
        tiles=[
            (f"{first['controller']}, certified on the fit", shown(first)),
            ("the same on the robot itself", shown(before)),
            (f"{after['controller']} on the robot itself", shown(after)),
        ],
        fit=fit,
        said=textwrap.dedent(said),
        predictions=[
            (
                name,
                f"{one['predicted']:.2f}",
                f"{one['measured']:.2f}",
                signed(one["difference"]),
                "holds" if one["holds"] else "does not hold",
            )
            for name, one in story["predictions"].items()
        ],
        rows=[
            (one["controller"], shown(one), signed(gained[one["controller"]]) if number else "")
            for number, one in enumerate(real)
        ],
        hidden=truth_text(story["hidden"]),
    )
    return path
