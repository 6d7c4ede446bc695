"""Model-predictive evasion: plans on the identified law against the strike as it is estimated."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from mecanum_env.kinematics import scale_wheels, twist_to_wheels, wheels_to_twist
from mecanum_env.model import Model
from mecanum_env.tankendo import Observed, Opponent, Rules, read_observation
from mecanum_env.tankendo.actions import FULL_V_RPM
from mecanum_env.units import FloatArray
from training.controllers.identified_motion import IdentifiedPredictor
from training.controllers.interface import Command, twist_command
from training.controllers.observed_motion import integrated_path, seen_from
from training.controllers.strike import (
    WARNING_S,
    RobotStates,
    StrikeEstimate,
    StrikePhase,
    miss_margin,
)
from training.controllers.tracking import Proportional, opponent_place

_HISTORY_S = 0.3
"""The strike's view of the robot's past goes back this much further than the opponent's sight delay [s]."""


@dataclass(frozen=True)
class Planning:
    """Parameters of the planner; all values are this project's own."""

    directions: int = 8
    """Directions of motion, evenly spaced; standing still is one more choice."""
    speed_share: float = 0.97
    """Planned speed, relative to the largest speed straight ahead."""
    longest: int = 8
    """Largest horizon, in commands."""
    latest_change: int = 3
    """A plan changes its velocity after at most this many commands; later changes are left to later plans."""
    hypotheses: int = 12
    """Largest number of strikes that a plan is tried against."""
    spread_m: float = 0.03
    """Standard deviation of the opponent's aim and of the prediction together [m]."""
    least_probability: float = 0.3
    """Probability of a strike above which it evades."""
    wait_margin_m: float = 0.1
    """Distance beyond maai while it waits [m]."""
    creep_m_s: float = 0.2
    """Speed across the line to the opponent while it waits, towards the middle of the field [m/s]."""
    return_gain_per_s: float = 4.0
    """Gain of distance and bearing once the strike is over [1/s]."""
    distance_weight_per_m: float = 0.6
    """Cost of being off maai at the hit, in probability of a hit per metre."""
    continuation_bonus: float = 0.05
    """Bonus for continuing the last plan, in probability of a hit."""
    warning_s: tuple[float, float] = WARNING_S
    """Range of the warning that it expects [s]."""


@dataclass
class _Plan:
    """A twist for a number of commands, then another one."""

    first: FloatArray
    second: FloatArray
    commands: int


