"""A study of the gap from logs and model to report: the whole workflow as one function call."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

import mecanum_env
from mecanum_env.model import Model
from mecanum_env.model.file import model_to_dict
from sysid.compare.correction import KEY
from sysid.compare.model_error import ModelError, estimate_model_error, model_error_of
from sysid.compare.noise import Noise, measure_noise
from sysid.compare.observations import Observations, observe
from sysid.compare.own_error import block_residuals
from sysid.compare.problem import ResidualProblem
from sysid.compare.simulator import without_engine_warnings
from sysid.compare.study import Study
from sysid.compare.subset import select_runs
from sysid.compare.whitening import Whitener
from sysid.gap.checks import known_effects, require_movement, require_valid
from sysid.gap.design.experiment import Design
from sysid.gap.design.next_experiment import design_next_experiment
from sysid.gap.report.held_out import (
    compare,
    differences,
    evidence,
    found_effects,
    held_out,
    overlays,
    predicted,
)
from sysid.gap.report.where import regions
from sysid.gap.result import EmpiricalTerm, FoundEffect, GapOptions, GapReport
from sysid.gap.search.adequacy import Floor, rough
from sysid.gap.search.chance import chance, smallest_detectable, untestable
from sysid.gap.search.decide import Decision, decide
from sysid.gap.search.regression import empirical_term, fit_correction
from sysid.gap.search.responses import responses
from sysid.gap.search.sets import Search, SearchEffort
from sysid.logs import Dataset, Run
from sysid.progress import Progress, silent

SECONDS: Final = {"bench": 240.0, "robot": 60.0}
"""Of log that is simulated again and again in the search."""
UNLIKE: Final = 2.0
"""Repeats on the bench that differ so many times as much as neighbouring samples are worth a look."""
RESTLESS: Final = 5.0
"""Repeats on the bench that differ so many times as much as neighbouring samples are none."""
EFFORT: Final = {"bench": SearchEffort(15, 16, 8, 20, 5), "robot": SearchEffort(8, 8, 4, 4, 3)}


@dataclass(frozen=True, eq=False)
class _Study:
    """The runs that may be looked at, and what a right model would leave of them."""

    observations: Observations
    noise: Noise
    error: ModelError | None
    floor: Floor
    notes: tuple[str, ...]


def analyse(
    runs: Dataset | Sequence[Run],
    model: Model,
    options: GapOptions | None = None,
    progress: Progress = silent,
) -> GapReport:
    """Find where a model and logs disagree, which effects are missing, and what adding them gains.

    Fit and validation runs decide; test runs only show the result.

    Args:
        runs: bench or robot logs, as `sysid.logs.read_dataset` gives them, or the runs alone.
        model: fitted to other logs than these, at best: then how far it errs by itself is known.
        options: seed, effects to consider, jobs.
        progress: called with a message before each long step.

    Raises:
        InputError: options that make no sense for the logs, logs in which nothing moves, or a model that
            cannot be simulated.
    """
    dataset = runs if isinstance(runs, Dataset) else Dataset("logs", tuple(runs), ())
    options = options or GapOptions()
    require_valid(options, dataset.level)
    require_movement(dataset)
    with without_engine_warnings():
        return _analyse(dataset, model, options, progress)


def _analyse(dataset: Dataset, model: Model, options: GapOptions, progress: Progress) -> GapReport:
    rng = np.random.default_rng(options.seed)
    considered = _considered(dataset, options)
    progress("data check")
    study = _study(dataset, model, options)
    progress("what each effect would do")
    problem, search = _search(study, model, considered, options)
    if not study.floor.trusted:
        # What the best set leaves is all that tells how far a law errs that was fitted to these very logs.
        progress("how far the model errs by itself")
        decide(problem, search, study.floor, options.max_effects, np.random.default_rng(options.seed))
        study = replace(study, error=_left(study, problem, search))
        problem, search = _search(study, model, considered, options)
    progress("sets of effects")
    decision = decide(problem, search, study.floor, options.max_effects, rng)
    progress("before and after")
    return _report(dataset, model, options, study, problem, search, considered, decision)


def _considered(dataset: Dataset, options: GapOptions) -> tuple[str, ...]:
    known = known_effects(dataset.level, options.plant)
    return tuple(n for n in known if n not in options.exclude and (not options.only or n in options.only))


def _study(dataset: Dataset, model: Model, options: GapOptions) -> _Study:
    notes = []
    runs = dataset.split("fit") + dataset.split("validation")
    if not runs:
        runs = dataset.runs
        notes.append("all runs are test runs: they decide too, so nothing is left to check the decision")
    elif not dataset.split("test"):
        notes.append("no test runs: before and after are shown on runs that the decision has seen")
    most = SECONDS[dataset.level] if options.seconds is None else options.seconds
    fewer = select_runs(runs, most, model.wheel.command_period_s)
    length, whole = (sum(run.duration_s for run in some) for some in (fewer, runs))
    if any(run not in runs for run in fewer):
        notes.append(
            f"{len(fewer)} pieces of the runs ({length:.0f} of {whole:.0f} s) that cover the speeds decide; "
            "what grows with the time in a run is not seen in them"
        )
    elif len(fewer) < len(runs):
        notes.append(f"{len(fewer)} of {len(runs)} runs ({length:.0f} s), the liveliest, decide")
    if options.plant == "planar":
        left = [name for name in known_effects("robot") if name not in known_effects("robot", "planar")]
        notes.append(f"simulated without slip (plant planar): {', '.join(left)} are not looked for")
    observations = observe(replace(dataset, runs=fewer))
    noise = measure_noise(dataset, observations)
    scattered = [name for name, source in noise.source.items() if source == "scatter"]
    if scattered:
        notes.append(
            f"no repeats for {', '.join(scattered)}: noise from neighbouring samples of held commands"
        )
    error = model_error_of(model)
    same = error is not None and error.data_sha256 == dataset.sha256 != ""
    if same:
        error = None
        notes.append(
            "the model was fitted to these very logs: how far it errs by itself is not known from others, so "
            "no set of effects is called inadequate"
        )
    trusted = not same and (noise.from_repeats or error is not None)
    if not same and not trusted:
        notes.append("no repeats, and the model states no error of its own: what is left may be noise or not")
    # A robot's wheels slip a little otherwise in each repeat; a wheel on the bench has no such excuse.
    restless = noise.inconsistent_channels(RESTLESS) if dataset.level == "bench" else ()
    if dataset.level == "bench" and noise.inconsistent_channels(UNLIKE):
        notes.append(
            f"repeats of one command differ more than {UNLIKE:g} times as much as neighbouring samples: "
            "something that is not in the commands changes from run to run; look at the repeats"
        )
    floor = Floor(noise.degrees_of_freedom, trusted, not restless)
    return _Study(observations, noise, error, floor, tuple(notes))


def _search(
    study: _Study, model: Model, considered: Sequence[str], options: GapOptions
) -> tuple[ResidualProblem, Search]:
    settings = Study(options.plant, options.jobs, seed=options.seed)
    problem = ResidualProblem(model, Whitener(study.observations, study.noise, study.error), settings)
    level = study.observations.situations[0].runs[0].level
    return problem, Search(problem, responses(problem, considered), EFFORT[level])


def _left(study: _Study, problem: ResidualProblem, search: Search) -> ModelError:
    """Return the model's error as the best fit leaves it."""
    best = min(search.fitted.values(), key=lambda fitted: fitted.cost)
    parts = problem.whitener.unwhiten(problem.marginal_inverse(best.residual))
    return estimate_model_error(block_residuals(study.observations, study.noise, parts))


