"""A study of the gap from logs and model to report: the whole workflow as one function call."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

import mecanum_env
from mecanum_env.model import Model, model_sha256
from mecanum_env.parallel import one_thread
from sysid.compare.links import AlignedLogs
from sysid.compare.predicted import without_engine_warnings
from sysid.gap.adoption import found_effects, improved_model
from sysid.gap.design.experiment import Design
from sysid.gap.design.next_experiment import design_next_experiment
from sysid.gap.inquiry import Inquiry, inquire
from sysid.gap.link_faults import as_given, with_link_fault
from sysid.gap.only_in_test import odd_test_runs, only_in_test
from sysid.gap.refuted import at_least_thresholds, not_in_test_runs, refuted, verdict_of_refuted
from sysid.gap.report.beside_fit import gap_beside_fit
from sysid.gap.report.held_out import (
    Channels,
    compare,
    differences,
    evidence,
    held_out,
    overlays,
    predicted,
    without_scatter,
)
from sysid.gap.report.where import regions
from sysid.gap.result import CustomProposal, GapOptions, GapReport, Untestable
from sysid.gap.runs_apart import with_runs_apart
from sysid.gap.search.chance import chance_gains, expected
from sysid.gap.search.checks import require_movement, require_valid
from sysid.gap.search.custom import propose
from sysid.gap.search.detectable import smallest_detectable, untestable
from sysid.gap.search.known_effects import effects_for, is_meant
from sysid.gap.search.one_sequence import OF_ONE, is_asked, least_falls
from sysid.gap.spending import budget_of, with_studies
from sysid.gap.unshown import with_unshown
from sysid.logs import Dataset, Run
from sysid.logs.common_times import with_common_times
from sysid.logs.tails import weighted_down
from sysid.progress import Progress, silent


def analyse(
    runs: Dataset | Sequence[Run],
    model: Model,
    options: GapOptions | None = None,
    progress: Progress = silent,
) -> GapReport:
    """Find where a model and logs disagree, which effects are missing, and what adding them gains.

    Fit and validation runs decide; test runs show the result, and refute effects that raise the error there.

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
    require_valid(options, dataset.level, dataset)
    require_movement(dataset)
    dataset, tails = weighted_down(dataset)
    dataset, apart = with_runs_apart(dataset)
    budget = budget_of(dataset, model, options)
    fitted_on = None if options.fitted_on is None else weighted_down(options.fitted_on)[0]
    if fitted_on is not None:
        dataset, fitted_on = with_common_times(dataset, fitted_on)
    with without_engine_warnings(), one_thread():
        late = AlignedLogs.stated(dataset, model, options.fitted_here)
        if late is None:
            options = replace(options, fitted_on=fitted_on)
            report, best = _analyse(dataset, model, options, budget.level, progress)
            progress("delays of single commands")
            report = with_link_fault(
                dataset,
                model,
                options,
                report,
                best,
                lambda logs, base, chosen: _analyse(logs, base, chosen, budget.level, silent)[0],
            )
        else:
            fitted_on = None if fitted_on is None else late.beside(fitted_on)
            options = replace(options, fitted_on=fitted_on)
            found, _ = _analyse(late.dataset, late.model, options, budget.level, progress)
            report = as_given(found, late)
    heavy = tuple(one.note(channel) for channel, one in tails.items())
    return replace(
        report,
        notes=(*heavy, *budget.notes, *apart, *report.notes),
        tails=tails,
        false_alarm=budget.level,
        studies=budget.studies,
        model=with_studies(report.model, budget.studies),
    )


def _analyse(
    dataset: Dataset, model: Model, options: GapOptions, false_alarm: float, progress: Progress
) -> tuple[GapReport, Model]:
    """Return the report of a study, and the model with the best set of effects, named or not."""
    known = effects_for(dataset, options.plant)
    only = options.only or known
    considered = [name for name in known if is_meant(name, only) and not is_meant(name, options.exclude)]
    found = inquire(dataset, model, options, considered, false_alarm, progress)
    progress("before and after")
    report = _report(dataset, model, options, found, considered)
    why = refuted(report, found.data.floor)
    if why and (least := at_least_thresholds(found)) is not None:
        cautious = _report(dataset, model, options, least, considered)
        if not refuted(cautious, found.data.floor):
            found, report, why = least, cautious, ""
    if why:
        notes = (*found.decision.notes, why)
        verdict = verdict_of_refuted(found.decision.facts)
        decision = replace(found.decision, verdict=verdict, chosen=None, candidates=(), notes=notes)
        found = replace(found, decision=decision)
        report = _report(dataset, model, options, found, considered)
    if silent := not_in_test_runs(report):
        report = replace(report, notes=(*report.notes, silent))
    return with_unshown(report), found.best_model or model


