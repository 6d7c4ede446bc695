"""An exported policy does what the policy does, in ONNX Runtime and in C."""

import json
import shutil
import subprocess

import numpy as np
import pytest

from mecanum_env.model import paper_model
from mecanum_env.tankendo import read_observation
from mecanum_env.tankendo.observation import SIZE
from training.controllers.policy import bundled, load_policy
from training.export.contract import FORMAT, LIMITS_OF, NUMBERS, robot_figures

CLOSE = 1e-6
MAIN = """
#include <stdio.h>
#include "policy.h"
int main(void) {
  static mecanum_policy policy;
  MECANUM_REAL seen[MECANUM_POLICY_OBSERVATION], action[3];
  int command[3];
  mecanum_robot robot;
  scanf("%lf %lf %lf %lf %lf", &robot.command_period_s, &robot.command_quantum_rpm, &robot.top_speed_m_s,
        &robot.lever_m, &robot.rise_time_s);
  printf("%d\\n", mecanum_policy_fits(&robot));
  mecanum_policy_reset(&policy);
  for (;;) {
    for (int i = 0; i < MECANUM_POLICY_OBSERVATION; ++i) {
      double number;
      if (scanf("%lf", &number) != 1) return 0;
      seen[i] = (MECANUM_REAL)number;
    }
    mecanum_policy_act(&policy, seen, action, command);
    printf("%.17g %.17g %.17g %d %d %d\\n", (double)action[0], (double)action[1], (double)action[2],
           command[0], command[1], command[2]);
  }
}
"""


def windows(observations, stack):
    """Return the last observations at each step, oldest first, shape (n, stack, k)."""
    before = np.repeat(observations[:1], stack - 1, axis=0)
    whole = np.concatenate([before, observations])
    return np.stack([whole[i : i + len(observations)] for i in range(stack)], axis=1)


@pytest.fixture
def in_onnx(exported):
    """Return the actions and commands of `policy.onnx` in ONNX Runtime."""
    runtime = pytest.importorskip("onnxruntime", reason="ONNX Runtime is not installed: extra onnx")
    pytest.importorskip("onnx", reason="onnx is not installed: extra onnx")
    options = runtime.SessionOptions()
    options.intra_op_num_threads = 1
    session = runtime.InferenceSession(
        exported.folder / "policy.onnx", options, providers=["CPUExecutionProvider"]
    )
    return session.run(
        ["action", "command"], {"observations": windows(exported.observations, exported.stack)}
    )


@pytest.fixture(scope="module")
def program(exported):
    """Return the header, compiled with a small program that reads observations and prints the results."""
    return compiled(exported.folder)


def compiled(folder, *options):
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler (cc)")
    (folder / "main.c").write_text(MAIN, encoding="utf-8")
    strict = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wno-unused-result")
    name = "main" + "".join(options)
    subprocess.run([compiler, *strict, *options, "main.c", "-o", name, "-lm"], cwd=folder, check=True)
    return folder / name


def run_c(program, figures, observations):
    """Return whether the robot fits, and the rows of the program's results."""
    lines = [" ".join(map(repr, map(float, row))) for row in (list(figures.values()), *observations)]
    done = subprocess.run([program], input="\n".join(lines), capture_output=True, text=True, check=True)
    fits, *rows = done.stdout.splitlines()
    return fits == "1", np.array([row.split() for row in rows], float)


def test_onnx_runtime_returns_the_policys_actions(exported, in_onnx):
    assert np.abs(in_onnx[0] - exported.actions).max() <= CLOSE


def test_onnx_runtime_returns_the_policys_commands(exported, in_onnx):
    np.testing.assert_array_equal(in_onnx[1], exported.commands)


def test_c_returns_the_policys_actions_and_commands(exported, program):
    fits, rows = run_c(program, robot_figures(paper_model()), exported.observations)
    assert fits
    assert np.abs(rows[:, :3] - exported.actions).max() <= CLOSE
    np.testing.assert_array_equal(rows[:, 3:], exported.commands)


def test_c_in_single_precision_stays_close(exported):
    single = compiled(exported.folder, "-DMECANUM_REAL=float")
    _, rows = run_c(single, robot_figures(paper_model()), exported.observations)
    assert np.abs(rows[:, :3] - exported.actions).max() <= 1e-4


def test_c_refuses_a_robot_that_the_policy_was_not_trained_for(program):
    figures = robot_figures(paper_model())
    assert not any(run_c(program, figures | {name: 1.5 * figures[name]}, [])[0] for name in LIMITS_OF)


def test_the_contract_names_every_number_with_unit_and_limits(exported):
    contract = json.loads((exported.folder / "policy.json").read_text(encoding="utf-8"))
    seen = contract["observation"]
    assert contract["format"] == FORMAT
    assert seen["size"] == exported.observations.shape[1] == len(seen["numbers"])
    assert seen["stack"] == exported.stack
    assert all(number["unit"] and number["low"] < number["high"] for number in seen["numbers"])


def test_the_names_of_the_contract_are_those_of_the_observation():
    named = read_observation(np.arange(float(SIZE)))
    for index, (name, _, _) in enumerate(NUMBERS[:SIZE]):
        assert getattr(named, name) == index


def test_the_onnx_file_carries_the_contract(exported):
    onnx = pytest.importorskip("onnx", reason="onnx is not installed: extra onnx")
    model = onnx.load(exported.folder / "policy.onnx")
    contract = json.loads({one.key: one.value for one in model.metadata_props}["contract"])
    assert contract == json.loads((exported.folder / "policy.json").read_text(encoding="utf-8"))


def test_two_policies_have_two_digests():
    from training.export.contract import weights_digest

    first, second = (weights_digest(load_policy(bundled(name))) for name in ("nominal", "robust"))
    assert first != second
