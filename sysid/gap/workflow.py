"""A study of the gap from logs and model to report: the whole workflow as one function call."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

import mecanum_env
from mecanum_env.model import Model
from mecanum_env.model.file import model_to_dict
from mecanum_env.parallel import one_thread
from sysid.compare.lasting import with_lasting
from sysid.compare.learned import Learned
from sysid.compare.model_error import ModelError, estimate_model_error
from sysid.compare.noise import Noise
from sysid.compare.own_error import block_residuals
from sysid.compare.prediction import Study
from sysid.compare.problem import ResidualProblem
from sysid.compare.simulator import Simulators, without_engine_warnings
from sysid.compare.whitening import Whitener
from sysid.gap.adoption import improved_model
from sysid.gap.design.experiment import Design
from sysid.gap.design.next_experiment import design_next_experiment
from sysid.gap.late_links import late_logs
from sysid.gap.link_found import with_link_fault
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
from sysid.gap.result import CustomProposal, GapOptions, GapReport, Since
from sysid.gap.search.chance import chance_gains, roller_scatter, smallest_detectable, untestable
from sysid.gap.search.custom import propose
from sysid.gap.search.data import (
    StudyData,
    is_meant,
    known_effects,
    require_movement,
    require_valid,
    study_data,
)
from sysid.gap.search.decision import Decision, decide, explore
from sysid.gap.search.responses import responses
from sysid.gap.search.sets import Search
from sysid.gap.search.since import since_of
from sysid.gap.search.thresholds import EFFORT
from sysid.gap.spending import budget_of, with_studies
from sysid.logs import Dataset, Run
from sysid.logs.runs import UNITS
from sysid.logs.tails import weighted_down
from sysid.progress import Progress, silent, within


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
        model: preferably fitted to other logs than these, so that the size of its own error is known.
        options: seed, effects to consider, jobs.
        progress: called with the name of each stage, and within a long one with how far it is.

    Raises:
        InputError: options that make no sense for the logs, logs in which nothing moves, or a model that
            cannot be simulated.
    """
    dataset = runs if isinstance(runs, Dataset) else Dataset("logs", tuple(runs), ())
    options = options or GapOptions()
    require_valid(options, dataset.level, dataset.columns)
    require_movement(dataset)
    dataset, tails = weighted_down(dataset)
    budget = budget_of(dataset, model, options)
    fitted_on = None if options.fitted_on is None else weighted_down(options.fitted_on)[0]
    with without_engine_warnings(), one_thread():
        late = late_logs(dataset, model)
        if late is None:
            options = replace(options, fitted_on=fitted_on)
            report = _analyse(dataset, model, options, budget.level, progress)
            progress("delays of single commands")
            report = with_link_fault(
                dataset,
                model,
                options,
                report,
                lambda logs, base, chosen: _analyse(logs, base, chosen, budget.level, silent),
            )
        else:
            fitted_on = None if fitted_on is None else late.alike(fitted_on)
            options = replace(options, fitted_on=fitted_on)
            found = _analyse(late.dataset, late.model, options, budget.level, progress)
            report = late.described(found)
    heavy = tuple(one.note(channel) for channel, one in tails.items())
    return replace(
        report,
        notes=(*heavy, *budget.notes, *report.notes),
        tails=tails,
        false_alarm=budget.level,
        studies=budget.studies,
        model=with_studies(report.model, budget.studies),
    )


def _analyse(
    dataset: Dataset, model: Model, options: GapOptions, false_alarm: float, progress: Progress
) -> GapReport:
    study = Study(options.plant, options.jobs, seed=options.seed)
    known = known_effects(dataset.level, options.plant, dataset.columns)
    only = options.only or known
    considered = [name for name in known if is_meant(name, only) and not is_meant(name, options.exclude)]
    progress("data check")
    data = study_data(dataset, model, options)
    data = replace(data, floor=replace(data.floor, false_alarm=false_alarm))
    progress(stage := "what each effect would do")
    search = _start_search(data, model, study, considered, within(progress, stage))
    if not data.floor.trusted:
        progress(stage := "how far the model errs by itself")
        search.tell = within(progress, stage)
        data = replace(data, error=_error_of_best_fit(data, search, options.max_effects))
        search = _start_search(data, model, study, considered, search.tell, search.problem.simulators)
    progress(stage := "sets of effects")
    search.tell = within(progress, stage)
    decision = decide(search, data.floor, options.max_effects, np.random.default_rng(study.seed))
    noise = _with_lasting(data, search)
    if decision.facts.chosen is not None and noise.lasting != data.noise.lasting:
        progress(stage := "sets of effects beside noise that lasts")
        told = tuple(map(_lasting_note, noise.lasting.items()))
        # The noise is measured in these logs: the error is not that of the logs of the fit alone any more.
        floor = replace(data.floor, compared=False)
        error = _with_scatter(data, search)
        data = replace(data, noise=noise, error=error, floor=floor, notes=(*data.notes, *told))
        tell = within(progress, stage)
        search = _start_search(data, model, study, considered, tell, search.problem.simulators)
        decision = decide(search, data.floor, options.max_effects, np.random.default_rng(study.seed))
    progress("before and after")
    return _report(dataset, model, options, data, search, considered, decision)


