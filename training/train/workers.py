"""The environments of a training in several processes, each with some of the rows.

Rows do not depend on each other, so a training ends with the same weights in any number of processes; only
a process with a single row, whose matrix products round differently, may change a last digit.
Stable-Baselines3's `SubprocVecEnv` has a process for each environment; here each has hundreds.
"""

from __future__ import annotations

import contextlib
import multiprocessing
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from multiprocessing.connection import Connection
from typing import Any, Final, Protocol

import numpy as np
import numpy.typing as npt
from stable_baselines3.common.vec_env import VecEnv

from mecanum_env.errors import MachineError, MecanumError
from mecanum_env.parallel import environment_of_workers

Array = npt.NDArray[Any]
Indices = int | Sequence[int] | None
_PATIENCE_S: Final = 10.0
"""How long a process may take to end [s]; then it is killed."""


class Part(Protocol):
    """Some rows of an environment; it can be pickled."""

    @property
    def rows(self) -> int:
        """How many they are."""

    def make(self) -> VecEnv:
        """Return an environment with these rows."""

    def renew(self, env: VecEnv, steps_done: int) -> None:
        """Give `env` opponents and robots of the part of the training after `steps_done`; then reset it."""


class WorkersVecEnv(VecEnv):  # type: ignore[misc]
    """An environment whose parts are in processes, one each; their rows follow each other.

    Its methods raise MachineError if a process has ended, an error of this project that a process raised, and
    RuntimeError with any other as its cause.
    """

    render_mode = None
    """Nothing is drawn."""

    def __init__(self, parts: Sequence[Part]) -> None:
        # A first part that is made here says what an observation and an action are.
        one = parts[0].make()
        super().__init__(sum(part.rows for part in parts), one.observation_space, one.action_space)
        one.close()
        # One process imports what the others need, and these begin as its copies: torch takes seconds.
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload([__name__])
        sizes = one.observation_space.shape[0], one.action_space.shape[0]
        block = context.RawArray("f", self.num_envs * (sum(sizes) + 2))
        self._steps = _Steps.of(block, *sizes)
        ends = np.cumsum([0, *(part.rows for part in parts)]).tolist()
        self._rows = [slice(first, end) for first, end in pairwise(ends)]
        self._pipes: list[Connection] = []
        self._processes = []
        for part, rows in zip(parts, self._rows, strict=True):
            ours, theirs = context.Pipe()
            process = context.Process(target=_serve, args=(theirs, part, rows, block, sizes), daemon=True)
            with environment_of_workers():
                process.start()
            theirs.close()
            self._pipes.append(ours)
            self._processes.append(process)

    def renew(self, steps_done: int) -> None:
        """Take opponents and robots of the part of the training after `steps_done`; a reset must follow."""
        self._ask("renew", [steps_done] * len(self._rows))
        self._answers()

    def reset(self) -> Array:
        """Begin an episode in every row; return the first observations."""
        self._ask("reset", [self._seeds[rows] for rows in self._rows])
        self._answers()
        self.reset_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return self._steps.observations.copy()

    def step_async(self, actions: Array) -> None:
        """Begin a step with actions of shape (num_envs, 3)."""
        self._steps.actions[:] = actions
        self._ask("step", [None] * len(self._rows))

    def step_wait(self) -> tuple[Array, Array, Array, list[dict[str, Any]]]:
        """Return observations, rewards, ends and infos of the step."""
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for rows, ended in zip(self._rows, self._answers(), strict=True):
            for row, info in ended.items():
                infos[rows.start + row] = info
        steps = self._steps
        return steps.observations.copy(), steps.rewards.copy(), steps.dones > 0.0, infos

    def close(self) -> None:
        """End all processes."""
        pipes, self._pipes = self._pipes, []
        for pipe in pipes:
            pipe.close()
        for process in self._processes:
            process.join(_PATIENCE_S)
            if process.exitcode is None:
                process.kill()
                process.join()

    def _ask(self, what: str, given: Sequence[Any]) -> None:
        for pipe, own in zip(self._pipes, given, strict=True):
            # A process that has ended gives no answer, which `_answers` says.
            with contextlib.suppress(OSError):
                pipe.send((what, own))

    def _answers(self) -> list[Any]:
        found = []
        for pipe, rows in zip(self._pipes, self._rows, strict=True):
            try:
                answer = pipe.recv()
            except (EOFError, OSError) as error:
                raise MachineError(
                    f"the process with environments {rows.start} to {rows.stop - 1} ended, perhaps for "
                    "lack of memory; go on with --resume and the folder of the run"
                ) from error
            if isinstance(answer, MecanumError):
                raise answer
            if isinstance(answer, BaseException):
                raise RuntimeError("a process with environments failed") from answer
            found.append(answer)
        return found

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """Return this object's own attribute `attr_name`, for each of the indices: what all rows share."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Raise: the attribute `attr_name` cannot have a `value` for these indices, in other processes."""
        raise NotImplementedError(f"set_attr({attr_name!r}, {value!r}, {indices}): in other processes")

    def env_method(
        self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Raise: `method_name` cannot be called for these indices, in other processes.

        `method_args` and `method_kwargs` would be its arguments.
        """
        given = ", ".join(map(repr, (*method_args, *method_kwargs.values())))
        raise NotImplementedError(f"{method_name}({given}) for {indices}: in other processes")

    def env_is_wrapped(self, wrapper_class: type[Any], indices: Indices = None) -> list[bool]:
        """Return for each of the indices whether its environment is a `wrapper_class`; it is inside none."""
        return [isinstance(self, wrapper_class) for _ in self._get_indices(indices)]


@dataclass(frozen=True)
class _Steps:
    """The numbers of a step of all rows, in memory that the processes share."""

    observations: Array
    actions: Array
    rewards: Array
    dones: Array

    @staticmethod
    def of(block: Any, seen: int, acted: int) -> _Steps:
        """Return a `block` of memory as arrays; an observation has `seen` numbers, an action `acted`."""
        flat = np.frombuffer(block, np.float32)
        n = len(flat) // (seen + acted + 2)
        observations, actions, rewards, dones = np.split(flat, [n * seen, n * (seen + acted), len(flat) - n])
        return _Steps(observations.reshape(n, seen), actions.reshape(n, acted), rewards, dones)


def _serve(pipe: Connection, part: Part, rows: slice, block: Any, sizes: tuple[int, int]) -> None:
    """Do what the training asks of some rows, until it closes the pipe or ends."""
    steps = _Steps.of(block, *sizes)
    env = part.make()
    try:
        while True:
            what, given = pipe.recv()
            try:
                pipe.send(_done(what, given, env, part, rows, steps))
            except Exception as error:
                pipe.send(error)
    except (EOFError, OSError):
        return


def _done(what: str, given: Any, env: VecEnv, part: Part, rows: slice, steps: _Steps) -> Any:
    """Do one thing; return the infos of the episodes that end in it, by row."""
    if what == "renew":
        part.renew(env, given)
        return {}
    if what == "reset":
        env.unwrapped._seeds = given
        steps.observations[rows] = env.reset()
        return {}
    observations, rewards, dones, infos = env.step(steps.actions[rows])
    steps.observations[rows], steps.rewards[rows], steps.dones[rows] = observations, rewards, dones
    return {row: infos[row] for row in np.flatnonzero(dones).tolist()}
