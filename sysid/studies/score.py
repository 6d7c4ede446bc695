"""Score answers to GapBench: `python score.py ANSWERS`, beside the benchmark's truth folder.

The definitions of all words and metrics are here, and nowhere else. The file stands alone: it needs Python
3.10 and no package.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import statistics
import sys
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

FORMAT = "gapbench-answers/1"
VERDICTS = ("no_gap", "unexplained", "named", "ambiguous", "error")
"""What an answer may say of a case; "error": the method failed on it."""

WORDS = {
    "right": "the hidden set was named; a change without a name was called unexplained; what logs cannot "
    "show was said to be untestable, or not claimed",
    "rightly ambiguous": "the hidden set is among the candidates",
    "overclaimed": "the hidden effects were named with others that are not there",
    "vague": "only some of the hidden effects were named, or the candidates contain some of them",
    "abstained": "unexplained, though the hidden effects have names",
    "missed": "no gap, though something was hidden",
    "wrong": "no hidden effect was named, or one of several beside one that is not there",
    "quiet": "nothing was hidden, and no gap was found",
    "false alarm": "nothing was hidden, and a gap was found",
    "false name": "an effect was named for a change that no name covers",
    "error": "the fit or the study ended with an error",
}
"""Word -> what it says of a case."""
FOUND = frozenset({"right", "rightly ambiguous"})
"""The words of a hidden set that was found."""
RIGHT_ANSWERS = FOUND | {"quiet"}
WRONG_ANSWERS = frozenset({"overclaimed", "wrong", "false alarm", "false name"})
"""The words of an answer that claims what is not there."""
NAMED_KINDS = ("single", "twin", "pair", "triple")
"""Kinds of cases whose hidden effects have names and can be seen."""
OUTSIDERS = ("near_outsider", "far_outsider")
"""Kinds of cases whose change no name covers."""
SIZES = {
    "undetectable": (0.0, 0.3),
    "weak": (0.3, 1.0),
    "clear": (1.0, 5.0),
    "gross": (5.0, math.inf),
}
"""Size of a change -> from and below which signal: rms of what it does to the logs, over the noise."""
VISIBLE = ("clear", "gross")


class AnswerError(ValueError):
    """An answers folder or a benchmark folder that does not follow its format."""


def claims_of(
    verdict: str, named: Iterable[str], candidates: Iterable[Iterable[str]]
) -> tuple[frozenset[str], ...]:
    """Return every set of effects that a verdict offers as the explanation; empty if it offers none.

    `named` are the effects of the verdict "named", `candidates` the sets of "ambiguous".
    """
    if verdict == "named":
        return (frozenset(named),)
    return tuple(map(frozenset, candidates)) if verdict == "ambiguous" else ()


def word_of(
    kind: str,
    hidden: frozenset[str],
    verdict: str,
    claims: Sequence[frozenset[str]],
    said_untestable: bool = False,
) -> str:
    """Return the word, one of `WORDS`, for an answer.

    Args:
        kind: of the case, as in truth.json.
        hidden: names of the hidden effects.
        verdict: of the answer.
        claims: sets that it offers (`claims_of`).
        said_untestable: whether it says that these logs cannot show the hidden effects at their sizes.
    """
    if verdict == "error":
        return "error"
    if kind == "quiet":
        return "quiet" if verdict == "no_gap" else "false alarm"
    if kind in OUTSIDERS:
        if claims:
            return "false name"
        return "missed" if verdict == "no_gap" else "right"
    if kind == "untestable" and (verdict == "no_gap" or (verdict == "unexplained" and said_untestable)):
        return "right"
    if verdict == "no_gap":
        return "missed"
    return _word_of_claims(hidden, claims) if claims else "abstained"


def _word_of_claims(hidden: frozenset[str], claims: Sequence[frozenset[str]]) -> str:
    """Return the word for the sets that a verdict offers, at least one, against the hidden set."""
    if hidden in claims:
        return "right" if len(claims) == 1 else "rightly ambiguous"
    if all(claim > hidden for claim in claims):
        return "overclaimed"
    if all(claim < hidden for claim in claims) or (len(claims) > 1 and any(c & hidden for c in claims)):
        return "vague"
    return "wrong"


def size_of(signal: float) -> str:
    """Return the size, one of `SIZES`, of a change by its signal."""
    return next(size for size, (_, end) in SIZES.items() if signal < end or math.isinf(end))


def signal_of(signal: float, alone: Sequence[float]) -> float:
    """Return the signal that counts for a case's size: of several effects, the smallest that one has `alone`.

    `signal` is that of the whole change.
    """
    return min(alone) if len(alone) > 1 and all(alone) else signal


def closure(before: float, after: float, floor: float) -> float:
    """Return (before - after) / (before - floor); NaN where there was no gap, or no known floor.

    Args:
        before: rms error of the simulator on test runs.
        after: the same with what the method added.
        floor: the same for a perfect simulator: the noise of repeats.
    """
    return (before - after) / (before - floor) if before > floor else math.nan


def intervals_held(
    hidden: Mapping[str, Mapping[str, float]],
    named: Collection[str],
    intervals: Mapping[str, Mapping[str, tuple[float, float]]],
) -> tuple[tuple[str, str, bool], ...]:
    """Return (effect, parameter, whether its interval holds the truth) where just the hidden set was named.

    Args:
        hidden: effect -> parameter -> truth, for parameters of which there is one.
        named: effects of the answer.
        intervals: effect -> parameter -> ends of its 90 % interval; others are left out.
    """
    if not hidden or set(named) != set(hidden):
        return ()
    return tuple(
        (name, key, ends[0] <= truth <= ends[1])
        for name, truths in hidden.items()
        for key, truth in truths.items()
        if (ends := intervals.get(name, {}).get(key)) is not None
    )


def is_smaller(value: float, other: float, neutral: float) -> bool:
    """Return whether a value lies between neutral, which may be infinite, and the `other` value."""
    return other < value < neutral or neutral < value < other


def wilson(hits: int, count: int) -> tuple[float, float]:
    """Return the ends of the 95 % Wilson interval of a share of `hits` in a `count`; NaN for none."""
    if not count:
        return math.nan, math.nan
    z = 1.959963984540054
    share, spread = hits / count, z * z / count
    middle = (share + spread / 2.0) / (1.0 + spread)
    half = z * math.sqrt(share * (1.0 - share) / count + spread / (4.0 * count)) / (1.0 + spread)
    return min(max(middle - half, 0.0), share), max(min(middle + half, 1.0), share)


@dataclass(frozen=True)
class Scored:
    """One case with its answer's word."""

    case: str
    kind: str
    size: str
    """One of `SIZES`; "unknown" for recordings of real machines."""
    word: str
    sets: int
    """Sets of effects that the answer offers as the explanation."""
    closure: float
    """On the hidden test runs; NaN where there was no gap or no prediction by this method at all."""
    held: tuple[bool, ...]
    """For each interval that could be checked, whether it holds the truth."""
    seconds: float
    """That the method took; NaN if it does not say."""


