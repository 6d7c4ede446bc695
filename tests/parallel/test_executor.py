"""Tasks in this process and in processes of this machine: order, names, deaths, interrupts, equal bytes."""

import os
import signal
import subprocess
import sys
import textwrap
import time

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.parallel import Task, WorkerLostError, Workers, executor, map_in_threads, run_tasks
from mecanum_env.parallel.same_code import code_fingerprint, require_same_code
from mecanum_env.parallel.tasks import answer, unpacked

from .conftest import KILL

TWO = Workers(jobs=2)
HERE = Workers(jobs=1)


def test_results_are_in_the_order_of_the_tasks_and_told_as_they_come(task, tmp_path):
    """The first task waits until the result of the second one was told."""
    file, told = tmp_path / "second was told", {}
    seen = f"(__import__('time').sleep(0.01), __import__('os').path.exists({str(file)!r}))[1]"
    wait = f"[there for there in iter(lambda: {seen}, True) if there] or 1"

    def tell(index, result):
        told[index] = result
        if index == 1:
            file.touch()

    assert run_tasks([task("first", wait), task("second", "2"), task("third", "3")], TWO, tell) == [1, 2, 3]
    assert told == {0: 1, 1: 2, 2: 3}
    assert next(iter(told)) == 1


def test_one_job_is_done_in_this_process(task):
    told = []
    pids = run_tasks([task("pid", "__import__('os').getpid()")] * 2, HERE, lambda *one: told.append(one))
    assert pids == [os.getpid()] * 2
    assert told == list(enumerate(pids))


def test_workers_stay_for_further_tasks(task):
    with executor(TWO) as pool:
        first = pool.run([task("pid", "__import__('os').getpid()")] * 4)
        assert set(pool.run([task("pid", "__import__('os').getpid()")] * 4)) <= set(first)
    assert os.getpid() not in first


