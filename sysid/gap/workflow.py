"""A study of the gap from logs and model to report: the whole workflow as one function call."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

import mecanum_env
from mecanum_env.model import Model
from mecanum_env.model.file import model_to_dict
from mecanum_env.parallel import one_thread
from sysid.compare.simulator import without_engine_warnings
from sysid.gap.adoption import improved_model
from sysid.gap.design.experiment import Design
from sysid.gap.design.next_experiment import design_next_experiment
from sysid.gap.findings import Findings, find
from sysid.gap.late_links import late_logs
from sysid.gap.link_found import with_link_fault
from sysid.gap.report.held_out import (
    compare,
    differences,
    evidence,
    found_before,
    found_effects,
    held_out,
    overlays,
    predicted,
)
from sysid.gap.report.where import regions
from sysid.gap.result import CustomProposal, GapOptions, GapReport
from sysid.gap.search.chance import chance_gains, roller_scatter, smallest_detectable, untestable
from sysid.gap.search.custom import propose
from sysid.gap.search.data import is_meant, known_effects, require_movement, require_valid
from sysid.gap.spending import budget_of, with_studies
from sysid.logs import Dataset, Run
from sysid.logs.tails import weighted_down
from sysid.progress import Progress, silent


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
    known = known_effects(dataset.level, options.plant, dataset.columns)
    only = options.only or known
    considered = [name for name in known if is_meant(name, only) and not is_meant(name, options.exclude)]
    found = find(dataset, model, options, considered, false_alarm, progress)
    progress("before and after")
    return _report(dataset, model, options, found, considered)


def _report(
    dataset: Dataset,
    model: Model,
    options: GapOptions,
    found: Findings,
    considered: Sequence[str],
) -> GapReport:
    data, search, decision = found.data, found.search, found.decision
    problem = search.problem
    study = problem.study
    split, runs = held_out(dataset)
    effects = found_effects(problem, decision, found.since)
    if effects:
        effects = (*effects, *found_before(problem, found))
    improved = improved_model(model, problem.base, decision, effects)
    proposal = None
    if decision.verdict == "unexplained":
        situations = data.observations.situations
        whole = all(run in dataset.runs for situation in situations for run in situation.runs)
        proposal = propose(problem, whole=whole)
    before = predicted(model, runs, study)
    custom = None
    if proposal is not None:
        described = problem.base.with_custom(proposal.effect)
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
        notes=(*options.notes, *data.notes, *_there_notes(found), *decision.notes, *unanswered),
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


def _there_notes(found: Findings) -> tuple[str, ...]:
    """Return what is said of effects that the logs of the fit show and the model lacks."""
    if not found.there:
        return ()
    names = " + ".join(found.there)
    return (
        f"{names}: the logs of the fit show this, too, and the model lacks it; the study goes on beside it. "
        "Fit the model again with effects (python -m sysid.fit --effects auto)",
    )
