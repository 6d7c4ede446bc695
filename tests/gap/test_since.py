"""A study beside the logs of the fit: what these show, too, is no gap, and what is new is named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.law import WheelLaw
from mecanum_env.model import Model, paper_model, read_model, write_model
from sysid.compare.least_squares import ResidualProblem
from sysid.compare.measured import observe
from sysid.compare.model_error import Whitener, learn
from sysid.compare.noise import measure_noise
from sysid.compare.predicted import SimulationSettings, Simulators
from sysid.gap import inquiry
from sysid.gap.alone import law_of, require_fittable
from sysid.gap.inquiry import inquire
from sysid.gap.report.output import gap_json
from sysid.gap.result import GapOptions
from sysid.gap.search.decision import Decision
from sysid.gap.search.known_effects import known_effects
from sysid.gap.search.sets import Search
from sysid.gap.search.study_data import study_data
from sysid.gap.workflow import analyse
from sysid.logs import BodyCommand, Dataset, Run, read_dataset
from sysid.logs.of_fit import logs_of_fit, seen_from, with_logs
from sysid.logs.writer import write_dataset
from sysid.progress import silent
from tests.gap.conftest import MakeLogs

QUIET = GapOptions(next_experiment=False)
_STILL = np.zeros(3)
ROBOT_LOGS = Dataset(
    "robot",
    (Run("r.csv", "r", "fit", np.arange(3.0), BodyCommand(_STILL, _STILL, _STILL), {"vx_m_s": _STILL}),),
    (),
)


@pytest.fixture(scope="module")
def rubbing(base: Model) -> Model:
    """Return a wheel that loses 1.5 rpm to friction, which `base` does not know."""
    return replace(base, robot=replace(base.robot, servo_n_m_s_rad=2.0)).with_effect(
        "coulomb_friction", torque_n_m=0.3
    )


def test_what_the_logs_of_the_fit_show_too_is_not_called_new(
    bench_logs: MakeLogs, base: Model, rubbing: Model
) -> None:
    before, after = bench_logs(rubbing, seed=1), bench_logs(rubbing, seed=2)
    stiff = replace(base, robot=rubbing.robot)
    alone, beside = (analyse(after, stiff, replace(QUIET, fitted_on=logs)) for logs in (None, before))
    assert [(found.name, found.since) for found in alone.effects] == [("coulomb_friction", "unknown")]
    assert beside.verdict == "no_gap"


def test_a_model_that_misses_the_logs_of_its_own_fit_is_said_to_hide_changes(
    bench_logs: MakeLogs, base: Model
) -> None:
    before, after = bench_logs(base, seed=1), bench_logs(base, seed=2)
    for gain, said in ((1.0, False), (0.9, True)):
        model = base.with_effect("speed_gain", gain=gain)
        ratio = learn(model, before).noise_ratio
        notes = study_data(after, model, replace(QUIET, fitted_on=before)).notes
        told = [note for note in notes if "misses the logs of its own fit" in note]
        assert bool(told) is said
        assert (ratio > 4.0) is said
        assert not told or f"by {np.sqrt(ratio):.2g} times the noise" in told[0]
    assert learn(base, before).noise_ratio == pytest.approx(1.0, abs=0.15)


def test_what_is_new_is_named_beside_what_was_there(bench_logs: MakeLogs, rubbing: Model) -> None:
    before = bench_logs(rubbing, seed=1)
    after = bench_logs(rubbing.with_effect("command_latency", delay_s=0.06), seed=2)
    report = analyse(after, rubbing, replace(QUIET, fitted_on=before))
    assert ("command_latency",) in report.candidates
    assert {found["since"] for found in gap_json(report)["effects"]} == {"new"}


def test_a_search_that_is_repeated_knows_what_the_one_before_found_as_good(
    bench_logs: MakeLogs, base: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    known: list[tuple[set[tuple[str, ...]], set[tuple[str, ...]]]] = []
    decide = inquiry.decide

    def recorded(search: Search, *more: Any) -> Decision:
        decision = decide(search, *more)
        known.append((set(search.told_before), {one.names for one in decision.facts.tied}))
        return decision

    monkeypatch.setattr(inquiry, "decide", recorded)
    monkeypatch.setattr(inquiry, "_error_beside_best_fit", lambda data, *_: data.error.scaled(0.5))
    before = bench_logs(base, seed=1)
    after = bench_logs(base.with_effect("speed_gain", gain=0.9), seed=2)
    analyse(after, base, replace(QUIET, fitted_on=before))
    (first, found), (second, _) = known
    assert first == set()
    assert second == found != set()


def test_what_was_there_already_does_not_hide_what_is_new(bench_logs: MakeLogs, base: Model) -> None:
    slow = base.with_effect("acceleration_limit", limit_rpm_s=400.0)
    before = bench_logs(slow, seed=1)
    after = bench_logs(slow.with_effect("command_deadband", threshold_rpm=20.0), seed=2)
    # The model of the fit lacks the limit.
    report = analyse(after, base, replace(QUIET, fitted_on=before))
    since = {found.cause: found.since for found in report.effects}
    assert since == {"command_deadband": "new", "acceleration_limit": "already when fitted"}
    assert any("the logs of the fit show this, too" in note for note in report.notes)
    assert [found.cause for found in report.new_effects] == ["command_deadband"]
    limit = report.model.effects["acceleration_limit"]["limit_rpm_s"]
    assert limit == pytest.approx(400.0, rel=0.05)
    assert analyse(bench_logs(slow, seed=3), base, replace(QUIET, fitted_on=before)).verdict == "no_gap"


def test_a_law_that_was_fitted_badly_does_not_date_an_effect_that_the_logs_of_the_fit_cannot_show(
    bench_logs: MakeLogs, base: Model
) -> None:
    """Whenever the effect came, the law fitted again to the logs of the fit serves the new logs better."""
    before = bench_logs(base, seed=1, falls_v=1e-9)
    after = bench_logs(base.with_effect("battery_sag/voltage", per_volt=0.03), seed=2, falls_v=6.0)
    law = base.wheel.law
    off = WheelLaw.from_coefficients(law.coefficients * np.array([0.97, 1, 1, 1, 1, 1]), law.sample_period_s)
    model = replace(base, wheel=replace(base.wheel, law=off.normalised()))
    report = analyse(after, model, replace(QUIET, fitted_on=before, only=("battery_sag/voltage",)))
    assert [(found.name, found.since) for found in report.effects] == [("battery_sag/voltage", "unknown")]


def test_the_error_of_the_fit_is_taken_off_in_other_logs(
    bench_logs: MakeLogs, base: Model, rubbing: Model
) -> None:
    learned = learn(base, bench_logs(rubbing, seed=1))
    other = bench_logs(rubbing, seed=2)
    observations = observe(other)
    white = Whitener(observations, measure_noise(other, observations), None)
    simulators = Simulators.of(observations, SimulationSettings())
    corrected = ResidualProblem(base, white, simulators=simulators, learned=learned)
    plain = ResidualProblem(base, white, simulators=simulators, learned=learned.before())
    assert corrected.base_residual @ corrected.base_residual < 0.5 * (
        plain.base_residual @ plain.base_residual
    )
    # Chance alone moves the factors by what their prior allows, and the logs narrow them.
    assert np.all(np.sum(learned.root**2, axis=1) <= learned.prior**2 * (1.0 + 1e-9))


def test_the_error_in_other_commands_grows_with_what_is_left_up_to_its_largest(
    bench_logs: MakeLogs, base: Model, rubbing: Model
) -> None:
    learned, other = learn(base, bench_logs(rubbing, seed=1)), bench_logs(rubbing, seed=2)
    observations = observe(other)
    noise, simulators = measure_noise(other, observations), Simulators.of(observations, SimulationSettings())
    rng = np.random.default_rng(3)
    scatter = [noise.sigma[b.channel] * rng.standard_normal(b.value.size) for b in observations.blocks]
    settled = []
    for factor in (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 30.0):
        error = learned.error_of(observations, noise, [factor * part for part in scatter], simulators)
        settled.append(error.channels["speed_rpm"].settled)
    assert settled == sorted(settled)
    assert settled[0] == learned.error.channels["speed_rpm"].settled < settled[-1]
    assert settled[-1] == learned.error_in(observations).channels["speed_rpm"].settled


@pytest.mark.parametrize(("gain", "is_plain"), [(1.0, False), (0.9, True)])
def test_where_a_gap_is_plain_the_error_is_no_larger_than_what_the_effects_leave(
    bench_logs: MakeLogs, base: Model, rubbing: Model, gain: float, is_plain: bool
) -> None:
    model, of_fit = replace(base, robot=rubbing.robot), bench_logs(rubbing, seed=1)
    logs = bench_logs(rubbing.with_effect("speed_gain", gain=gain), seed=2)
    known = known_effects(logs.level, QUIET.plant, logs.columns)
    found = inquire(logs, model, replace(QUIET, fitted_on=of_fit), known, 0.01, silent)
    assert found.decision.facts.is_plain is is_plain
    assert found.data.learned is not None
    assert found.data.error is not None
    most = found.data.learned.error_in(found.data.observations)
    used, largest = (error.channels["speed_rpm"].settled for error in (found.data.error, most))
    assert (used < largest) is is_plain


def test_logs_of_another_level_are_no_logs_of_the_fit(bench_logs: MakeLogs, base: Model) -> None:
    logs = bench_logs(base)
    with pytest.raises(InputError, match="robot logs, and those of the study are bench logs"):
        analyse(logs, base, replace(QUIET, fitted_on=ROBOT_LOGS))


def test_a_model_says_where_the_logs_of_its_fit_are(
    bench_logs: MakeLogs, base: Model, tmp_path: Path
) -> None:
    write_dataset(bench_logs(base), tmp_path / "logs")
    model = with_logs(base, tmp_path / "logs", tmp_path / "fit")
    assert model.provenance["logs"] == "../logs"
    found, why = logs_of_fit(model, tmp_path / "fit", "bench")
    assert found is None
    assert "has changed since the model was fitted" in why


def test_logs_of_a_fit_that_are_gone_are_asked_for(base: Model, tmp_path: Path) -> None:
    write_model(with_logs(base, tmp_path / "gone", tmp_path), tmp_path / "model.json")
    found, why = logs_of_fit(read_model(tmp_path / "model.json"), tmp_path, "bench")
    assert found is None
    assert "--fitted-on" in why
    assert logs_of_fit(base, tmp_path, "bench") == (None, "")


def test_a_model_of_a_wheel_on_the_bench_may_be_compared_with_its_robot(
    bench_logs: MakeLogs, base: Model, tmp_path: Path
) -> None:
    write_dataset(bench_logs(base), tmp_path / "logs")
    known = {**base.provenance, "data_sha256": read_dataset(tmp_path / "logs").sha256}
    model = with_logs(replace(base, provenance=known), tmp_path / "logs", tmp_path)
    found, why = logs_of_fit(model, tmp_path, "robot")
    assert found is None
    assert why == "the logs of the fit are bench logs, and these are robot logs: no comparison"
    assert logs_of_fit(model, tmp_path, "bench")[0] is not None


def test_one_recording_without_a_model_shows_what_is_beyond_the_law(
    bench_logs: MakeLogs, base: Model
) -> None:
    logs = bench_logs(base.with_effect("command_deadband", threshold_rpm=25.0))
    law, options = law_of(logs, QUIET)
    assert dict(law.effects) == {}
    report = analyse(logs, law, options)
    assert any("command_deadband" in causes for causes in report.candidates)


def test_robot_logs_without_a_model_ask_for_one() -> None:
    with pytest.raises(InputError, match=r"floor/logs: robot logs need a model; .*sysid\.fit"):
        require_fittable(ROBOT_LOGS, Path("floor/logs"))


def test_an_adopted_effect_that_is_new_does_not_spoil_what_the_logs_of_the_fit_tell(
    bench_logs: MakeLogs, rubbing: Model, tmp_path: Path
) -> None:
    before = bench_logs(rubbing, seed=1)
    late = rubbing.with_effect("command_latency", delay_s=0.06)
    options = replace(QUIET, fitted_on=before, exclude=("sensor_latency",))
    first = analyse(bench_logs(late, seed=2), rubbing, options)
    write_model(first.model, tmp_path / "model.json")
    model = read_model(tmp_path / "model.json")
    stated = model.uncertainty["adopted"]
    assert stated["names"] == ["command_latency.delay_s"]
    assert stated["new"] == ["command_latency"]
    again = analyse(bench_logs(late.with_effect("speed_gain", gain=0.95), seed=3), model, options)
    assert [(found.name, found.since) for found in again.effects] == [("speed_gain", "new")]
    assert again.model.uncertainty["adopted"]["names"] == ["command_latency.delay_s", "speed_gain.gain"]


def test_a_model_that_a_study_wrote_still_says_where_the_logs_of_the_fit_lie(tmp_path: Path) -> None:
    model = with_logs(paper_model(), tmp_path / "logs", tmp_path / "fit")
    moved = seen_from(model, tmp_path / "fit", tmp_path / "fit" / "gap")
    assert moved.provenance["logs"] == "../../logs"
