"""The search for the effects that a model lacks, and again beside those that were there when it was fitted.

Effects that the logs of the model's fit show, too, are not new (`sysid.gap.search.since`). They are put into
the model, and the search is repeated, so that they neither hide what is new nor pass for it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from mecanum_env.effects import CATALOGUE
from mecanum_env.model import Model
from sysid.compare.least_squares import ResidualProblem
from sysid.compare.model_error import (
    ModelError,
    Moved,
    Whitener,
    block_residuals,
    estimate_model_error,
)
from sysid.compare.noise import Noise, with_lasting
from sysid.compare.predicted import SimulationSettings, Simulators
from sysid.compare.search_space import Bounds
from sysid.gap.result import GapOptions, Since
from sysid.gap.search.beyond_fit import beyond_fit, limits_beyond_luck, ripples_beyond_fit
from sysid.gap.search.decision import Decision, decide, explore
from sysid.gap.search.given_set import GivenSet, beyond
from sysid.gap.search.responses import Library, responses
from sysid.gap.search.sets import Search
from sysid.gap.search.since import Completion, completed, since_of, since_of_robot
from sysid.gap.search.study_data import StudyData, study_data
from sysid.gap.search.thresholds import BESIDE_FIT_OF_ROBOT, EFFORT
from sysid.logs import Dataset
from sysid.logs.runs import UNITS
from sysid.progress import Progress, within

_MOST_COMPLETIONS: Final = 2
"""Searches after the first one, each of which takes as long. Assumed."""


@dataclass(frozen=True, eq=False)
class Inquiry:
    """What a study found in its logs: the data, the sets that were fitted, and the decision."""

    data: StudyData
    search: Search
    decision: Decision
    since: Mapping[str, Since]
    """Of each effect of the best set, what the logs of the fit say of the time when it came."""
    there: Mapping[str, Mapping[str, Bounds]] = field(default_factory=dict)
    """Effects that the logs of the model's fit show, too, and that the search took for granted: effect ->
    parameter -> value and the ends of its 90 % interval."""

    @property
    def best_model(self) -> Model | None:
        """The model with the best set of effects, named or not.

        None if nothing is significant, or if the best set explains too little to be what happened.
        """
        chosen = self.decision.facts.chosen
        if chosen is None or self.decision.verdict == "unexplained":
            return None
        model: Model = chosen.fitted.candidate.model(self.search.problem.base, chosen.fitted.place)
        return model


def inquire(
    dataset: Dataset,
    model: Model,
    options: GapOptions,
    considered: Sequence[str],
    false_alarm: float,
    progress: Progress,
) -> Inquiry:
    """Search for the sets of `considered` effects that logs show beside a model and beside what was there.

    The `base` of the problem of the search is the model, with the effects that were there already.
    Noise alone is taken for an effect with a probability `false_alarm`. `progress` is called as by
    `sysid.gap.workflow.analyse`.
    """
    found = _searched(dataset, model, options, considered, false_alarm, progress)
    there: dict[str, Mapping[str, Bounds]] = {}
    for _ in range(_MOST_COMPLETIONS):
        completion = _completion(found)
        if completion is None:
            break
        there |= completion.effects
        progress(stage := "what is new beside what was there already")
        tell = within(progress, stage)
        found = _searched(dataset, completion.model, options, considered, false_alarm, tell)
    return replace(found, there=there)


def _completion(found: Inquiry) -> Completion | None:
    """Return the model with those effects of the best set that were there already; None if none was."""
    chosen, learned = found.decision.facts.chosen, found.data.learned
    already = [name for name, since in found.since.items() if since == "already when fitted"]
    if chosen is None or learned is None or not already:
        return None
    return completed(learned, chosen.fitted, already)


def _searched(
    dataset: Dataset,
    model: Model,
    options: GapOptions,
    considered: Sequence[str],
    false_alarm: float,
    progress: Progress,
) -> Inquiry:
    settings = SimulationSettings(options.plant, options.jobs, seed=options.seed)
    progress("data check")
    data = study_data(dataset, model, options)
    data = replace(data, floor=replace(data.floor, false_alarm=false_alarm))
    progress(stage := "what each effect would do")
    given = {} if options.fitted_here is None else beyond(model, options.fitted_here, considered)
    search = start_search(data, model, settings, considered, within(progress, stage), given=given)
    if not data.floor.trusted:
        progress(stage := "how far the model errs by itself")
        search.tell = within(progress, stage)
        data = replace(data, error=_error_of_best_fit(data, search, options.max_effects))
        simulators = search.problem.simulators
        search = start_search(data, model, settings, considered, search.tell, simulators, given)
    progress(stage := "sets of effects")
    search.tell = within(progress, stage)
    decision = decide(search, data.floor, options.max_effects, np.random.default_rng(settings.seed))
    simulators = search.problem.simulators

    def again(data: StudyData, stage: str) -> tuple[Search, Decision]:
        progress(stage)
        tell = within(progress, stage)
        search = start_search(data, model, settings, considered, tell, simulators, given)
        search.tell = tell
        search.told_before = frozenset(one.names for one in decision.facts.tied)
        return search, decide(search, data.floor, options.max_effects, np.random.default_rng(settings.seed))

    error = _error_beside_best_fit(data, search, decision)
    if error is not None and error != data.error:
        # That there is a gap is certain: what is left of it tells how many effects, and which.
        data = replace(data, error=error)
        search, decision = again(data, "sets of effects beside what the best one leaves")
    noise = _with_lasting(data, search)
    if decision.facts.chosen is not None and noise.lasting != data.noise.lasting:
        told = tuple(map(_lasting_note, noise.lasting.items()))
        # The noise is measured in these logs: the error is not that of the logs of the fit alone any more.
        floor = replace(data.floor, compared=False, lasting=True)
        error = _with_scatter(data, search)
        data = replace(data, noise=noise, error=error, floor=floor, notes=(*data.notes, *told))
        search, decision = again(data, "sets of effects beside noise that lasts")
    return Inquiry(data, search, decision, _since(data, search.problem, decision))


def start_search(
    data: StudyData,
    model: Model,
    settings: SimulationSettings,
    considered: Sequence[str],
    tell: Progress,
    simulators: Simulators | None = None,
    given: GivenSet | None = None,
) -> Search:
    """Return the search of a study before any set is fitted: what the `considered` effects would do.

    Args:
        data: what the logs tell, beside the `model` to study.
        model: of the robot or the drive, as it was given.
        settings: of the simulations.
        considered: names of the effects to look for.
        tell: called with the name of each before it is simulated.
        simulators: of an earlier search of the same logs, if there was one.
        given: a set of effects to try whole, whatever the search grows; None: there is none.
    """
    whitener = Whitener(data.observations, data.noise, data.error)
    problem = ResidualProblem(model, whitener, settings, simulators, data.repeated or data.learned)
    level = data.observations.situations[0].runs[0].level
    found = responses(problem, considered, tell=tell)
    library = Library(found)
    if data.learned is not None and problem.knows_all:
        library = beyond_fit(problem, data.learned, found)
    elif data.repeated is not None:
        # Of a ripple, whose phase every run draws, nothing is left but the noise of repeats. A robot's limit
        # or threshold is the same in each run: what it does at one size would hide whatever looks like it.
        steady = [
            Moved(r.change, r.chosen.model(model, r.place), problem.surrogate_covers([r.effect]))
            for r in found
            if not CATALOGUE[r.effect].follows_angle and (r.linear or problem.bench)
        ]
        repeated = data.repeated.with_varying(whitener, steady)
        problem = ResidualProblem(model, whitener, settings, problem.simulators, repeated)
        found = [replace(r, change=problem.marginal(r.change)) for r in found]
        library = ripples_beyond_fit(problem, repeated, found)
        if problem.knows_all:
            library = limits_beyond_luck(problem, library, data.floor.false_alarm)
    search = Search(problem, library, BESIDE_FIT_OF_ROBOT if problem.knows_all else EFFORT[level])
    search.given = given or {}
    return search


def _error_of_best_fit(data: StudyData, search: Search, max_effects: int) -> ModelError:
    """Return the model's own error as the best set of effects leaves it.

    It is the only estimate if the model was fitted to these very logs, or states no error.
    """
    problem = search.problem
    explore(search, data.floor, max_effects, np.random.default_rng(problem.settings.seed))
    parts = problem.whitener.unwhiten(problem.marginal_inverse(search.best_fit.residual))
    return estimate_model_error(block_residuals(data.observations, data.noise, parts))


def _error_beside_best_fit(data: StudyData, search: Search, decision: Decision) -> ModelError | None:
    """Return a drive's own error in other commands than those of its fit, as the best set leaves it.

    None where that is not asked: where a gap may be nothing but this error, it may not be taken for one.
    """
    facts, problem = decision.facts, search.problem
    if data.learned is None or not data.floor.new_on_bench or not facts.is_plain or facts.chosen is None:
        return None
    parts = problem.whitener.unwhiten(problem.marginal_inverse(search.best_fit.residual))
    return data.learned.error_of(data.observations, data.noise, parts, problem.simulators)


def _with_lasting(data: StudyData, search: Search) -> Noise:
    """Return the noise with what lasts as long as a command is held, as the best set of effects leaves it."""
    problem = search.problem
    before, after = (
        problem.whitener.unwhiten(problem.marginal_inverse(fitted.residual))
        for fitted in (search.base, search.best_fit)
    )
    return with_lasting(data.noise, data.observations, before, after)


def _with_scatter(data: StudyData, search: Search) -> ModelError | None:
    """Return the model's error, after changes of command no less than what the best set of effects leaves.

    Without repeats nothing else tells by how much two changes of the same size differ.
    """
    if data.error is None:
        return None
    problem = search.problem
    parts = problem.whitener.unwhiten(problem.marginal_inverse(search.best_fit.residual))
    left = estimate_model_error(block_residuals(data.observations, data.noise, parts)).channels
    channels = {
        name: replace(error, transient=max(error.transient, left[name].transient))
        if data.noise.source.get(name) != "repeats" and name in left
        else error
        for name, error in data.error.channels.items()
    }
    return replace(data.error, channels=channels)


def _lasting_note(item: tuple[str, float]) -> str:
    channel, size = item
    return (
        f"{channel}: the same command does not give the same speed each time, by {size:.2g} "
        f"{UNITS[channel]} (rms) beside the best set of effects; this counts as noise"
    )


def _since(data: StudyData, problem: ResidualProblem, decision: Decision) -> Mapping[str, Since]:
    """Return what the logs of the fit, where these are known, say of the effects of the best set.

    Where the commands of the fit are driven again, what every effect does in the logs of the fit is taken
    off: what is found came later.
    """
    chosen = decision.facts.chosen
    if chosen is None:
        return {}
    if data.repeated is not None:
        return dict.fromkeys(chosen.names, "new")
    if data.learned is None:
        return {}
    dated = since_of_robot if problem.knows_all else since_of
    return dated(problem, data.learned, chosen.fitted)
