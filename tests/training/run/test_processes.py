"""Robot and controller as two processes: they fight, and killing either one leaves nothing moving."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest

from mecanum_cli.__main__ import main
from mecanum_env.model import paper_model, write_model
from sysid.logs import read_dataset
from training.drivers.interface import STOPPED_S
from training.run.__main__ import SILENT

PATIENCE_S = 300.0


@contextmanager
def process(*arguments):
    """Run a module of this project; it is killed at the end."""
    command = [sys.executable, "-m", *map(str, arguments)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as one:
        try:
            yield one
        finally:
            one.kill()


@contextmanager
def simulated_robot(folder, *options):
    """Run a simulated robot with a journal; yield its process and its name."""
    options = ("--port", 0, "--journal", folder / "journal.txt", *options)
    with process("training.run.simulated_robot", *options) as robot:
        yield robot, robot.stdout.readline().strip()


def wait_for(condition, *needed):
    """Return as soon as the condition holds; fail if a process that is needed for it has ended."""
    until = time.monotonic() + PATIENCE_S
    while not condition():
        for one in needed:
            assert one.poll() is None, one.communicate()[1]
        assert time.monotonic() < until, "waited in vain"
        time.sleep(0.002)


def journal(folder):
    """Return the changes of the motors' command: (time, V, theta, VC, why)."""
    lines = (folder / "journal.txt").read_text(encoding="utf-8").splitlines()
    return [(float(cells[0]), *map(int, cells[1:4]), cells[4]) for cells in map(str.split, lines)]


@pytest.mark.parametrize("line", ["udp", "serial"])
def test_a_policy_fights_and_logs_what_the_gap_workflow_reads(tmp_path, line):
    with simulated_robot(tmp_path, "--line", line, "--in-step") as (_, name):
        options = ("--robot", name, "--fights", 2, "--silence", 60, "--out", tmp_path / "run")
        with process("training.run", "nominal", *options) as controller:
            said, errors = controller.communicate(timeout=PATIENCE_S)
    assert (controller.returncode, errors) == (0, "")
    assert "jitter" in said
    found = json.loads((tmp_path / "run" / "fights.json").read_text(encoding="utf-8"))
    assert [fight["fight"] for fight in found["fights"]] == [0, 1]
    assert [run.level for run in read_dataset(tmp_path / "run" / "logs").runs] == ["robot", "robot"]


@pytest.mark.parametrize("commands", [1, 4, 9])
def test_killing_the_controller_at_any_moment_stops_the_robot_in_time(tmp_path, commands):
    with simulated_robot(tmp_path) as (robot, name):
        out = tmp_path / "run"
        with process("training.run", "nominal", "--robot", name, "--out", out) as controller:
            # On a busy machine the watchdog may be faster than this test.
            wait_for(
                lambda: (
                    len(entries := journal(tmp_path)) >= commands
                    or any(entry[4] == "stopped" for entry in entries)
                ),
                robot,
                controller,
            )
            os.kill(controller.pid, signal.SIGKILL)
            killed_s = time.monotonic()
            controller.wait()
        wait_for(lambda: journal(tmp_path)[-1][1:4] == (0, 0, 0))
    stopped_s, *_, why = journal(tmp_path)[-1]
    assert why == "stopped"
    assert stopped_s - killed_s <= STOPPED_S


def test_killing_the_robot_ends_the_loop_with_one_sentence(tmp_path):
    out = tmp_path / "run"
    with (
        simulated_robot(tmp_path) as (robot, name),
        # On a busy machine the watchdog may end a fight; then the next one is under way.
        process("training.run", "nominal", "--robot", name, "--out", out, "--fights", 1000) as controller,
    ):
        wait_for(lambda: len(journal(tmp_path)) >= 3, robot, controller)
        os.kill(robot.pid, signal.SIGKILL)
        _, errors = controller.communicate(timeout=PATIENCE_S)
    assert controller.returncode == SILENT
    assert re.fullmatch(r"error: fight \d+: nothing heard of the robot for \S+ s; a stop was sent\n", errors)


def test_a_robot_that_is_not_there_ends_the_loop_the_same_way(tmp_path, capsys):
    out = tmp_path / "run"
    assert main(["run", "nominal", "--robot", "udp:127.0.0.1:9", "--out", str(out), "--json"]) == SILENT
    printed = capsys.readouterr()
    said = json.loads(printed.out)
    assert "nothing heard of the robot for 2 s" in said["error"]
    assert f"error: {said['error']}" in printed.err
    assert said["results"]["fights.json"]["fights"] == []


def test_a_policy_is_refused_on_a_robot_that_it_was_not_trained_for(tmp_path, capsys):
    write_model(paper_model().with_effect("command_latency", delay_s=0.1), tmp_path / "late.json")
    options = ["--robot", "udp:127.0.0.1:9", "--model", str(tmp_path / "late.json")]
    assert main(["run", "nominal", *options, "--out", str(tmp_path / "run")]) == 2
    assert "effect command_latency, must be none; add +compensated" in capsys.readouterr().err