def score_folder(answers: Path, bench: Path) -> list[Scored]:
    """Return the scores of an `answers` folder, case by case, against the truth in a `bench` folder.

    Raises:
        AnswerError: a folder that does not follow its format; the message names file, case and value.
    """
    path = answers / "answers.json"
    given = _read(path)
    if given.get("format") != FORMAT or not isinstance(given.get("cases"), dict):
        raise AnswerError(f"{path}: format must be {FORMAT} and cases an object; see answers.schema.json")
    truths = {p.parent.name: _read(p) for p in sorted((bench / "truth").glob("*/truth.json"))}
    if not truths:
        raise AnswerError(f"{bench}: no truth/CASE/truth.json in it; give the benchmark's folder")
    unknown = sorted(given["cases"].keys() - truths.keys())
    if unknown:
        raise AnswerError(f"{path}: case {unknown[0]} is not in the benchmark, which has {', '.join(truths)}")
    names = {entry["name"] for entry in _read(bench / "names.json")["effects"]}
    predicts = any((answers / "predictions").glob("*/*.csv"))
    scored = []
    for case, truth in truths.items():
        answer = given["cases"].get(case, {"verdict": "error"})
        _check(answer, f"{path}: case {case}", names)
        scored.append(_scored(case, truth, answer, answers, bench, predicts))
    return scored