def _start_search(
    data: StudyData,
    model: Model,
    study: Study,
    considered: Sequence[str],
    tell: Progress,
    simulators: Simulators | None = None,
) -> Search:
    whitener = Whitener(data.observations, data.noise, data.error)
    problem = ResidualProblem(model, whitener, study, simulators, data.learned)
    level = data.observations.situations[0].runs[0].level
    return Search(problem, responses(problem, considered, tell=tell), EFFORT[level])


def _error_of_best_fit(data: StudyData, search: Search, max_effects: int) -> ModelError:
    """Return the model's own error as the best set of effects leaves it.

    It is the only estimate if the model was fitted to these very logs, or states no error.
    """
    problem = search.problem
    explore(search, data.floor, max_effects, np.random.default_rng(problem.study.seed))
    parts = problem.whitener.unwhiten(problem.marginal_inverse(search.best_fit.residual))
    return estimate_model_error(block_residuals(data.observations, data.noise, parts))


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


def _report(
    dataset: Dataset,
    model: Model,
    options: GapOptions,
    data: StudyData,
    search: Search,
    considered: Sequence[str],
    decision: Decision,
) -> GapReport:
    problem = search.problem
    study = problem.study
    split, runs = held_out(dataset)
    effects = found_effects(problem, decision, _since(data.learned, decision))
    improved = improved_model(model, decision, effects)
    proposal = None
    if decision.verdict == "unexplained":
        situations = data.observations.situations
        whole = all(run in dataset.runs for situation in situations for run in situation.runs)
        proposal = propose(problem, whole=whole)
    before = predicted(model, runs, study)
    custom = None
    if proposal is not None:
        described = model.with_custom(proposal.effect)
        with_it = compare(split, runs, before, predicted(described, runs, study))
        left = differences(dataset, with_it)[0].after
        custom = CustomProposal(
            proposal.effect, proposal.explained, proposal.stations_tied, left, options.adopt
        )
        improved = described if options.adopt else improved
    after = before if improved is model else predicted(improved, runs, study)
    comparison = compare(split, runs, before, after)
    gap, channels = differences(dataset, comparison)
    scatter = roller_scatter(problem, search.base)
    rng = np.random.default_rng(study.seed)
    threshold = chance_gains(search.base, search.library, rng, scatter, data.floor.false_alarm).threshold()
    detectable = smallest_detectable(search.library, threshold)
    unseen = untestable(considered, search.library, detectable, dataset.level, dataset.columns)
    asked = Design(None, "")
    if options.next_experiment:
        asked = design_next_experiment(problem, dataset.runs, decision, improved, unseen, threshold)
    unanswered = () if asked.experiment or not asked.why else (asked.why,)
    return GapReport(
        verdict=decision.verdict,
        effects=effects,
        candidates=tuple(dict.fromkeys(judged.causes for judged in decision.candidates)),
        gap=gap,
        channels=channels,
        where=regions(comparison.samples),
        untestable=unseen,
        smallest_detectable=detectable,
        next_experiment=asked.experiment,
        evidence=evidence(dataset, problem, decision, data.floor),
        p_value=decision.facts.p_value,
        model=improved,
        base=model,
        level=dataset.level,
        dataset=dataset.name,
        findings=dataset.findings,
        notes=(*options.notes, *data.notes, *decision.notes, *unanswered),
        overlays=overlays(comparison),
        custom=custom,
        provenance={
            "seed": study.seed,
            "data_sha256": dataset.sha256,
            "model_sha256": hashlib.sha256(
                json.dumps(model_to_dict(model), sort_keys=True).encode()
            ).hexdigest(),
            "version": mecanum_env.__version__,
        },
        held_out=split,
        unseen=split == "test" and len(runs) < len(dataset.runs),
        trusted=data.floor.trusted,
    )


def _since(learned: Learned | None, decision: Decision) -> Mapping[str, Since]:
    """Return what the logs of the fit, where these are known, say of the chosen effects.

    Of a robot, what every effect does in the logs of the fit is taken off: what is found came later.
    """
    if learned is None or decision.chosen is None:
        return {}
    if not learned.is_bench:
        return dict.fromkeys(decision.chosen.names, "new")
    return since_of(learned, decision.chosen.fitted)
