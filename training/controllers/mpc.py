"""Model-predictive evasion: tries ways to move on the identified law against the strike as estimated."""

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
from training.controllers.interface import Command, twist_command
from training.controllers.prediction.hit_margin import Seen, miss_margin
from training.controllers.prediction.observed_motion import Delays, SeenMotion, integrated_path
from training.controllers.prediction.strike_phase import StrikeEstimate, StrikePhase, StrikePriors
from training.controllers.tracking import Proportional


@dataclass(frozen=True)
class Planning:
    """How it plans; all values are this project's own."""

    directions: int = 8
    """Ways to go, evenly around; standing is one more."""
    speed_share: float = 0.97
    """How fast, of what the wheels reach straight ahead."""
    longest: int = 8
    """Commands to look ahead at most."""
    latest_change: int = 3
    """Commands after which a plan changes at the latest; a later change can wait for the next plan."""
    hypotheses: int = 12
    """Strikes that a plan is tried against."""
    spread_m: float = 0.03
    """Standard deviation of aim and prediction together [m]."""
    least_probability: float = 0.3
    """It evades what is a strike with this probability."""
    wait_m: float = Rules.maai_m + 0.1
    """Distance while it waits [m]."""
    return_gain_per_s: float = 4.0
    """Correction of distance and bearing once the strike is over [1/s]."""
    distance_weight_per_m: float = 0.6
    """What being off maai at the hit costs, in probability of a hit."""
    loyalty: float = 0.05
    """Advantage of going on with the last plan."""


@dataclass
class _Plan:
    """What it is about: a twist until a command, then another."""

    first: FloatArray
    second: FloatArray
    commands: int


