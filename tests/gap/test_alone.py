"""What a study of one recording is given by the fit of law and effects."""

from __future__ import annotations

import pytest

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.scale import REFERENCE
from mecanum_env.model import Model, paper_model
from sysid.gap import alone
from sysid.gap.inquiry import inquire
from sysid.gap.result import GapOptions
from sysid.gap.search.given_set import beyond, set_at
from sysid.logs import Dataset
from sysid.progress import silent

from .conftest import MakeLogs


def test_the_law_is_studied_and_the_whole_model_tells_when_commands_acted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    whole = paper_model().with_effect("command_latency", "jitter", delay_s=0.1, jitter_s=0.02)
    whole = whole.with_effect("coulomb_friction", torque_n_m=0.4).with_effect("speed_gain", gain=0.9)
    monkeypatch.setattr(alone, "_selected", lambda dataset: dataset)
    monkeypatch.setattr(alone, "fit_dataset", lambda *_: None)
    monkeypatch.setattr(alone, "fitted_model", lambda _: whole)
    law, options = alone.law_of(Dataset("made", (), ()), GapOptions())
    assert list(law.effects) == ["command_latency/jitter"]
    assert options.fitted_here is whole
    assert any("coulomb_friction + speed_gain" in note for note in options.notes)


def test_a_study_tries_the_whole_set_that_the_fit_found_and_what_is_left_of_it(
    bench_logs: MakeLogs, base: Model
) -> None:
    true = base.with_effect("speed_gain", gain=0.95).with_effect("acceleration_limit", limit_rpm_s=900.0)
    true = true.with_effect("command_deadband", "subtract", threshold_rpm=3.0)
    options = GapOptions(next_experiment=False, fitted_here=true, max_effects=1)
    considered = ("speed_gain", "command_deadband/subtract", "acceleration_limit", "coulomb_friction")
    found = inquire(bench_logs(true), base, options, considered, 0.01, silent)
    names = tuple(name for name in CATALOGUE if name in true.effects)
    assert found.search.fitted[names].cost < 1.2 * found.search.problem.size
    assert found.search.of_size(2)
    assert found.decision.chosen is not None
    assert found.decision.chosen.names == names


def test_a_set_that_is_given_keeps_the_values_that_a_search_does_not_fit(base: Model) -> None:
    whole = base.with_effect("coulomb_friction", torque_n_m=0.3, answer_s=0.02)
    whole = whole.with_effect("speed_gain", gain=0.9)
    given = beyond(base, whole, ("coulomb_friction", "speed_gain", "payload"))
    candidate, place = set_at(base, given, REFERENCE)
    effects = candidate.model(base, place).effects
    assert effects["coulomb_friction"]["torque_n_m"] == pytest.approx(0.3)
    assert effects["coulomb_friction"]["answer_s"] == pytest.approx(0.02)
    assert effects["speed_gain"]["gain"] == pytest.approx(0.9)
    assert not beyond(whole, whole, given)
