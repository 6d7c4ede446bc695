"""The study as tables and sentences, for Markdown, and its record as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from mecanum_env.markdown import markdown_table
from sysid.studies.paper_gap.drives import HOLD_S, NUMBERS, PAPER, TOLERANCE, TURN_RPM
from sysid.studies.paper_gap.sets import SetFit
from sysid.studies.paper_gap.study import ALL_SOFT, INTEGRAL_N_M_RAD, TURN, TURN_SPEEDS_RPM, PaperGap, Reach
from sysid.studies.reproduce.published import FIT_STEPS_RPM

_HEAD: Final = ("10 rpm", "40 rpm", "80 rpm", "130 rpm", "turn", "rise s")


def paper_gap_markdown(found: PaperGap) -> str:
    """Return the whole study as Markdown."""
    parts = [
        "# Results of `python -m sysid.studies.paper_gap`",
        "Written by the command itself; do not edit. The paper's robot is slower than its model: section 4.5 "
        "prints five losses of steady speed and one rise time. Which effects reproduce all six at once?",
        conclusion(found),
        "## What is assumed",
        assumptions(),
        "## What the losses are in rpm",
        speeds(),
        "A constant friction loses the same rpm at every speed; viscous friction, a gain or a wrong radius "
        "lose the same share; a ceiling loses nothing below it. None of them alone gives these losses.",
        "## What each effect alone can do",
        "Largest change of each number over the catalogue's bounds; - means below the tolerance.",
        _reach_table(found.reach),
        "## What the paper suspects",
        "Each was fitted to all six numbers; bold numbers are missed by more than the tolerance.",
        _suspect_table(found),
        _turn_text(found),
        "## Sets of effects",
        f"{found.worsts.size} sets of up to four effects were fitted, each size grown from the best of the "
        "size before: a beam, not all sets. Shown are the nearest of each size and all that reproduce the "
        "six numbers. Misfit: root mean square of the deviations over their tolerances; worst: the largest, "
        "at most 1 where all six are reproduced. "
        f"Half the tolerance would leave {np.sum(found.worsts <= 0.5)} sets, twice the tolerance "
        f"{np.sum(found.worsts <= 2.0)}.",
        _set_table(found),
        "## The same on rollers",
        "The search runs on the planar plant. The sets that reproduce the numbers there give on rollers:",
        _roller_table(found),
    ]
    return "\n\n".join(parts) + "\n"


def paper_gap_json(found: PaperGap) -> dict[str, Any]:
    """Return the study for a JSON file."""
    return {
        "figures": list(NUMBERS),
        "paper": PAPER.tolist(),
        "tolerance": TOLERANCE.tolist(),
        "hold_s": HOLD_S,
        "turn_rpm": TURN_RPM,
        "model_as_it_is": found.base.tolist(),
        "reach": {r.name: {"least": r.least.tolist(), "most": r.most.tolist()} for r in found.reach},
        "sets_tried": found.worsts.size,
        "sets": [_set_json(f) for f in found.sets],
        "on_rollers": {
            " + ".join(f.names): six.tolist()
            for f, six in zip(found.reproducing, found.on_rollers, strict=True)
        },
        "suspects": [{"title": title, **_set_json(fit)} for title, fit in found.suspects.items()],
        "suspects_without_turn": {
            **_set_json(found.turn.fit),
            "turn_speeds_rpm": TURN_SPEEDS_RPM.tolist(),
            "turn_losses": found.turn.losses.tolist(),
        },
        "with_integral_action": _set_json(found.integral),
    }


def _set_json(found: SetFit) -> dict[str, Any]:
    return {
        "effects": found.values,
        "parameters": found.chosen.parameter_count,
        "predicted": np.nan_to_num(found.six).tolist(),
        "misfit": found.misfit,
        "worst": found.worst,
    }


def conclusion(found: PaperGap) -> str:
    """Return the answer in a few sentences."""
    good = [
        f
        for f, six in zip(found.reproducing, found.on_rollers, strict=True)
        if np.max(np.abs(six - PAPER) / TOLERANCE) <= 1.0
    ]
    if not good:
        return "No set of up to four effects reproduces the six numbers within the tolerance."
    least = good[0].chosen.parameter_count
    spare = PAPER.size - least
    common = set(good[0].names).intersection(*(f.names for f in good))
    every = [name for name in good[0].names if name in common]
    together = found.suspects[ALL_SOFT]
    missed = [_HEAD[i] for i in _missed(together)]
    return (
        f"{len(good)} sets reproduce all six numbers, on rollers too, the smallest with {least} "
        f"parameters: only {spare} more number{'s' if spare != 1 else ''} than "
        "parameters, so six numbers cannot tell them apart. "
        f"The simplest is {sizes(good[0])}. "
        + (f"All of them have {' and '.join(every)}. " if every else "")
        + "The paper's suspects together (load, rolling friction, latency, a soft saturation) miss: "
        + f"{', '.join(missed) if missed else 'nothing'}. Latency changes none of the six."
    )


def assumptions() -> str:
    """Return the assumptions that replace what the paper does not print."""
    return "\n".join(
        [
            f"- A loss is reproduced within {TOLERANCE[0]:g}, the rise within {TOLERANCE[-1]:g} s: the text "
            "prints three and two digits, and neither spread nor repeats.",
            "- The one rise time is taken as the mean of the five drives.",
            f"- The turn is at VC = {TURN_RPM:.1f} rpm: that is 1.484 rad/s with this project's dimensions. "
            "The paper prints none, and neither mass, torque nor servo: N m and kg below are those of this "
            "project's robot. What the losses show is the ratio of friction to servo.",
            "- Speeds are those of a perfect sensor of the body, apart from sensor effects. The "
            "paper's MPU9250 measures turning directly and straight speed only through accelerations.",
        ]
    )


def speeds() -> str:
    """Return the paper's straight drives in rpm."""
    rows = [
        (str(v), f"{loss:.4g}", f"{v * (1 - loss):.1f}", f"{v * loss:.1f}")
        for v, loss in zip(FIT_STEPS_RPM, PAPER[:TURN], strict=True)
    ]
    return markdown_table(("commanded rpm", "loss", "reached rpm", "lost rpm"), rows)


