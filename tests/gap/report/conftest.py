"""Reports of every verdict, made with first-order wheels, for the tests of pages and files."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from mecanum_env.kinematics import command_to_wheels, wheels_to_twist
from mecanum_env.model import CustomEffect, Robot, paper_model
from mecanum_env.statistics import rms
from sysid.gap.report.samples import HeldCommand, Samples
from sysid.gap.report.where import regions
from sysid.gap.result import (
    CustomProposal,
    Difference,
    Evidence,
    Experiment,
    FoundEffect,
    GapReport,
    Interval,
    Overlay,
    Untestable,
)
from sysid.logs import Finding
from sysid.logs.runs import UNITS

STEP_S = 0.01
TIME = np.arange(0.0, 5.0, STEP_S)
CHANGES = np.array([0.3, 1.2, 2.1, 3.0, 4.2])
OTHERS = ("command_latency", "sensor_latency", "coulomb_friction", "acceleration_limit", "weak_servo",
          "sensor_lowpass", "command_deadband", "speed_gain", "direction_asymmetry")  # fmt: skip
PROVENANCE = {"seed": 0, "data_sha256": "2f1c" * 16, "model_sha256": "9ab0" * 16, "version": "0.1.0"}


def first_order(command: np.ndarray, tau_s: float = 0.07, delay_s: float = 0.0) -> np.ndarray:
    """Return the response (n,) or (n, m) of a first-order wheel to a command that changes on `TIME`."""
    ratio = np.exp(-STEP_S / tau_s)
    late = round(delay_s / STEP_S) + 1
    held = np.concatenate([np.zeros((late, *command.shape[1:])), command])[: len(command)]
    return lfilter([1.0 - ratio], [1.0, -ratio], held, axis=0)


def evidence(names: tuple[str, ...], score: float, rms_rpm: float, good: bool, **values: float) -> Evidence:
    parameters = {names[0]: values} if names else {}
    return Evidence(names, parameters, len(values), score, 1.02 if good else 9.0, good, rms_rpm, rms_rpm,
                    score + 6.0)  # fmt: skip


def untestable() -> tuple[Untestable, ...]:
    return (
        Untestable("battery_sag", "The runs are too short for the gain to fall.", {"drop_per_s": 0.011}),
        Untestable("speed_saturation", "No command comes near the limit.", {}),
    )


def bench_report(missing: np.ndarray, after: np.ndarray, noise_rpm: float = 0.7) -> GapReport:
    """Return a report of two bench runs with the errors `missing` before and `after`, each (2, n)."""
    rng = np.random.default_rng(0)
    parts, overlays = [], []
    for i, levels in enumerate(([60.0, -60.0, 110.0, 20.0, 0.0], [-40.0, 90.0, -120.0, 50.0, 0.0])):
        held = HeldCommand(CHANGES, np.array(levels)[:, None])
        command = held.at(TIME)[:, 0]
        model = first_order(command)
        measured = model + missing[i] + noise_rpm * rng.standard_normal(TIME.size)
        better = model + missing[i] - after[i]
        name = f"run_{i + 4}.csv"
        parts.append(Samples("speed_rpm", TIME, measured, model, better, held, run=name, repeat=i))
        overlays.append(Overlay(name, "test", "speed_rpm", "rpm", TIME, measured, model, better, command))
    errors = [np.concatenate(e) for e in zip(*(part.errors() for part in parts), strict=True)]
    gap = Difference("rpm", rms(errors[0]), rms(errors[1]), noise_rpm)
    return GapReport(
        verdict="named", effects=(), candidates=(), gap=gap, channels={"speed_rpm": gap},
        where=regions(parts), untestable=untestable(),
        smallest_detectable={"backlash": {"gap_deg": 0.21}, "coulomb_friction": {"torque_n_m": 0.012}},
        next_experiment=None, evidence=(), p_value=1e-9, model=paper_model(), base=paper_model(),
        level="bench", dataset="bench, free wheel",
        findings=(Finding("run_4.csv", "missing", 0.08, "speed_rpm"),),
        notes=("The noise is known from 3 repeats of 4 command sequences.",),
        overlays=tuple(overlays), custom=None, provenance=PROVENANCE,
    )  # fmt: skip


def dead_times() -> np.ndarray:
    """Return an error after reversals only, as backlash causes it, for two runs, (2, n)."""
    bumps = [-18.0 * np.exp(-(((TIME - change - 0.06) / 0.05) ** 2)) for change in CHANGES[1:4]]
    return np.array([[-1.0, 1.0, 0.0], [1.0, -1.0, 1.0]]) @ np.array(bumps)


@pytest.fixture(scope="session")
def named() -> GapReport:
    report = bench_report(dead_times(), np.zeros((2, TIME.size)))
    found = FoundEffect("backlash", {"gap_deg": Interval(2.1, 1.9, 2.3)}, 0.97)
    return replace(
        report,
        effects=(found,),
        candidates=(("backlash",),),
        evidence=(
            evidence(("backlash",), -812.0, 0.71, True, gap_deg=2.1),
            evidence(("backlash", "command_latency"), -809.5, 0.71, True, gap_deg=2.1),
            evidence(("stiction",), -301.0, 2.9, False, breakaway_n_m=0.31, stribeck_rpm=6.0),
            *(evidence((name,), -40.0, 3.6, False) for name in OTHERS),
            evidence((), 0.0, 3.7, False),
        ),
        model=paper_model().with_effect("backlash", gap_deg=2.1),
    )  # fmt: skip


@pytest.fixture(scope="session")
def no_gap() -> GapReport:
    report = bench_report(np.zeros((2, TIME.size)), np.zeros((2, TIME.size)))
    return replace(report, verdict="no_gap", p_value=0.34, evidence=(evidence((), 0.0, 0.7, True),))


@pytest.fixture(scope="session")
def unexplained() -> GapReport:
    ripple = np.stack([4.0 * np.sin(2.0 * np.pi * TIME), 4.0 * np.cos(2.0 * np.pi * TIME)])
    report = bench_report(ripple, ripple)
    effect = CustomEffect("load", "3.9 * sin(2 * angle + 0.2)", source="gap", range={"time_s": (0.0, 2.0)})
    term = CustomProposal(effect, 0.93, ("sensor",), 0.8, False)
    return replace(report, verdict="unexplained", custom=term, evidence=(
        evidence(("wheel_law",), -20.0, 2.8, False), evidence((), 0.0, 2.9, False),
    ))  # fmt: skip


@pytest.fixture(scope="session")
def ambiguous() -> GapReport:
    return robot_report()


def robot_report() -> GapReport:
    """Return a report of a robot that is slow sideways, with a next experiment."""
    rng = np.random.default_rng(1)
    noise = {"vx_m_s": 0.01, "vy_m_s": 0.01, "yaw_rate_rad_s": 0.03}
    parts, overlays = [], []
    for i, theta in enumerate(([0, 90, 45, 180, 0], [90, -90, 135, 0, 0])):
        v, vc = np.array([60.0, 80.0, 100.0, 60.0, 0.0]), np.array([0.0, 0.0, 0.0, 30.0, 0.0])
        wheels = HeldCommand(CHANGES, command_to_wheels(v, theta, vc))
        twist = wheels_to_twist(first_order(wheels.at(TIME)), Robot())
        true = twist * np.array([1.0, 0.85, 1.0])
        yaw = np.cumsum(twist[:, 2]) * STEP_S
        for j, (name, sigma) in enumerate(noise.items()):
            measured = true[:, j] + sigma * rng.standard_normal(TIME.size)
            curves = (TIME, measured, twist[:, j], true[:, j])
            parts.append(Samples(name, *curves, wheels, run=f"drive_{i}.csv", yaw_rad=yaw))
            overlays.append(Overlay(f"drive_{i}.csv", "test", name, UNITS[name], *curves, None))
    channels = {}
    for j, (name, sigma) in enumerate(noise.items()):
        before, after = np.concatenate([part.errors() for part in parts[j::3]], axis=1)
        channels[name] = Difference(UNITS[name], rms(before), rms(after), sigma)
    torque, damping = Interval(0.021, 0.017, 0.024), Interval(0.0004, 0.0, 0.0009)
    found = FoundEffect("roller_friction", {"torque_n_m": torque, "damping_n_m_s_rad": damping}, 0.58)
    values = {name: p.value for name, p in found.parameters.items()}
    return replace(
        bench_report(dead_times(), dead_times()),
        verdict="ambiguous",
        effects=(found,),
        candidates=(("roller_friction",), ("sensor_scale", "mount_yaw")),
        gap=Difference("sigma", 2.41, 1.01, 1.0),
        channels=channels,
        where=regions(parts),
        level="robot",
        dataset="robot, eight drives",
        overlays=tuple(overlays),
        next_experiment=experiment(),
        evidence=(
            evidence(("roller_friction",), -640.0, 1.01, True, **values),
            evidence(("sensor_scale", "mount_yaw"), -637.0, 1.02, True, linear=0.93),
            evidence(("sensor_scale",), -120.0, 1.9, False, linear=0.93),
            evidence((), 0.0, 2.4, False),
        ),
        model=paper_model().with_effect("roller_friction", **values),
    )


def experiment() -> Experiment:
    times = np.arange(0.0, 3.0, 0.1)
    v = np.repeat([0.0, 20.0, 60.0, 120.0, 60.0, 0.0], 5)
    theta = np.repeat([0.0, 90.0, -90.0, 90.0, 45.0, 0.0], 5)
    clock = np.arange(0.0, 3.0, STEP_S)
    twist = wheels_to_twist(first_order(np.repeat(command_to_wheels(v, theta, 0.0 * v), 10, axis=0)), Robot())
    rows = {"vx_m_s": twist[:, 0], "vy_m_s": twist[:, 1]}
    return Experiment(
        why="roller_friction loses most at low speed, sensor_scale the same part at every speed.",
        candidates=(("roller_friction",), ("sensor_scale", "mount_yaw")),
        time_s=times,
        columns={"command_v_rpm": v, "command_theta_deg": theta, "command_vc_rpm": 0.0 * v},
        duration_s=3.0,
        power=0.93,
        predicted={
            "roller_friction": {n: y - 0.03 * np.tanh(20.0 * y) for n, y in rows.items()},
            "sensor_scale + mount_yaw": {n: 0.92 * y for n, y in rows.items()},
        },
        predicted_time_s=clock,
    )  # fmt: skip


@pytest.fixture(scope="session")
def every_report(
    named: GapReport, no_gap: GapReport, unexplained: GapReport, ambiguous: GapReport
) -> dict[str, GapReport]:
    return {report.verdict: report for report in (named, no_gap, unexplained, ambiguous)}