def _report(
    dataset: Dataset,
    model: Model,
    options: GapOptions,
    found: Inquiry,
    considered: Sequence[str],
) -> GapReport:
    """Return the results of a study: what was found, what adding it gains, and what to measure next."""
    problem, decision = found.search.problem, found.decision
    split, runs = held_out(dataset)
    effects = found_effects(found)
    improved = improved_model(model, found, effects)
    before = predicted(model, runs, problem.settings)
    custom = _custom(dataset, found, before, options)
    if custom is not None and custom.adopted:
        improved = problem.base.with_custom(custom.effect)
    after = before if improved is model else predicted(improved, runs, problem.settings)
    comparison = compare(split, runs, before, after)
    noise = problem.whitener.noise.sigma
    gap, channels = differences(dataset, comparison, noise, options.fitted_on)
    beside = None
    if options.fitted_on is not None:
        names = [effect.name for effect in effects]
        smooth = without_scatter(problem, names, (model, improved), runs, (before, after))
        compared = compare(split, runs, before, smooth)
        beside = gap_beside_fit(dataset, options.fitted_on, model, compared, runs, noise, problem.settings)
    detectable, unseen, asked = _what_is_open(dataset, options, found, considered, improved)
    unanswered = () if asked.experiment or not asked.why else (asked.why,)
    hidden, odd = "", ""
    if decision.verdict == "no_gap":
        hidden = only_in_test(dataset, model, options.fitted_on)
        odd = "" if hidden else odd_test_runs(dataset, model, options.fitted_on)
    return GapReport(
        verdict="unexplained" if hidden else decision.verdict,
        effects=effects,
        candidates=tuple(dict.fromkeys(judged.causes for judged in decision.candidates)),
        gap=gap,
        channels=channels,
        where=regions(comparison.samples),
        untestable=unseen,
        smallest_detectable=detectable,
        next_experiment=asked.experiment,
        evidence=evidence(dataset, problem, decision, found.data.floor),
        p_value=decision.facts.p_value,
        model=improved,
        base=model,
        level=dataset.level,
        dataset=dataset.name,
        findings=dataset.findings,
        notes=(
            *options.notes,
            *found.data.notes,
            *_there_notes(found),
            *decision.notes,
            *unanswered,
            *filter(None, (hidden, odd)),
        ),
        overlays=overlays(comparison),
        custom=custom,
        provenance={
            "seed": options.seed,
            "data_sha256": dataset.sha256,
            "model_sha256": model_sha256(model),
            "version": mecanum_env.__version__,
        },
        held_out=split,
        unseen=split == "test" and len(runs) < len(dataset.runs),
        trusted=found.data.floor.trusted,
        gap_beside_fit=beside,
    )


def _custom(
    dataset: Dataset, found: Inquiry, before: Sequence[Channels], options: GapOptions
) -> CustomProposal | None:
    """Return the custom effect that describes an unexplained gap, and what is left with it on held-out runs.

    None if the gap is explained, or if neither a formula nor a table describes it. `before` is what the model
    as given predicts for the held-out runs.
    """
    if found.decision.verdict != "unexplained":
        return None
    problem = found.search.problem
    situations = found.data.observations.situations
    whole = all(run in dataset.runs for situation in situations for run in situation.runs)
    proposal = propose(problem, whole=whole)
    if proposal is None:
        return None
    split, runs = held_out(dataset)
    described = predicted(problem.base.with_custom(proposal.effect), runs, problem.settings)
    comparison, noise = compare(split, runs, before, described), problem.whitener.noise.sigma
    left = differences(dataset, comparison, noise, options.fitted_on)[0].after
    return CustomProposal(proposal.effect, proposal.explained, proposal.stations_tied, left, options.adopt)


def _what_is_open(
    dataset: Dataset, options: GapOptions, found: Inquiry, considered: Sequence[str], improved: Model
) -> tuple[Mapping[str, Mapping[str, float]], tuple[Untestable, ...], Design]:
    """Return the sizes of effects that these logs would show, the effects that none would, and what to drive.

    The sizes are effect -> parameter -> value.
    """
    search, floor = found.search, found.data.floor
    rng = np.random.default_rng(options.seed)
    chance = chance_gains(search.problem, search.base, search.library, rng, floor.false_alarm)
    threshold, least = chance.threshold(), dict(search.considered.least)
    library = (*search.library, *search.considered.left_out)
    needed = max(floor.slack * threshold, floor.least_share * expected(search.problem, search.base))
    if is_asked(search.problem):
        one = chance_gains(search.problem, search.base, search.library, rng, floor.false_alarm, OF_ONE)
        for name, fall in least_falls(search.problem, library, threshold, one.threshold()).items():
            least[name] = max(fall, least.get(name, 0.0))
    detectable = smallest_detectable(library, needed, least)
    unseen = untestable(
        considered,
        library,
        detectable,
        dataset.level,
        dataset.columns,
        command_falls=dataset.command_falls,
    )
    asked = Design(None, "")
    if options.next_experiment:
        asked = design_next_experiment(
            search.problem, dataset.runs, found.decision, improved, unseen, threshold
        )
    return detectable, unseen, asked


def _there_notes(found: Inquiry) -> tuple[str, ...]:
    """Return what is said of effects that the logs of the fit show and the model lacks."""
    if not found.there:
        return ()
    names = " + ".join(found.there)
    return (
        f"{names}: the logs of the fit show this, too, and the model lacks it; the study goes on beside it. "
        "Fit the model again with effects (python -m sysid.fit --effects auto)",
    )
