"""The search of effects beside a law: what a start brings and the logs do not show is left out."""

from dataclasses import replace

import pytest

from mecanum_env.law.stability import POLE_LIMIT
from mecanum_env.model import paper_model
from sysid.compare.noise import measure_noise
from sysid.compare.observations import observe
from sysid.compare.whitening import Whitener
from sysid.fit.drive_candidates import drive_candidates
from sysid.fit.drive_reached import HeldOut
from sysid.fit.effect_search import EffectSearch

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