class Mpc:
    """Sends, ten times a second, the first command of the plan that makes the strike miss most surely.

    A plan is one velocity for some commands and then another one until the strike has landed. Its path is
    predicted by the identified law with the drives' torque limit (`motion_model`), from the state
    to which the commands under way lead. Its score is

        sum over hypotheses of P(hypothesis) Phi(margin / spread) - weight |distance at the hit - maai|

    with the margin by which each hypothetical strike of `StrikePhase` misses. Between strikes the robot keeps
    its distance. The opponent's techniques, sight delay and lead are taken as known; by default they are
    those of level normal. The maai is that of the rules. With `is_exact` the model is that of the robot
    itself, and its delay and speed need not be identified.
    """

    def __init__(
        self,
        model: Model,
        planning: Planning | None = None,
        opponent: Opponent | None = None,
        rules: Rules | None = None,
        *,
        is_exact: bool = False,
    ) -> None:
        self._planning = Planning() if planning is None else planning
        self._opponent = Opponent() if opponent is None else opponent
        self._maai_m = (Rules() if rules is None else rules).maai_m
        self._robot = model.robot
        self._period_s = model.wheel.command_period_s
        self._limit_rpm = min(model.wheel.saturation_rpm, FULL_V_RPM)
        self._speed_m_s = self._planning.speed_share * float(
            wheels_to_twist(np.full(4, self._limit_rpm), model.robot)[0]
        )
        self._motion = IdentifiedPredictor(model, is_exact=is_exact)
        self._strike = StrikePhase(self._opponent, self._period_s, self._planning.warning_s)
        # Only the twists of these two are used, not their commands.
        self._wait = Proportional(self._maai_m + self._planning.wait_margin_m)
        gain = self._planning.return_gain_per_s
        self._return = Proportional(self._maai_m, gain_per_s=gain, turn_gain_per_s=gain)
        self.reset()

    def reset(self) -> None:
        """Forget the episode."""
        self._motion.reset()
        self._strike.reset()
        self.sees_strike = False
        """Whether the sword had left its guard in the last observation."""
        self._plan: _Plan | None = None
        self._origin: FloatArray | None = None
        self._origins = 0
        self._side = 0.0
        self._waiting = np.zeros(2)

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (20 or more,), which is then sent."""
        command = self.advise(observation)
        self.sent(command)
        return command

    def advise(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (20 or more,); `sent` tells which one was sent."""
        raw = read_observation(observation)
        estimate = self._strike.update(raw)
        self.sees_strike = estimate is not None
        vx, vy, turn = (float(value) for value in self._twist(self._motion.predict(raw), estimate))
        return twist_command(vx, vy, turn, self._robot, self._limit_rpm)

    def sent(self, command: Command) -> None:
        """Take note of the `command` that was sent after the last observation."""
        self._motion.send(command)

    def _twist(self, seen: Observed, estimate: StrikeEstimate | None) -> FloatArray:
        if estimate is None or estimate.strike_probability < self._planning.least_probability:
            self._plan = None
            if estimate is None:
                self._origin = None
                self._waiting = _turned(np.array([float(seen.vx), float(seen.vy)]), seen)
            return self._waiting_twist(seen)
        origin = self._follow_origin(seen, estimate)
        acts_s = self._motion.command_s
        if estimate.land_s - acts_s < 0.5 * self._motion.own.model.tick_s:
            # The strike is over when the command acts: return to where the opponent will stand.
            self._plan = None
            back = replace(seen, opponent_x=np.asarray(origin[0]), opponent_y=np.asarray(origin[1]))
            return np.array(self._return.twist(back))
        self._plan = self._best_plan(seen, estimate, origin, acts_s)
        return self._plan.first

    def _waiting_twist(self, seen: Observed) -> FloatArray:
        """Return the twist that keeps the distance and creeps to one side, the same in all of an episode."""
        x, y, distance = opponent_place(seen)
        if not self._side:
            middle = -_turned_back(np.array([float(seen.x), float(seen.y)]), seen)
            self._side = 1.0 if x * middle[1] - y * middle[0] >= 0.0 else -1.0
        vx, vy, turn = self._wait.twist(seen)
        creep = self._side * self._planning.creep_m_s / distance
        return np.array([vx - creep * y, vy + creep * x, turn])

    def _follow_origin(self, seen: Observed, estimate: StrikeEstimate) -> FloatArray:
        """Return the mean estimate of where the opponent stood when the strike began, as seen from now."""
        x, y, distance = opponent_place(seen)
        now = np.array([x, y])
        # The opponent is seen at the time when the command acts; its step until then is subtracted.
        stepped = self._strike.stepped_m(estimate, self._motion.command_s)
        new: FloatArray = now - stepped * (-now / distance)
        if self._origin is None:
            self._origin, self._origins = new, 1
            return new
        moved = self._motion.share * self._motion.own.moved(self._period_s)
        old = np.array(seen_from(moved, *self._origin))
        self._origins += 1
        self._origin = old + (new - old) / self._origins
        return self._origin

    def _best_plan(
        self, seen: Observed, estimate: StrikeEstimate, origin: FloatArray, acts_s: float
    ) -> _Plan:
        """Return the plan with the highest score for commands that act after `acts_s` [s]."""
        planning = self._planning
        weight, technique, cut_s, land_s = _representative(estimate, planning.hypotheses)
        cut_s, land_s = cut_s - acts_s, land_s - acts_s
        commands = int(np.clip(np.ceil(np.max(land_s) / self._period_s - 1e-9), 1, planning.longest))
        first, second, switch = self._candidates(seen, commands)
        path = self._paths(first, second, switch, commands)
        tick_s = self._motion.own.model.tick_s
        past = self._past(tick_s)
        now = len(past) - 1
        whole = np.concatenate([np.repeat(past[:-1, :, None], path.shape[2], axis=2), path])

        def at(seconds: FloatArray) -> RobotStates:
            """Return the robots of the n plans at k times, each array of shape (k, n)."""
            index = np.clip(np.rint(seconds / tick_s).astype(int) + now, 0, len(whole) - 1)
            return RobotStates(*np.moveaxis(whole[index], 1, 0))

        landed = at(land_s)
        seen_then = at(cut_s - self._opponent.sight_delay_s)
        waiting = _turned_back(self._waiting, seen)
        margin = miss_margin(self._opponent, technique[:, None], origin, seen_then, landed, waiting)
        off = np.abs(np.hypot(landed.x - origin[0], landed.y - origin[1]) - self._maai_m)
        score = weight @ (ndtr(margin / planning.spread_m) - planning.distance_weight_per_m * off)
        if self._plan is not None:
            score[-1] += planning.continuation_bonus
        best = int(np.argmax(score))
        left = max(int(switch[best]), 0)
        return _Plan((first if left else second)[:, best], second[:, best], left)

    def _candidates(
        self, seen: Observed, commands: int
    ) -> tuple[FloatArray, FloatArray, npt.NDArray[np.intp]]:
        """Return the first and second twists, (3, n), and after how many commands they change, (n,).

        The last candidate is the rest of the previous plan, if there is one.
        """
        planning = self._planning
        count = planning.directions + 1
        angles = np.arctan2(float(seen.opponent_y), float(seen.opponent_x)) + (
            2.0 * np.pi * np.arange(planning.directions) / planning.directions
        )
        twists = np.zeros((3, count))
        twists[0, 1:], twists[1, 1:] = self._speed_m_s * np.cos(angles), self._speed_m_s * np.sin(angles)
        changes = np.arange(1, 1 + max(min(commands - 1, planning.latest_change), 1))
        grids = np.meshgrid(np.arange(count), np.arange(count), changes, indexing="ij")
        one, other, change = (grid.ravel() for grid in grids)
        keep = (one != other) | (change == 1)
        one, other, change = one[keep], other[keep], change[keep]
        first, second = twists[:, one], twists[:, other]
        if self._plan is not None:
            first = np.concatenate([first, self._plan.first[:, None]], axis=1)
            second = np.concatenate([second, self._plan.second[:, None]], axis=1)
            change = np.append(change, self._plan.commands - 1)
        return first, second, change.astype(np.intp)

    def _paths(
        self, first: FloatArray, second: FloatArray, switch: npt.NDArray[np.intp], commands: int
    ) -> FloatArray:
        """Return the paths of plans: x, y, yaw, vx, vy in the present frame, shape (ticks + 1, 5, n)."""
        own = self._motion.own
        wheels_first, wheels_second = (
            own.model.drives.received(scale_wheels(wheels, self._limit_rpm).T, own.time_s)
            for wheels in (twist_to_wheels(twists.T, self._robot) for twists in (first, second))
        )
        state = own.state.repeated(first.shape[1])
        twists = [state.twist[None]]
        for command in range(commands):
            wheels = np.where(command < switch, wheels_first, wheels_second)
            played, state = own.model.play(state, wheels, own.model.ticks(own.commands + command))
            twists.append(played)
        reached = self._motion.share[:, None] * np.concatenate(twists)
        return _path_states(reached + self._motion.velocity_error[:, None], own.model.tick_s)

    def _past(self, tick_s: float) -> FloatArray:
        """Return x, y, yaw, vx, vy of the robot until now in the present frame, shape (m, 5)."""
        own = self._motion.own
        twists = own.recent(round((self._opponent.sight_delay_s + _HISTORY_S) / tick_s))
        reached = self._motion.share * twists + self._motion.velocity_error
        path = _path_states(reached[:, :, None], tick_s)[:, :, 0]
        path[:, :3] -= path[-1, :3].copy()
        # The yaw of the start in the present frame is minus the total turn.
        cos, sin = np.cos(path[0, 2]), np.sin(path[0, 2])
        for x, y in ((0, 1), (3, 4)):
            path[:, x], path[:, y] = cos * path[:, x] - sin * path[:, y], sin * path[:, x] + cos * path[:, y]
        return path