def _reach_table(reach: tuple[Reach, ...]) -> str:
    """Return how far each effect changes each number."""
    rows = []
    for one in reach:
        cells = [
            "-" if not moved else " .. ".join(f"{x:+.2g}" for x in (low, high) if abs(x) > tolerance)
            for low, high, moved, tolerance in zip(one.least, one.most, one.moves, TOLERANCE, strict=True)
        ]
        rows.append((one.name, *cells))
    return markdown_table(("effect", *_HEAD), rows)


def _suspect_table(found: PaperGap) -> str:
    """Return the best predictions of the paper's suspects."""
    fits = [
        (title, sizes(fit), *_predicted(fit), f"{fit.misfit:.1f}") for title, fit in found.suspects.items()
    ]
    rows = [("paper", "", *map(_figure, PAPER), ""), *fits]
    return markdown_table(("suspect", "effects", *_HEAD, "misfit"), rows)


def _turn_text(found: PaperGap) -> str:
    """Return what the suspects predict of the turn when it is not fitted."""
    turn = found.turn
    lowest = int(np.argmin(turn.losses))
    return (
        f"Fitted to the straight drives and the rise alone, {sizes(turn.fit)} leaves a misfit of "
        f"{np.sqrt(np.mean(np.delete(turn.fit.deviation, TURN) ** 2)):.2f} there, and the turn comes out at "
        f"{turn.fit.six[TURN]:.3f} instead of {PAPER[TURN]:.4f}. The wheel speed of the paper's turn is not "
        f"printed, but at no speed is the loss less than {turn.losses[lowest]:.3f} "
        f"(at {TURN_SPEEDS_RPM[lowest]:.0f} rpm): what acts on the wheels slows turning as much as driving. "
        "The turn therefore needs an effect that distinguishes the two: dimensions other than those of the "
        "kinematics, or different sensors."
    )


def _set_table(found: PaperGap) -> str:
    """Return the table of sets."""
    integral = f"with integral action of {INTEGRAL_N_M_RAD:g} N m/rad: {sizes(found.integral)}"
    rows = [
        ("paper", "", *map(_figure, PAPER), "", ""),
        *(_set_row(sizes(f), f) for f in found.sets),
        _set_row(integral, found.integral),
    ]
    return markdown_table(("set", "parameters", *_HEAD, "misfit", "worst"), rows)


def _roller_table(found: PaperGap) -> str:
    """Return the numbers on rollers of the sets that reproduce the paper's."""
    rows = [("the model as it is", *map(_figure, found.base), "")]
    for one, six in zip(found.reproducing, found.on_rollers, strict=True):
        worst = float(np.max(np.abs(six - PAPER) / TOLERANCE))
        rows.append((" + ".join(one.names), *map(_figure, six), f"{worst:.2f}"))
    return markdown_table(("set", *_HEAD, "worst"), rows)


def sizes(found: SetFit) -> str:
    """Return the effects of a set with their fitted parameters."""
    return " + ".join(f"{name} ({_values(values)})" for name, values in found.values.items())


def _values(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value if abs(value) >= 1e-4 else 0.0:.3g}" for name, value in values.items())


def _set_row(text: str, found: SetFit) -> tuple[str, ...]:
    predicted = _predicted(found)
    return (text, str(found.chosen.parameter_count), *predicted, f"{found.misfit:.2f}", f"{found.worst:.2f}")


def _missed(found: SetFit) -> list[int]:
    return [i for i, far in enumerate(np.abs(found.deviation) > 1.0) if far]


def _predicted(found: SetFit) -> list[str]:
    missed = _missed(found)
    return [f"**{_figure(x)}**" if i in missed else _figure(x) for i, x in enumerate(found.six)]


def _figure(value: float) -> str:
    return f"{abs(value) if abs(value) < 5e-5 else value:.4f}"