def _scored(
    case: str, truth: Mapping[str, Any], answer: Mapping[str, Any], answers: Path, bench: Path, predicts: bool
) -> Scored:
    effects = {effect["name"]: effect.get("parameters", {}) for effect in answer.get("effects", [])}
    hidden = {h["name"]: {k: float(v) for k, v in h["parameters"].items()} for h in truth["hidden"]}
    claims = claims_of(answer["verdict"], effects, answer.get("candidates", []))
    intervals = {
        name: {key: (float(p["low"]), float(p["high"])) for key, p in parameters.items()}
        for name, parameters in effects.items()
    }
    signal = truth["signal"]
    alone = [_number(h["signal"]) for h in truth["hidden"]]
    size = "unknown" if signal is None else size_of(signal_of(float(signal), alone))
    before, floor = (_number(truth["test"][end]) for end in ("before", "floor"))
    after = math.nan
    if predicts:
        # Without a prediction for this case nothing was added to the simulator.
        found = _error(answers / "predictions" / case, bench / "truth" / case / "test", truth["test"])
        after = before if found is None else found
    held = intervals_held(hidden, effects, intervals) if answer["verdict"] == "named" else ()
    said = _untestable(truth["hidden"], answer)
    return Scored(
        case=case,
        kind=truth["kind"],
        size=size,
        word=word_of(truth["kind"], frozenset(hidden), answer["verdict"], claims, said),
        sets=len(claims),
        closure=closure(before, after, floor),
        held=tuple(inside for _, _, inside in held),
        seconds=float(answer.get("seconds", math.nan)),
    )


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)


def _untestable(hidden: Sequence[Mapping[str, Any]], answer: Mapping[str, Any]) -> bool:
    """Return whether an answer calls all hidden effects untestable, or shown only above their true sizes."""
    said = answer.get("untestable", {})
    return bool(hidden) and all(h["effect"] in said and _out_of_sight(h, said[h["effect"]]) for h in hidden)


def _out_of_sight(hidden: Mapping[str, Any], seen: Mapping[str, Any]) -> bool:
    """Return whether the true size is below what can be `seen`: smallest sizes, or nothing if empty."""
    truths = hidden["parameters"].items()
    return not seen or (
        bool(truths)
        and all(
            key in seen and is_smaller(float(value), float(seen[key]), float(hidden["neutral"][key]))
            for key, value in truths
        )
    )


def _error(predicted: Path, measured: Path, test: Mapping[str, Any]) -> float | None:
    """Return the rms error of predictions of the test runs; None if there are none for the case."""
    if not predicted.is_dir():
        return None
    squares: list[float] = []
    for path in sorted(measured.glob("*.csv")):
        true, said = (_column(p, test["channel"]) for p in (path, predicted / path.name))
        if len(true) != len(said):
            raise AnswerError(f"{predicted / path.name}: {len(said)} rows, must be {len(true)} as in {path}")
        squares += [(t - s) ** 2 for t, s in zip(true, said, strict=True) if math.isfinite(t)]
    return math.sqrt(statistics.fmean(squares)) if squares else None


def _column(path: Path, name: str) -> list[float]:
    """Return a column of a CSV file; an empty cell is NaN."""
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return [float(row[name]) if row[name] else math.nan for row in csv.DictReader(file)]
    except (OSError, KeyError, ValueError) as error:
        raise AnswerError(f"{path}: needs a column {name} of numbers ({error!r})") from error


