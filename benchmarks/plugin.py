"""What the wheel plugin costs: microseconds per step of four wheels, compared with native velocity servos.

Four free wheels are stepped in blocks, with the plugin and with native servos by turns. The cost is the
difference of the median times per step. Target: at most 3 us per step of four wheels.

    python benchmarks/plugin.py --out out/bench/plugin.json
"""

from __future__ import annotations

import platform
import statistics
import sys
import time
from pathlib import Path

import mujoco
from tqdm import tqdm

from mecanum_env.cli import run
from mecanum_env.files import write_json
from mecanum_env.kinematics import WHEELS
from mecanum_env.mjcf import robot_spec
from mecanum_env.model import Model, paper_model
from mecanum_env.plugin.layout import set_wheel_parameters

TARGET_US = 3.0


def free_wheels(model: Model, native: bool) -> mujoco.MjModel:
    """Return four free wheels, driven by the plugin or by native velocity servos of the same stiffness."""
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.integrator = 1 / 480, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for name in WHEELS:
        body = spec.worldbody.add_body(name=name)
        body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 1.0, 0.0])
        body.add_geom(size=[model.robot.wheel_radius_m, 0.0, 0.0], mass=1.0, contype=0, conaffinity=0)
        actuator = spec.add_actuator(name=name, target=name)
        actuator.trntype = mujoco.mjtTrn.mjTRN_JOINT
        if native:
            actuator.set_to_velocity(kv=model.robot.servo_n_m_s_rad)
        else:
            set_wheel_parameters(spec, actuator, model)
    return spec.compile()


def median_us(models: dict[str, mujoco.MjModel], blocks: int, steps: int) -> dict[str, float]:
    """Return the median time per step [us] of each model, measured by turns on the same machine."""
    times: dict[str, list[float]] = {name: [] for name in models}
    datas = {name: mujoco.MjData(mjmodel) for name, mjmodel in models.items()}
    for name, data in datas.items():
        data.ctrl[:] = 60.0 if name == "plugin" else 6.0
        mujoco.mj_step(models[name], data, steps)
    for _ in tqdm(range(blocks), desc="blocks", disable=None):
        for name, mjmodel in models.items():
            start = time.perf_counter()
            mujoco.mj_step(mjmodel, datas[name], steps)
            times[name].append((time.perf_counter() - start) / steps * 1e6)
    return {name: statistics.median(values) for name, values in times.items()}


def main(out: Path | None = None, blocks: int = 200, steps: int = 1000) -> None:
    """Measure and print the cost; write it to a file.

    Example: python benchmarks/plugin.py --out out/bench/plugin.json

    Args:
        out: JSON file to write.
        blocks: number of blocks, over which the median is taken.
        steps: physics steps per block.
    """
    model = paper_model()
    free = median_us({"plugin": free_wheels(model, False), "native": free_wheels(model, True)}, blocks, steps)
    cost = free["plugin"] - free["native"]
    robot = median_us({"plugin": robot_spec(model).compile()}, max(blocks // 20, 3), max(steps // 10, 10))
    metrics = {
        "plugin_us_per_step": free["plugin"],
        "native_us_per_step": free["native"],
        "cost_us_per_step_of_four_wheels": cost,
        "ratio_to_native": free["plugin"] / free["native"],
        "target_us": TARGET_US,
        "robot_us_per_step": robot["plugin"],
        "share_of_a_robot_step": cost / robot["plugin"],
        "machine": platform.machine(),
    }
    print(f"four free wheels, plugin  {free['plugin']:8.3f} us/step")
    print(f"four free wheels, native  {free['native']:8.3f} us/step")
    print(f"cost of the plugin        {cost:8.3f} us/step (target: at most {TARGET_US:g})")
    print(f"ratio to native           {metrics['ratio_to_native']:8.3f}")
    print(f"the robot, plugin         {robot['plugin']:8.3f} us/step")
    print(f"the plugin's share of it  {metrics['share_of_a_robot_step']:8.1%}")
    if out is not None:
        write_json(out, metrics)
        print(f"written: {out}")


if __name__ == "__main__":
    sys.exit(run(main))
