"""The search of effects beside a law: what a start brings and the logs do not show is left out."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from mecanum_env.law.stability import POLE_LIMIT
from mecanum_env.model import Model, paper_model
from sysid.compare.measured import observe
from sysid.compare.model_error import Whitener
from sysid.compare.noise import measure_noise
from sysid.compare.predicted import START_PRICE
from sysid.fit.effects import EffectSearch, HeldOut, Reached, searched
from sysid.fit.effects.candidates import drive_candidates
from sysid.fit.effects.drive import in_place_of
from sysid.fit.effects.reached import confirmed

from .test_drive_effects import logs


@pytest.mark.parametrize("tried", [None, 1])
def test_effects_of_the_start_that_the_logs_do_not_show_are_not_in_the_model(tried: int | None) -> None:
    true = paper_model().with_effect("speed_gain", gain=0.9)
    data = logs(true)
    start = true.with_effect("coulomb_friction", torque_n_m=0.01).with_effect(
        "command_latency", delay_s=0.001
    )
    observations = observe(replace(data, runs=data.split("fit")))
    whitener = Whitener(observations, measure_noise(data, observations), None)
    known = drive_candidates(data.columns)
    search = EffectSearch(start, whitener, HeldOut.of(data), POLE_LIMIT, known)
    began = search.begin()
    assert began is not None
    assert set(began.model.effects) == {"speed_gain", "coulomb_friction", "command_latency"}
    assert set(search.pruned(began, tried).model.effects) == {"speed_gain"}


def test_friction_for_a_dead_zone_brings_no_effect_back_that_was_pruned() -> None:
    true = paper_model().with_effect("coulomb_friction", torque_n_m=0.4)
    true = replace(true, robot=replace(true.robot, servo_n_m_s_rad=0.5))
    data = logs(true)
    start = replace(true, effects={}).with_effect("command_deadband/subtract", threshold_rpm=7.6)
    start = start.with_effect("command_latency", delay_s=0.001)
    observations = observe(replace(data, runs=data.split("fit")))
    whitener = Whitener(observations, measure_noise(data, observations), None)
    search = EffectSearch(start, whitener, HeldOut.of(data), POLE_LIMIT, drive_candidates(data.columns))
    began = search.begin()
    assert began is not None
    smaller = search.pruned(began)
    assert set(smaller.model.effects) == {"command_deadband/subtract"}
    assert set(search.rubbing(smaller).model.effects) == {"coulomb_friction"}


class _Indifferent(HeldOut):
    """Validation runs on which every model is as good as any other."""

    def errors(self, _model: Model) -> tuple[float, float]:
        return 1.0, 1.0


@pytest.mark.parametrize(
    ("validation", "kept"), [(HeldOut, "command_deadband/subtract"), (_Indifferent, "coulomb_friction")]
)
def test_a_dead_zone_is_no_friction_where_the_validation_runs_say_so_too(
    validation: type[HeldOut], kept: str
) -> None:
    true = paper_model().with_effect("command_deadband/subtract", threshold_rpm=8.0)
    data = logs(true)
    observations = observe(replace(data, runs=data.split("fit")))
    whitener = Whitener(observations, measure_noise(data, observations), None)
    search = EffectSearch(true, whitener, validation.of(data), POLE_LIMIT, drive_candidates(data.columns))
    began = search.begin()
    assert began is not None
    assert set(search.rubbing(began).model.effects) == {kept}


def test_a_set_grows_only_to_what_fits_better() -> None:
    """Beside a free law the step that a straight line promises may lead far astray."""
    data = logs(paper_model().with_effect("sensor_lowpass", time_constant_s=0.1))
    observations = observe(replace(data, runs=data.split("fit")))
    whitener = Whitener(observations, measure_noise(data, observations), None)
    search = EffectSearch(
        paper_model(), whitener, HeldOut.of(data), POLE_LIMIT, drive_candidates(data.columns)
    )
    began = search.begin()
    assert began is not None
    grown = search.grown(began)
    assert grown
    assert all(one.fitted.cost < began.fitted.cost for one in grown)


def test_the_validation_runs_confirm_a_set_before_its_price_decides() -> None:
    def reached(held_out: float) -> Reached:
        return Reached(paper_model(), cast(Any, None), 6, held_out, held_out)

    first, second = reached(1.2), reached(1.1)
    assert confirmed([first, second], 1000) is second
    assert confirmed([reached(1.101), second], 1000).held_out == 1.101
    assert confirmed([first, second], 40) is first
    assert confirmed([], 1000) is None


def test_validation_runs_charge_for_each_place_in_a_gap_that_is_looked_for_in_them() -> None:
    """Else a gap may be confirmed by the noise in which its places are looked for."""
    data, model = logs(paper_model()), paper_model()
    held_out = HeldOut.of(data)
    squares = [
        held_out.errors(one)[0] ** 2 * held_out.whitener.size
        for one in (model, model.with_effect("backlash", gap_deg=1e-6))
    ]
    runs = len(held_out.whitener.observations.situations)
    assert squares[1] - squares[0] == pytest.approx(runs * START_PRICE, rel=1e-3)


@pytest.mark.parametrize(("is_enough", "taken"), [(True, None), (False, "smaller")])
def test_a_law_that_is_not_enough_gives_way_to_any_set_that_held_out_runs_confirm(
    is_enough: bool, taken: str | None
) -> None:
    """As for a drive below its command, whose law alone would need a pole that never settles."""
    law = SimpleNamespace(inflation=1.9, held_out=2.1)
    best = SimpleNamespace(name="best price", held_out=2.7, better_than=lambda _: False)
    smaller = SimpleNamespace(name="smaller", held_out=1.6, better_than=lambda _: True)
    reached: list[Any] = [best, smaller, law]
    chosen: Any = in_place_of(cast(Any, law), reached, 1000, is_enough=is_enough)
    assert (chosen and chosen.name) == taken


def test_a_form_takes_the_place_of_another_one_of_the_same_effect() -> None:
    """A simple drive has ramps with corners; those of the motor are round."""
    true = paper_model().with_effect("acceleration_limit", "s_curve", limit_rpm_s=300.0, jerk_rpm_s2=2000.0)
    data = logs(true)
    observations = observe(replace(data, runs=data.split("fit")))
    whitener = Whitener(observations, measure_noise(data, observations), None)
    start = paper_model().with_effect("acceleration_limit", limit_rpm_s=250.0)
    search = EffectSearch(start, whitener, HeldOut.of(data), POLE_LIMIT, drive_candidates(data.columns))
    began = search.begin()
    assert began is not None
    form = "acceleration_limit/s_curve"
    (round_,) = [one for one in search.grown(began) if set(one.model.effects) == {form}]
    assert round_.fitted.cost < 0.2 * began.fitted.cost
    assert round_.model.effects[form]["jerk_rpm_s2"] == pytest.approx(2000.0, rel=0.2)
    # It goes on from there, although it began without the form that it has.
    assert search.beside(round_).grown(round_)


class FakeReached:
    """A set whose price falls with its number; the error on the validation runs changes by a step with it."""

    inflation = 1.0

    def __init__(self, base: object, number: int, step: float) -> None:
        self.base, self.number, self.held_out = base, number, 2.0 + step * number
        effects = SimpleNamespace(names=(f"{number}",))
        self.fitted = SimpleNamespace(candidate=SimpleNamespace(effects=effects))

    def price(self, _inflation: float) -> float:
        return -float(self.number)


@pytest.mark.parametrize(("step", "rounds"), [(-0.1, 6), (0.1, 2)])
def test_a_search_ends_that_only_fits_the_fit_runs_better(step: float, rounds: int) -> None:
    base, grown = object(), []

    def grow(one: Any) -> list[Any]:
        grown.append(one.number)
        return [FakeReached(base, one.number + 1, step)]

    search: Any = SimpleNamespace(base=base, grown=grow, pruned=lambda one, _: one, rubbing=lambda one: one)
    began: Any = FakeReached(base, 0, step)
    found: list[Any] = list(searched([search], [began], lambda _: None))
    assert grown == list(range(rounds))
    assert found[0].number == rounds


def test_any_set_that_a_search_returns_has_friction_for_a_dead_zone() -> None:
    """Validation runs may prefer a smaller set than the one with the best price."""
    base = object()
    rubbing = [FakeReached(base, 10 + number, -0.1) for number in range(3)]

    def grow(one: Any) -> list[Any]:
        return [FakeReached(base, one.number + 1, -0.1)] if one.number < 2 else []

    search: Any = SimpleNamespace(
        base=base, grown=grow, pruned=lambda one, _: one, rubbing=lambda one: rubbing[one.number]
    )
    began: Any = FakeReached(base, 0, -0.1)
    found: list[Any] = list(searched([search], [began], lambda _: None))
    assert [one.number for one in found] == [12, 2, 11, 1, 10, 0]


def test_a_delay_pays_for_its_parameters_and_an_effect_for_more() -> None:
    """Every link has a delay: without it a backlash imitates it at the speeds of the logs alone."""

    def price(*names: str) -> float:
        candidate = SimpleNamespace(effects=SimpleNamespace(names=names))
        fitted = SimpleNamespace(candidate=candidate, cost=100.0, residual=np.zeros(100))
        return Reached(paper_model(), cast(Any, fitted), 6, 1.0, 1.0).price(1.0)

    assert price("command_latency/jitter") == price()
    assert price("backlash") > price()