class Mpc:
    """Takes, ten times a second, the first command of the plan that is missed most surely.

    A plan is one velocity for some commands, then another one until the strike has landed. Its path is that
    of the identified law with the drives' torque limit (`training.controllers.prediction.motion_model`), from
    the state in which the commands under way leave the robot. It is scored by

        sum over hypotheses of P(hypothesis) Phi(margin / spread) - weight |distance at the hit - maai|

    with the margin by which the strike misses (`training.controllers.prediction.hit_margin`) for strikes as
    `StrikePhase` holds them possible. Between strikes it keeps its distance.

    Args:
        model: wheel laws, robot and its `command_latency`.
        planning: how it plans.
        opponent: techniques, sight delay and lead are taken as known; by default those of level normal.
        priors: of the strike's times; by default all levels.
        delays: how late it sees and acts; by default the usual sensors and the model's latency.
    """

    def __init__(
        self,
        model: Model,
        planning: Planning | None = None,
        opponent: Opponent | None = None,
        priors: StrikePriors | None = None,
        delays: Delays | None = None,
    ) -> None:
        self._planning = Planning() if planning is None else planning
        self._opponent = Opponent() if opponent is None else opponent
        self._robot = model.robot
        self._period_s = model.wheel.command_period_s
        self._limit_rpm = min(model.wheel.saturation_rpm, FULL_V_RPM)
        self._speed_m_s = self._planning.speed_share * float(
            wheels_to_twist(np.full(4, self._limit_rpm), model.robot)[0]
        )
        self._motion = SeenMotion(model, Delays.of(model) if delays is None else delays)
        self._strike = StrikePhase(self._opponent, priors, step_s=self._period_s)
        # Their twists are wanted, not their commands.
        self._wait = Proportional(self._planning.wait_m)
        gain = self._planning.return_gain_per_s
        self._return = Proportional(gain_per_s=gain, turn_gain_per_s=gain)
        self.reset()

    def reset(self) -> None:
        """Forget the episode."""
        self._motion.reset()
        self._strike.reset()
        self._plan: _Plan | None = None
        self._origin: FloatArray | None = None
        self._origins = 0

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (20 or more,)."""
        raw = read_observation(observation)
        estimate = self._strike.update(raw)
        seen = self._motion.now(raw)
        twist = self._twist(seen, estimate)
        command = twist_command(
            float(twist[0]), float(twist[1]), float(twist[2]), self._robot, self._limit_rpm
        )
        self._motion.send(command)
        return command

    def _twist(self, seen: Observed, estimate: StrikeEstimate | None) -> FloatArray:
        if estimate is None:
            self._plan = self._origin = None
            return np.array(self._wait.twist(seen))
        if estimate.strike_probability < self._planning.least_probability:
            self._plan = None
            return np.array(self._wait.twist(seen))
        self._follow_origin(seen, estimate)
        acts_s = self._motion.delays.acts_s
        if estimate.land_s - acts_s < 0.5 * self._motion.own.model.tick_s:
            self._plan = None
            return np.array(self._return.twist(self._at_origin(seen)))
        self._plan = self._best(seen, estimate, acts_s)
        return self._plan.first

    def _follow_origin(self, seen: Observed, estimate: StrikeEstimate) -> None:
        """Estimate where the opponent stood when the strike began, in the frame of the predicted robot."""
        now = np.array([float(seen.opponent_x), float(seen.opponent_y)])
        # ... its place is brought forward with its velocity; what it has stepped by then is taken off.
        stepped = self._strike.stepped_m(estimate, self._motion.delays.acts_s)
        towards = -now / max(float(np.hypot(*now)), 1e-6)
        new = now - stepped * towards
        if self._origin is None:
            self._origin, self._origins = new, 1
            return
        moved = self._motion.own.moved(self._period_s)
        cos, sin = np.cos(moved[2]), np.sin(moved[2])
        old = self._origin - moved[:2]
        old = np.array([cos * old[0] + sin * old[1], cos * old[1] - sin * old[0]])
        self._origins += 1
        self._origin = old + (new - old) / self._origins

    def _at_origin(self, seen: Observed) -> Observed:
        """Return what is seen as if the opponent were back where it began its step: there it will stand."""
        assert self._origin is not None
        return replace(seen, opponent_x=np.asarray(self._origin[0]), opponent_y=np.asarray(self._origin[1]))

    def _best(self, seen: Observed, estimate: StrikeEstimate, acts_s: float) -> _Plan:
        planning = self._planning
        weight, technique, cut_s, land_s = _typical(estimate, planning.hypotheses)
        cut_s, land_s = cut_s - acts_s, land_s - acts_s
        horizon_s = float(np.max(land_s))
        commands = int(np.clip(np.ceil(horizon_s / self._period_s - 1e-9), 1, planning.longest))
        first, second, switch = self._ways(seen, commands)
        path = self._paths(first, second, switch, commands)  # (ticks + 1, 5, n): x, y, yaw, vx, vy
        tick_s = self._motion.own.model.tick_s
        past = self._past(tick_s)  # (m, 5), the last is now
        whole = np.concatenate([np.repeat(past[:-1, :, None], path.shape[2], axis=2), path])
        now = len(past) - 1

        def at(seconds: FloatArray) -> Seen:
            index = np.clip(np.rint(seconds / tick_s).astype(int) + now, 0, len(whole) - 1)
            return Seen(*np.moveaxis(whole[index], 1, 0))  # each (k, n)

        landed = at(land_s)
        assert self._origin is not None
        margin = miss_margin(
            self._opponent,
            technique[:, None],
            self._origin,
            at(cut_s - self._opponent.sight_delay_s),
            landed,
        )
        distance = np.hypot(landed.x - self._origin[0], landed.y - self._origin[1])
        off = np.abs(distance - Rules.maai_m)
        value = ndtr(margin / planning.spread_m) - planning.distance_weight_per_m * off
        score = weight @ value
        if self._plan is not None:
            score[-1] += planning.loyalty
        best = int(np.argmax(score))
        left = int(switch[best])
        if left <= 0:
            return _Plan(second[:, best], second[:, best], 0)
        return _Plan(first[:, best], second[:, best], left)

    def _ways(self, seen: Observed, commands: int) -> tuple[FloatArray, FloatArray, npt.NDArray[np.intp]]:
        """Return first and second twists, (3, n), and after how many commands they change, (n,)."""
        planning = self._planning
        angles = np.arctan2(float(seen.opponent_y), float(seen.opponent_x)) + (
            2.0 * np.pi * np.arange(planning.directions) / planning.directions
        )
        twists = np.zeros((3, planning.directions + 1))
        twists[0, 1:], twists[1, 1:] = (
            self._speed_m_s * np.cos(angles),
            self._speed_m_s * np.sin(angles),
        )
        count = planning.directions + 1
        changes = np.arange(1, 1 + max(min(commands - 1, planning.latest_change), 1))
        one, other, change = (
            grid.ravel() for grid in np.meshgrid(np.arange(count), np.arange(count), changes, indexing="ij")
        )
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
        """Return what plans lead to: x, y, yaw, vx, vy in the frame of now, shape (ticks + 1, 5, n)."""
        own = self._motion.own
        limit = self._limit_rpm
        wheels_first = scale_wheels(twist_to_wheels(first.T, self._robot), limit).T
        wheels_second = scale_wheels(twist_to_wheels(second.T, self._robot), limit).T
        wheels_first = own.model.received(wheels_first, own.time_s)
        wheels_second = own.model.received(wheels_second, own.time_s)
        state = own.state.repeated(first.shape[1])
        twists = [state.twist[None]]
        for command in range(commands):
            wheels = np.where(command < switch, wheels_first, wheels_second)
            played, state = own.model.play(state, wheels, own.model.ticks(own.commands + command))
            twists.append(played)
        return _places(np.concatenate(twists) + self._motion.off[:, None], own.model.tick_s)

    def _past(self, tick_s: float) -> FloatArray:
        """Return where the robot was until now, in the frame of now, shape (m, 5)."""
        own = self._motion.own
        ticks = round((self._opponent.sight_delay_s + 0.3) / tick_s)
        twists = own.recent(ticks) + self._motion.off
        path = _places(twists[:, :, None], tick_s)[:, :, 0]
        end = path[-1].copy()
        cos, sin = np.cos(end[2]), np.sin(end[2])
        back = path.copy()
        for x, y in ((0, 1), (3, 4)):
            dx, dy = (path[:, x] - end[x], path[:, y] - end[y]) if x == 0 else (path[:, x], path[:, y])
            back[:, x], back[:, y] = cos * dx + sin * dy, cos * dy - sin * dx
        back[:, 2] = path[:, 2] - end[2]
        return back


def _places(twists: FloatArray, tick_s: float) -> FloatArray:
    """Return x, y, yaw and the velocity in the frame of the start, (m + 1, 5, n), of twists (m + 1, 3, n)."""
    poses = integrated_path(twists, np.full(len(twists) - 1, tick_s))
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    vx = cos * twists[:, 0] - sin * twists[:, 1]
    vy = sin * twists[:, 0] + cos * twists[:, 1]
    return np.concatenate([poses, vx[:, None], vy[:, None]], axis=1)


def _typical(
    estimate: StrikeEstimate, count: int
) -> tuple[FloatArray, npt.NDArray[np.intp], FloatArray, FloatArray]:
    """Return weights, techniques, times until cut and hit [s], (m,) each, of at most `count` strikes."""
    rows = np.flatnonzero(~estimate.is_feint)
    rows = rows[np.argsort(estimate.land_in_s[rows], kind="stable")]
    if len(rows) > count:
        # Evenly through the probability, in the order of landing.
        cumulative = np.cumsum(estimate.weight[rows])
        marks = (np.arange(count) + 0.5) / count * cumulative[-1]
        rows = rows[np.minimum(np.searchsorted(cumulative, marks), len(rows) - 1)]
        weight = np.full(count, 1.0 / count)
    else:
        weight = estimate.weight[rows] / np.sum(estimate.weight[rows])
    return weight, estimate.technique[rows], estimate.cut_in_s[rows], estimate.land_in_s[rows]