def test_a_script_that_would_start_workers_without_end_is_told_what_to_write(tmp_path):
    """Each worker imports the script, and so begins its work again."""
    script = tmp_path / "unguarded.py"
    script.write_text(
        "from mecanum_env.parallel import Task, Workers, run_tasks\n"
        "run_tasks([Task('one', print, ('here',))], Workers(jobs=2))\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False)
    assert 'begin its work under `if __name__ == "__main__":`' in done.stderr.splitlines()[-1]
    # Once for each time that the task is begun, and not once more for each worker of a worker.
    assert done.stderr.count("so it must begin its work under") == 3


def test_no_task_needs_no_worker():
    assert run_tasks([], TWO) == []


@pytest.mark.parametrize("workers", [HERE, TWO], ids=["here", "two"])
def test_an_error_comes_with_the_name_of_its_task(workers, task):
    with pytest.raises(ZeroDivisionError) as caught:
        run_tasks([task("fine", "1"), task("by zero", "1 / 0")], workers)
    assert caught.value.__notes__[0] == "in the task by zero"


def test_an_error_that_cannot_travel_comes_as_text(task):
    odd = "type('Odd', (Exception,), {'__module__': 'nowhere'})('why')"
    with pytest.raises(RuntimeError, match="Odd: why") as caught:
        run_tasks([task("odd", f"(_ for _ in ()).throw({odd})")], TWO)
    assert "in the task odd" in caught.value.__notes__


def test_a_task_that_cannot_be_sent_is_named():
    with pytest.raises(TypeError, match="the task lambda cannot be sent"):
        run_tasks([Task("lambda", lambda: 1)], TWO)


def test_the_task_of_a_killed_worker_is_done_again(task, killed_once):
    tasks = [task("a", "1"), task("killed", killed_once), task("b", "2"), task("c", "3")]
    assert run_tasks(tasks, TWO) == [1, 7, 2, 3]


def test_a_task_that_always_kills_its_worker_is_one_clear_error(task):
    with pytest.raises(WorkerLostError, match=r"the task bad lost its worker process 3 times .*SIGKILL"):
        run_tasks([task("good", "1"), task("bad", KILL)], TWO)


def test_after_an_error_the_executor_still_works(task):
    with executor(TWO) as pool:
        with pytest.raises(ZeroDivisionError):
            pool.run([task("slow", "__import__('time').sleep(60)"), task("by zero", "1 / 0")])
        assert pool.run([task("one", "1"), task("two", "2")]) == [1, 2]


def test_workers_leave_an_interrupt_to_their_parent_from_the_first_one_on(tmp_path):
    """In a program of its own: the first process that Python spawns starts another helper before it."""
    program = tmp_path / "program.py"
    program.write_text(
        textwrap.dedent(
            """
            import signal
            from mecanum_env.parallel import Task, Workers, run_tasks

            def is_left():
                return signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ())

            if __name__ == "__main__":
                print(run_tasks([Task(f"{i}", is_left, ()) for i in range(2)], Workers(jobs=2)))
            """
        )
    )
    path = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    ended = subprocess.run([sys.executable, program], capture_output=True, text=True, env=path)
    assert ended.stdout == "[True, True]\n", ended.stderr


def test_an_interrupt_ends_tasks_and_workers_and_leaves_no_temporary_folder(tmp_path):
    """As Ctrl-C in a terminal does, the signal reaches the workers, too."""
    program = tmp_path / "program.py"
    program.write_text(
        textwrap.dedent(
            """
            import signal
            import time
            from pathlib import Path
            from tempfile import TemporaryDirectory
            from mecanum_env.cli import run
            from mecanum_env.parallel import Task, Workers, run_tasks

            def work(out):
                with TemporaryDirectory(dir=out) as made:
                    (Path(out) / f"begun-{Path(made).name}").touch()
                    time.sleep(600)

            def main(out: str) -> None:
                "Work."
                run_tasks([Task(f"{i}", work, (out,)) for i in range(5)], Workers(jobs=2))

            if __name__ == "__main__":
                # A program that was started in the background ignores the signal.
                signal.signal(signal.SIGINT, signal.default_int_handler)
                raise SystemExit(run(main))
            """
        )
    )
    out = tmp_path / "out"
    out.mkdir()
    running = subprocess.Popen(
        [sys.executable, program, "--out", str(out)],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    while len(list(out.glob("begun-*"))) < 2 and running.poll() is None:
        time.sleep(0.02)
    os.killpg(running.pid, signal.SIGINT)
    _, said = running.communicate(timeout=100)
    assert said == "interrupted; nothing half-written was left behind\n"
    assert running.returncode == 130
    assert [path.name[:5] for path in out.iterdir()] == ["begun"] * 2


def test_the_bytes_are_the_same_here_and_in_workers():
    """A product large enough that its last digits depend on the number of threads."""
    rows = np.random.default_rng(0).standard_normal((400, 300))
    tasks = [Task("svd", np.linalg.svd, (rows, False, False)), Task("inv", np.linalg.inv, (rows.T @ rows,))]
    one, two = (run_tasks(tasks, workers) for workers in (HERE, TWO))
    assert [value.tobytes() for value in one] == [value.tobytes() for value in two]


def test_a_worker_with_other_code_refuses():
    require_same_code(code_fingerprint())
    with pytest.raises(InputError, match="install the same wheel"):
        unpacked(answer(b"\x80\x04\x8c\x05other\x8c\x01x\x86."))


def test_threads_keep_the_order():
    assert map_in_threads(lambda x: x * x, range(20), 1) == map_in_threads(lambda x: x * x, range(20), 3)


@pytest.mark.parametrize(
    ("workers", "said"),
    [
        (Workers(jobs=-1), "jobs = -1, must be at least 0"),
        (Workers("thread"), "backend = 'thread', must be local, ray"),
        (Workers(ray_address="10.0.0.1:6379"), "needs --backend ray"),
    ],
)
def test_workers_that_cannot_be_are_refused(workers, said, task):
    with pytest.raises(InputError, match=said):
        run_tasks([task("one", "1")], workers)


def test_without_ray_its_command_is_named(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(InputError, match=r'Ray is missing; `pip install .*\[ray\]"`'):
        Workers("ray").require_usable()
