"""The paper's robot drives: straight at 10, 40, 80 and 130 rpm, and turning in place at 1.484 rad/s.

Each starts from rest, holds for three seconds and stops. The paper (section 4.5) prints what its robot lost
against its model; the simulated robot loses what rollers, grip and motors without friction lose, so the
difference is what the paper's robot has and a free wheel's law does not: friction, load, battery, sensors.

Example: python benchmarks/paper_drives.py --out out/paper_drives.json
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from mecanum_env.cli import run
from mecanum_env.files import write_json
from mecanum_env.kinematics import command_to_twist, round_command, twist_to_command
from mecanum_env.law.metrics import step_metrics
from mecanum_env.model import Model, paper_model, read_model
from mecanum_env.simulator.commands import BodyCommands
from mecanum_env.simulator.robot import Plant, drive
from mecanum_env.units import RAD_S_PER_RPM

PAPER_LOSS = {10.0: 0.186, 40.0: 0.0689, 80.0: 0.156, 130.0: 0.310}
"""V [rpm] -> (model - measured) / model at steady speed, as printed in section 4.5."""
PAPER_TURN_RAD_S, PAPER_TURN_LOSS = 1.484, 0.0306
PAPER_RISE_S = {"model": 0.12, "robot": 0.19}
HOLD_S = 3.0


@dataclass(frozen=True)
class DriveResult:
    """One drive: `commanded` and `steady` in `unit`, the times in seconds."""

    name: str
    unit: str
    commanded: float
    steady: float
    loss: float
    """(commanded - steady) / commanded."""
    paper_loss: float
    rise_s: float
    """10 to 90 % of the body's speed."""
    wheel_rise_s: float
    """10 to 90 % of the front left wheel's speed."""
    fall_s: float
    """90 to 10 % after the stop."""
    peak_acceleration: float
    """Of the body while starting, over the 0.1 s in which it gains most [unit/s]."""


def measure(
    model: Model, plant: Plant, v_rpm: float, vc_rpm: float, name: str, paper_loss: float
) -> DriveResult:
    """Drive once and read off the figures; straight drives in wheel rpm, turns in rad/s."""
    v, _, vc = (float(x) for x in round_command(v_rpm, 0.0, vc_rpm, model.wheel.command_quantum_rpm))
    commands = BodyCommands.from_rows([(0.0, v, 0.0, vc), (HOLD_S, 0.0, 0.0, 0.0)])
    path = drive(model, commands, HOLD_S + 1.5, plant=plant)
    turning = v == 0.0
    twist = command_to_twist(v, 0.0, vc, model.robot)
    scale = 1.0 if turning else 1.0 / (model.robot.wheel_radius_m * RAD_S_PER_RPM)
    commanded = float(twist[2 if turning else 0]) * scale
    speed = path.twist[:, 2 if turning else 0] * scale
    wheel = path.wheels_rpm[:, 0]
    going, stopping = path.time_s <= HOLD_S, path.time_s >= HOLD_S
    time_s = path.time_s
    up = step_metrics(time_s[going], speed[going], 0.0, commanded, noise_rpm=0.0)
    wheel_up = step_metrics(time_s[going], wheel[going], 0.0, float(wheel[going][-1]), noise_rpm=0.0)
    down = step_metrics(
        time_s[stopping], speed[stopping], up.steady_rpm, 0.0, step_time_s=HOLD_S, noise_rpm=0.0
    )
    tenth = round(0.1 / path.mj_model.opt.timestep)
    return DriveResult(
        name=name,
        unit="rad/s" if turning else "rpm",
        commanded=commanded,
        steady=up.steady_rpm,
        loss=-up.relative_steady_state_error,
        paper_loss=paper_loss,
        rise_s=up.rise_time_s,
        wheel_rise_s=wheel_up.rise_time_s,
        fall_s=down.rise_time_s,
        peak_acceleration=float((speed[tenth:] - speed[:-tenth]).max() / 0.1),
    )


def paper_drives(model: Model, plant: Plant = "rollers") -> list[DriveResult]:
    """Return the five drives of the paper's section 4.5."""
    drives = [measure(model, plant, v, 0.0, f"straight {v:g} rpm", loss) for v, loss in PAPER_LOSS.items()]
    _, _, vc_rpm = twist_to_command([0.0, 0.0, PAPER_TURN_RAD_S], model.robot)
    name = f"turn {PAPER_TURN_RAD_S} rad/s"
    return [*drives, measure(model, plant, 0.0, float(vc_rpm), name, PAPER_TURN_LOSS)]


def main(model: Path | None = None, plant: Plant = "rollers", out: Path | None = None) -> None:
    """Run the paper's drives and print them beside the figures in its text.

    Args:
        model: the model file; by default the packaged one.
        plant: "rollers" or "planar".
        out: also write the figures here, as JSON.
    """
    results = paper_drives(paper_model() if model is None else read_model(model), plant)
    print(
        f"{'drive':18} {'commanded':>14} {'steady':>8} {'loss':>8} {'paper: loss':>11} "
        f"{'rise s':>7} {'wheel s':>7} {'fall s':>7}"
    )
    for r in results:
        print(
            f"{r.name:18} {r.commanded:8.4g} {r.unit:>5} {r.steady:8.4g} {r.loss:8.4f} {r.paper_loss:11.4f} "
            f"{r.rise_s:7.3f} {r.wheel_rise_s:7.3f} {r.fall_s:7.3f}"
        )
    rise_model_s, rise_robot_s = PAPER_RISE_S["model"], PAPER_RISE_S["robot"]
    print(f"paper: rise {rise_model_s} s of its model without load, {rise_robot_s} s of its robot")
    if out is not None:
        write_json(
            out, {"plant": plant, "drives": [asdict(r) for r in results], "paper_rise_s": PAPER_RISE_S}
        )


if __name__ == "__main__":
    raise SystemExit(run(main, prog="python benchmarks/paper_drives.py"))
