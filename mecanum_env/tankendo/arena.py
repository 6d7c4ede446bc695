"""All of the task together, for any number of episodes side by side; one row and many run the same lines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal, get_args

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.tankendo.actions import FULL_V_RPM, FULL_VC_RPM, ActionMode, action_to_command, check_mode
from mecanum_env.tankendo.chance import Chance
from mecanum_env.tankendo.constants import Opponent, RewardWeights, Rules, Sensors
from mecanum_env.tankendo.judge import TERMS, Dodge, Judge
from mecanum_env.tankendo.observation import EXTRA_LIMIT, LIMITS, NOISY, Senses
from mecanum_env.tankendo.opponent import Fighter
from mecanum_env.tankendo.plant import Compiled, RobotBatch
from mecanum_env.tankendo.scene import BoolArray, Scenes, wrapped
from mecanum_env.tankendo.tasks import Duel, Track
from mecanum_env.units import FloatArray

TaskName = Literal["dodge", "track", "duel"]
_JUDGES: Final[Mapping[str, type[Judge]]] = {"dodge": Dodge, "track": Track, "duel": Duel}


@dataclass(frozen=True)
class TaskSetting:
    """What is the same in every episode."""

    task: TaskName = "dodge"
    opponent: Opponent = field(default_factory=Opponent)
    rules: Rules = field(default_factory=Rules)
    sensors: Sensors = field(default_factory=Sensors)
    weights: RewardWeights = field(default_factory=RewardWeights)
    action_mode: ActionMode = "cartesian"

    def __post_init__(self) -> None:
        if self.task not in get_args(TaskName):
            raise InputError(
                f"task = {self.task!r}{did_you_mean(self.task, _JUDGES)}, must be {', '.join(_JUDGES)}"
            )
        check_mode(self.action_mode)

    @property
    def observation_limits(self) -> npt.NDArray[np.float32]:
        """Largest absolute value of each number of an observation, shape (k,)."""
        extra = np.full(_JUDGES[self.task].extra_observations, EXTRA_LIMIT)
        return np.concatenate([LIMITS, extra]).astype(np.float32)


@dataclass(frozen=True)
class Step:
    """What a step brought; arrays have the episode on their first axis."""

    observation: npt.NDArray[np.float32]
    reward: FloatArray
    terminated: BoolArray
    truncated: BoolArray
    info: dict[str, npt.NDArray[Any]]


class Arena:
    """n episodes side by side.

    Args:
        setting: what is the same in all.
        compiled: the robot's model, ready to run.
        n: how many.
        threads: that step the physics.

    Raises:
        InputError: a time limit of less than one step.
    """

    def __init__(self, setting: TaskSetting, compiled: Compiled, n: int, threads: int = 1) -> None:
        self.setting, self.n = setting, n
        self.step_s = compiled.model.wheel.command_period_s
        self._quantum_rpm = compiled.model.wheel.command_quantum_rpm
        judge = _JUDGES[setting.task]
        self.time_limit_s = judge.time_limit_s(setting.rules)
        self._steps = round(self.time_limit_s / self.step_s)
        if self._steps < 1:
            raise InputError(
                f"rules: {setting.task}_time_s = {self.time_limit_s:g}, must be at least one command period, "
                f"{self.step_s:g} s"
            )
        self.robots = RobotBatch(compiled, n, threads)
        self.chance = Chance(n, self._steps, NOISY, setting.opponent, setting.rules)
        oldest = max(setting.sensors.delay_s, setting.opponent.sight_delay_s + self.step_s)
        self.scenes = Scenes(n, self.step_s, oldest)
        self.fighter = Fighter(n, setting.opponent, setting.rules, self.chance, self.scenes, self.step_s)
        self.judge = judge(n, setting.rules, setting.weights, self.fighter, self.scenes, self.chance)
        self.step_count = np.zeros(n, np.intp)
        self._held = np.zeros((3, n))
        self.commands = np.zeros((n, 3))
        """The last commands: V [rpm], theta [deg], VC [rpm]."""
        self.senses = Senses(setting.sensors, self.step_s, self.judge.extra_observations)
        self._all = np.arange(n)
        self.begun = np.zeros(n, bool)
        """Whether an episode has ever begun in each row."""
        self.hit, self.succeeded, self.ended = (np.zeros(n, bool) for _ in range(3))
        """Whether the last step brought a hit, a success, the end."""

    def restart(self, row: int, rng: np.random.Generator, compiled: Compiled | None = None) -> None:
        """Begin a new episode in one row.

        Args:
            row: which.
            rng: generator of that environment, the only source of chance.
            compiled: the robot of this episode; the common one when None.
        """
        self.chance.draw(row, rng)
        x, y, turned = self.chance.start_place[:, row]
        distance = self.chance.start_distance[row]
        # The robot starts on its side of the centre, the opponent straight across.
        x -= distance / 2
        self.robots.restart(row, (x, y, turned), compiled)
        self.scenes.restart(row, [x, y, turned, 0, 0, 0, x + distance, y, np.pi, 0, 0])
        self.fighter.restart(row)
        self.judge.restart(row)
        self.senses.restart(row, self.robots.model_of(row))
        self.begun[row] = True
        self.step_count[row] = 0
        self._held[:, row] = 0.0
        self.commands[row] = 0.0
        self.hit[row] = self.succeeded[row] = self.ended[row] = False

    def step(self, actions: npt.NDArray[np.floating]) -> Step:
        """Send one command to each robot and play one command period.

        Args:
            actions: (n, 3), see `mecanum_env.tankendo.actions`.
        """
        start_s = self.time_s()
        fighter, judge = self.fighter, self.judge
        commands = action_to_command(actions, self.setting.action_mode, self._quantum_rpm)
        fighter.decide(start_s, judge.may_strike(start_s))
        opponent = fighter.walk(start_s, judge.stands(start_s), judge.wish(start_s))
        self.robots.step(commands)
        motion = self.robots.motion()
        before = self.scenes.now[2].copy()
        newest = self.scenes.push()
        newest[:6], newest[6:] = motion, opponent
        newest[2] = before + wrapped(motion[2] - before)
        self.step_count += 1
        end_s = self.time_s()
        fighter.aim(end_s)
        held = command_shares(commands)
        change = held - self._held
        effort = np.sqrt(change[0] ** 2 + change[1] ** 2 + change[2] ** 2)
        self._held, self.commands = held, commands
        verdict = judge.judge(end_s, effort)
        truncated = ~verdict.terminated & (self.step_count >= self._steps)
        self.hit, self.succeeded = verdict.hit.copy(), verdict.success.copy()
        self.ended = verdict.terminated | truncated
        info = {f"reward_{name}": verdict.terms[name] for name in TERMS}
        info |= {"is_success": verdict.success, "hit": verdict.hit} | self.state_info()
        return Step(self.observe(), verdict.reward, verdict.terminated, truncated, info)

    def time_s(self) -> FloatArray:
        """Return the time since each episode began, (n,) [s]."""
        return np.asarray(self.step_count * self.step_s, float)

    def observe(self) -> npt.NDArray[np.float32]:
        """Return what the sensors show now, shape (n, k)."""
        now_s = self.time_s()
        noise = self.chance.noise[self.step_count, :, self._all].T
        extra = self.judge.observe(now_s)
        return self.senses.observe(self.scenes, now_s, self.fighter.sword, self._held, noise, extra)

    def state_info(self) -> dict[str, npt.NDArray[Any]]:
        """Return what `info` says of the present, arrays (n,) by name."""
        distance, bearing = self.scenes.separation()
        sword = self.fighter.sword
        return {
            "distance_m": distance,
            "bearing_rad": bearing,
            "technique": np.where(sword.is_feint, -1, self.fighter.technique()),
            "warning_s": np.where(sword.is_feint, 0.0, sword.land_s - sword.raise_s),
            **self.judge.report(),
        }


def command_shares(commands: FloatArray) -> FloatArray:
    """Return commands (n, 3) as shares of the full ones: ahead, left, turn, shape (3, n)."""
    v, angle = commands[:, 0] / FULL_V_RPM, np.deg2rad(commands[:, 1])
    return np.array([v * np.cos(angle), v * np.sin(angle), commands[:, 2] / FULL_VC_RPM])