def _report(
    dataset: Dataset,
    model: Model,
    options: GapOptions,
    study: _Study,
    problem: ResidualProblem,
    search: Search,
    considered: Sequence[str],
    decision: Decision,
) -> GapReport:
    split, runs = held_out(dataset)
    effects = found_effects(problem, decision)
    improved = _improved(model, decision, effects)
    term = None
    if decision.verdict == "unexplained":
        improved, term = _empirical(study, improved, options, problem.study)
    before = predicted(model, runs, problem.study)
    after = before if improved is model else predicted(improved, runs, problem.study)
    comparison = compare(split, runs, before, after)
    gap, channels = differences(dataset, comparison)
    rng = np.random.default_rng(options.seed)
    threshold = chance(search.base, search.library, rng, rough(problem, search.base)).threshold()
    detectable = smallest_detectable(search.library, threshold)
    unseen = untestable(considered, search.library, detectable, dataset.level)
    asked = Design(None, "")
    if options.next_experiment:
        asked = design_next_experiment(problem, decision, improved, unseen, threshold)
    unanswered = () if asked.experiment or not asked.why else (asked.why,)
    return GapReport(
        verdict=decision.verdict,
        effects=effects,
        candidates=tuple(judged.names for judged in decision.candidates),
        gap=gap,
        channels=channels,
        where=regions(comparison.samples),
        untestable=unseen,
        smallest_detectable=detectable,
        next_experiment=asked.experiment,
        evidence=evidence(dataset, problem, decision, study.floor),
        p_value=decision.p_value,
        model=improved,
        base=model,
        level=dataset.level,
        dataset=dataset.name,
        findings=dataset.findings,
        notes=(*study.notes, *decision.notes, *unanswered),
        overlays=overlays(comparison),
        empirical=term,
        provenance={
            "seed": options.seed,
            "data_sha256": dataset.sha256,
            "model_sha256": hashlib.sha256(
                json.dumps(model_to_dict(model), sort_keys=True).encode()
            ).hexdigest(),
            "version": mecanum_env.__version__,
        },
        held_out=split,
        unseen=split == "test" and len(runs) < len(dataset.runs),
        trusted=study.floor.trusted,
    )


def _empirical(
    study: _Study, model: Model, options: GapOptions, settings: Study
) -> tuple[Model, EmpiricalTerm | None]:
    """Return the model, with the term if asked, and a readable term for what is left where runs decide."""
    runs = [run for situation in study.observations.situations for run in situation.runs]
    shown = predicted(model, runs, settings)
    correction = fit_correction(compare("fit", runs, shown, shown).samples)
    if correction is None:
        return model, None
    if options.empirical:
        model = replace(model, extra={**model.extra, KEY: correction.as_json()})
    return model, empirical_term(correction, adopted=options.empirical)


def _improved(model: Model, decision: Decision, effects: Sequence[FoundEffect]) -> Model:
    if decision.chosen is None:
        return model
    fitted = decision.chosen.fitted
    candidate = fitted.candidate
    improved: Model = candidate.model(model, fitted.place)
    stated = {found.name: found.intervals for found in effects}
    known = model.uncertainty.get("effects") or {}
    return replace(improved, uncertainty={**model.uncertainty, "effects": {**known, **stated}})
