"""Tankendo for one robot: the Gymnasium environment."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Unpack

import gymnasium
import numpy as np
import numpy.typing as npt

from mecanum_env.errors import BackendError, InputError
from mecanum_env.rendering.backend import display_answers, has_display
from mecanum_env.rendering.view import Frame
from mecanum_env.tankendo.actions import checked_action
from mecanum_env.tankendo.build import Arguments, build

if TYPE_CHECKING:
    from mecanum_env.tankendo.drawing import Painter, Window

Observation = npt.NDArray[np.float32]


class TankendoEnv(gymnasium.Env[Observation, npt.NDArray[np.float32]]):
    """Tankendo against an opponent, on the dynamics that were identified from a robot's logs.

    ## Description

    Tankendo is fencing with a sword of 53 cm on a field of 9 x 9 m. Two players are at striking distance
    (maai) when the tips of their swords meet without crossing. The robot is a four-wheel Mecanum base that
    takes a command (V, theta, VC) ten times a second; its wheels behave as `python -m sysid.fit` found them,
    with the effects that `python -m sysid.gap` named. It must keep maai, offer an opening, and be gone when
    the strike lands.

    Two rules keep it from winning by flight: the opponent strikes only while the robot offers an opening (it
    is at maai within the band, faces the opponent, and is slow), and an evasion counts only if the robot is
    back at maai, facing, one second later. The opponent sees the robot late and leads its aim by the robot's
    motion.

    | id | task | success |
    |---|---|---|
    | `MecanumTankendo-v0` | the dodge | one strike evaded, and back at maai |
    | `MecanumTankendoDodge-v0` | the same | the same |
    | `MecanumTankendoTrack-v0` | the opponent walks about | at maai, facing, for 80 % of the time after 3 s |
    | `MecanumTankendoDuel-v0` | the robot strikes too | two points before the opponent has two |

    In the duel the robot's arm strikes by itself, when the opponent recovers from a strike, is within 1.45 m,
    and within 0.15 rad of the robot's forward axis. It hits 0.2 s later if the opponent is then within 1.45 m
    and 0.3 rad.

    All constants are in `mecanum_env.tankendo.constants`, with their sources; those of the opponent are this
    project's own, since no paper on such robots states them. The environment runs with those in
    `env.unwrapped.arena.setting`.

    ## Action Space

    `Box(-1, 1, (3,), float32)`, converted to whole numbers V [rpm], theta [deg], VC [rpm], which the robot
    holds for 0.1 s (the model's `command_period_s`).

    | `action_mode` | 0 | 1 | 2 | V | theta | VC |
    |---|---|---|---|---|---|---|
    | `cartesian` | forward | left | turn | 135 length(0, 1), up to 135 | direction of (0, 1) | 100 turn |
    | `polar` | speed | direction | turn | 135 (speed + 1) / 2 | 180 direction | 100 turn |
    | `command` | V | theta | VC | 135 V | 180 theta | 100 VC |

    ## Observation Space

    `Box((20,), float32)`; in the duel `(23,)`. Positions and velocities are in the robot's body frame (x
    ahead, y left); velocities are over the floor. All but the command is `observation_delay` old (0.05 s by
    default) and has normal noise.

    | Num | Observation | Min | Max | Noise (std) | Unit |
    |---|---|---|---|---|---|
    | 0, 1 | position of the opponent: ahead, left | -15 | 15 | 0.01 | m |
    | 2, 3 | velocity of the opponent: ahead, left | -5 | 5 | 0.05 | m/s |
    | 4, 5 | tip of its sword: ahead, left | -15 | 15 | 0.01 | m |
    | 6 | height of the tip | -3 | 3 | 0.01 | m |
    | 7, 8, 9 | velocity of the tip: ahead, left, up | -40 | 40 | 0.1 | m/s |
    | 10, 11 | own velocity: ahead, left | -5 | 5 | 0.02 | m/s |
    | 12 | own yaw rate | -20 | 20 | 0.02 | rad/s |
    | 13, 14, 15 | V cos theta / 135, V sin theta / 135, VC / 100, as commanded | -1.5 | 1.5 | 0 | 1 |
    | 16, 17 | own position in the field, from its centre | -7 | 7 | 0.02 | m |
    | 18, 19 | cosine, sine of the own heading | -1.5 | 1.5 | 0.01 | 1 |
    | 20, 21 | duel: points of the robot, of the opponent | -10 | 10 | 0 | 1 |
    | 22 | duel: 1 while the own sword strikes, else 0 | -10 | 10 | 0 | 1 |

    `mecanum_env.tankendo.read_observation` returns them by name. How the tip draws back shows the technique:
    low for do, a little up for nodo, up for kote, far up for men.

    ## Rewards

    The reward is the sum of these terms; `info` has each as `reward_NAME`:

    - *distance* = -0.02 min(|distance - maai| / band, 3)
    - *facing* = -0.01 min(|bearing| / facing angle, 3)
    - *effort* = -0.005 |change of (V cos theta / 135, V sin theta / 135, VC / 100)|
    - *waiting* = -0.02 before the strike has come; in the duel always, in tracking never
    - *hit* = -1 when the robot is hit
    - *success* = +1 when the episode is a success; in the duel, for each point of the robot
    - *out* = -1 when the robot leaves the field or clashes with the opponent (centres within 0.65 m)

    ## Starting State

    The players stand 2.2 to 2.8 m apart along x, the point between them within 0.5 m of the field's centre
    along each axis. The robot faces the opponent within 0.3 rad; the opponent walks up to it.
    `reset(options=...)` fixes some of this for one episode, and the rest is drawn as without options:

    | Option | Value |
    |---|---|
    | `technique` | name or index of the technique of every strike: `"do"`, `"nodo"`, `"men"`, `"kote"` |
    | `start` | pose of the robot, (x [m], y [m], yaw [rad]); the opponent stands ahead along x |

    ## Episode End

    ### Termination
    Dodge: a hit, or the judgement one second after a strike that missed. Duel: one side has two points. All:
    the robot leaves the field, or a clash.

    ### Truncation
    After 12 s (dodge), 15 s (tracking, always), 60 s (duel).

    `info["is_success"]` says whether the episode was a success. `info` also has `hit`, `distance_m`,
    `bearing_rad`, and, for the strike that is under way or over, `technique` (its index; -1: no strike) and
    `warning_s`, the time from its first visible motion to its end; in tracking `kept_share`, in the duel
    `points` and `points_against`.

    ## Arguments

    ```python
    import gymnasium
    import mecanum_env

    env = gymnasium.make("MecanumTankendo-v0", model="fit/model.json", difficulty="hard")
    ```

    | Parameter | Default | Description |
    |---|---|---|
    | `task` | `"dodge"` | set by the id: `"dodge"`, `"track"` or `"duel"` |
    | `model` | packaged | path of a model file, or a `mecanum_env.model.Model` |
    | `plant` | `"planar"` | `"rollers"`: rollers on a floor; `"planar"`: no slip, much faster |
    | `difficulty` | `"normal"` | `"easy"`, `"normal"` or `"hard"` |
    | `action_mode` | `"cartesian"` | see Action Space |
    | `observation_delay` | 0.05 | age of the observation [s] |
    | `opponent` | of the difficulty | a `mecanum_env.tankendo.Opponent`, or `Opponents`: drawn at reset |
    | `randomize` | `"none"` | `"posterior"`, ranges or models: a robot for each episode (`randomize.py`) |
    | `reward_weights` | as above | some or all weights by name, such as `{"hit": 2.0}` |
    | `rules` | as above | a `mecanum_env.tankendo.Rules` |
    | `senses` | None | a `mecanum_env.senses.Senses`: frames, drop-outs, and an estimator behind them |
    | `sensors` | as above | a `mecanum_env.tankendo.Sensors` |
    | `timestep_s` | 1/120, 1/240 | upper bound of the physics step, planar and rollers [s] |
    | `render_mode` | None | `"rgb_array"`; with a display also `"human"` |

    `gymnasium.make_vec("MecanumTankendo-v0", num_envs=64)` steps many at once (`TankendoVectorEnv`).

    ## Version History

    * v0: first version
    """

    # Gymnasium declares `metadata` as an attribute of instances, so that it cannot be a class variable here.
    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(self, *, render_mode: str | None = None, **arguments: Unpack[Arguments]) -> None:
        self._episodes = build(1, **arguments)
        self.arena = self._episodes.arena
        self.action_space: gymnasium.Space[Any] = self._episodes.action_space()
        self.observation_space: gymnasium.Space[Any] = self._episodes.observation_space()
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise InputError(f'render_mode = {render_mode!r}, must be "rgb_array", "human" or None')
        if not has_display():
            # Gymnasium's checker tries every mode that an environment lists.
            self.metadata = {**self.metadata, "render_modes": ["rgb_array"]}
        self.render_mode = render_mode
        self._painter: Painter | None = None
        self._window: Window | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy or a pickle holds: all but the renderers, which it opens anew when it draws."""
        return {**vars(self), "_painter": None, "_window": None}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; return the first observation and info.

        The seed is that of this and all following episodes; None: the generator goes on. The options fix what
        is drawn otherwise in this episode, see the class.

        Raises:
            InputError: options that do not fit; nothing has changed.
        """
        start = self._episodes.start_of(options)
        super().reset(seed=seed)
        self._episodes.restart([0], [self.np_random], start)
        # Another robot may have been drawn; pictures need its model.
        if self._episodes.drawn is not None:
            self.close()
        if self.render_mode == "human":
            self.render()
        return self.arena.observe()[0], self.arena.state()

    def step(self, action: npt.NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Send an action, shape (3,); return observation, reward, terminated, truncated, info.

        Raises:
            InputError: an action of another shape, or not finite; nothing has moved.
            gymnasium.error.ResetNeeded: no episode has begun, or it is over.
        """
        step = self._episodes.step(checked_action(action, (3,))[None])
        if self.render_mode == "human":
            self.render()
        return step.observation[0], step.reward, step.terminated, step.truncated, step.info

    def render(self) -> Frame | None:
        """Return a picture, shape (480, 640, 3), in the mode "rgb_array"; draw into the window in "human".

        Raises:
            BackendError: the mode "human" without a display.
        """
        from mecanum_env.tankendo.drawing import Painter, Window

        if self.render_mode is None:
            gymnasium.logger.warn('render() needs render_mode="rgb_array" or "human" in gymnasium.make')
            return None
        if self.render_mode == "human":
            if self._window is None:
                if not display_answers():
                    raise BackendError(
                        'render_mode="human" opens a window and there is no display here: use "rgb_array" '
                        "for pictures, or `python -m mecanum_env.view` to drive the robot in a browser"
                    )
                self._window = Window(self.arena, self._episodes.plant)
            self._window.show()
            return None
        if self._painter is None:
            self._painter = Painter(self.arena, self._episodes.plant)
        return self._painter.frame()

    def close(self) -> None:
        """Close window and renderer."""
        for shown in (self._painter, self._window):
            if shown is not None:
                shown.close()
        self._painter = self._window = None