def _turned(vector: FloatArray, seen: Observed) -> FloatArray:
    """Return a vector of the robot's frame, as its heading was `seen`, in the field's, shape (2,)."""
    cos, sin = float(seen.heading_cos), float(seen.heading_sin)
    return np.array([cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1]])


def _turned_back(vector: FloatArray, seen: Observed) -> FloatArray:
    """Return a vector of the field's frame in the robot's, as its heading was `seen`, shape (2,)."""
    cos, sin = float(seen.heading_cos), float(seen.heading_sin)
    return np.array([cos * vector[0] + sin * vector[1], cos * vector[1] - sin * vector[0]])


def _path_states(twists: FloatArray, tick_s: float) -> FloatArray:
    """Return x, y, yaw, vx, vy in the frame of the start, shape (m + 1, 5, n), of twists (m + 1, 3, n)."""
    poses = integrated_path(twists, np.full(len(twists) - 1, tick_s))
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    vx = cos * twists[:, 0] - sin * twists[:, 1]
    vy = sin * twists[:, 0] + cos * twists[:, 1]
    return np.concatenate([poses, vx[:, None], vy[:, None]], axis=1)


def _representative(
    estimate: StrikeEstimate, count: int
) -> tuple[FloatArray, npt.NDArray[np.intp], FloatArray, FloatArray]:
    """Return weights, techniques, and times until cut and hit [s], each (m,), of at most `count` strikes."""
    rows = np.flatnonzero(~estimate.is_feint)
    rows = rows[np.argsort(estimate.land_in_s[rows], kind="stable")]
    if len(rows) > count:
        # Quantiles of the probability in the order of landing.
        cumulative = np.cumsum(estimate.weight[rows])
        marks = (np.arange(count) + 0.5) / count * cumulative[-1]
        rows = rows[np.minimum(np.searchsorted(cumulative, marks), len(rows) - 1)]
        weight = np.full(count, 1.0 / count)
    else:
        weight = estimate.weight[rows] / np.sum(estimate.weight[rows])
    return weight, estimate.technique[rows], estimate.cut_in_s[rows], estimate.land_in_s[rows]