def _check(answer: Any, where: str, names: Collection[str]) -> None:
    """Refuse an answer with an unknown verdict or name, or without what its verdict needs."""
    verdict = answer.get("verdict") if isinstance(answer, dict) else None
    if verdict not in VERDICTS:
        raise AnswerError(f"{where}: verdict is {verdict!r}, must be one of {', '.join(VERDICTS)}")
    said = [effect["name"] for effect in answer.get("effects", [])]
    sets = [list(names) for names in answer.get("candidates", [])]
    if verdict == "named" and not said:
        raise AnswerError(f"{where}: verdict named needs effects, a list of objects with a name")
    if verdict == "ambiguous" and len(sets) < 2:
        raise AnswerError(f"{where}: verdict ambiguous needs at least two candidates, lists of names")
    for name in (*said, *(name for names in sets for name in names)):
        if name not in names:
            raise AnswerError(f"{where}: {name!r} is no name; names.json has {', '.join(sorted(names))}")


def _read(path: Path) -> dict[str, Any]:
    try:
        read: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, json.JSONDecodeError) as error:
        raise AnswerError(f"{path}: cannot be read ({error})") from error
    return read


@dataclass(frozen=True)
class Metric:
    """A share of cases with its 95 % Wilson interval, or a median without one; NaN where no case counts."""

    name: str
    value: float
    low: float
    high: float
    count: int
    """Number of cases, of intervals or of values."""

    def text(self) -> str:
        """Return the value and its interval in words."""
        if math.isnan(self.value):
            return "-"
        if math.isnan(self.low):
            return f"{self.value:.3g}"
        return f"{100 * self.value:.0f} % ({100 * self.low:.0f} to {100 * self.high:.0f})"


def metrics(scored: Sequence[Scored]) -> tuple[Metric, ...]:
    """Return the headline metrics of one method on `scored` cases."""
    named = [s for s in scored if s.kind in NAMED_KINDS]
    visible = [s for s in named if s.size in VISIBLE]
    return (
        _share("right answers", (s.word in RIGHT_ANSWERS for s in scored)),
        _share("wrong answers", (s.word in WRONG_ANSWERS for s in scored)),
        _share("clear and gross found", (s.word in FOUND for s in visible)),
        _share("weak found", (s.word in FOUND for s in named if s.size == "weak")),
        _share("real found", (s.word in FOUND for s in named if s.size == "unknown")),
        _share("false alarms", (s.word == "false alarm" for s in scored if s.kind == "quiet")),
        _share("names for what has none", (s.word == "false name" for s in scored if s.kind in OUTSIDERS)),
        _share("coverage", (inside for s in scored for inside in s.held)),
        _median("sets if ambiguous", (s.sets for s in scored if s.sets > 1)),
        _median("closure", (s.closure for s in visible)),
        _median("seconds", (s.seconds for s in scored)),
    )


def _share(name: str, hits: Iterable[bool]) -> Metric:
    got = list(hits)
    value = sum(got) / len(got) if got else math.nan
    return Metric(name, value, *wilson(sum(got), len(got)), len(got))


def _median(name: str, values: Iterable[float]) -> Metric:
    known = [value for value in values if math.isfinite(value)]
    return Metric(name, statistics.median(known) if known else math.nan, math.nan, math.nan, len(known))


def main() -> int:
    """Print the words and the metrics of an answers folder; return 2 if it does not follow its format."""
    here = Path(__file__).resolve().parent
    parser = argparse.ArgumentParser(description="Score an answers folder against the truth of GapBench.")
    parser.add_argument("answers", type=Path, help="folder with answers.json and, if any, predictions/")
    parser.add_argument(
        "--bench", type=Path, default=here, help="the benchmark's folder; default: this file's"
    )
    parser.add_argument("--cases", action="store_true", help="also print one line per case")
    options = parser.parse_args()
    try:
        scored = score_folder(options.answers, options.bench)
    except AnswerError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    for one in scored if options.cases else ():
        print(f"{one.case}  {one.kind:<13}  {one.size:<12}  {one.word:<17}  closure {one.closure:.2f}")
    for word in (word for word in WORDS if any(one.word == word for one in scored)):
        print(f"{word:<24}{sum(one.word == word for one in scored):4d}")
    for metric in metrics(scored):
        print(f"{metric.name:<24}{metric.text()}, of {metric.count}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
