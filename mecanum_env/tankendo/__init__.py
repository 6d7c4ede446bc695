"""Tankendo as Gymnasium environments: keep the distance, offer an opening, be gone when the strike lands.

    constants     all numbers of the sport, the opponent, the sensors and the rewards, and their checks
    actions       an action of the policy <-> the command V, theta, VC that the robot takes
    numbers       the same formulas for floats of one episode and for arrays of many
    scene         poses and velocities of robot and opponent, now and a short while ago
    chance        what is random in an episode, drawn at its start
    sword         how the opponent's sword moves
    opponents     the opponent's parameters with their ranges and sources, and distributions of opponents
    fighter       how the opponent walks, when it strikes, where it aims
    judge         hits, rules, rewards and ends: one class for each task
    observation   what the robot's sensors show
    sensing       the same through cameras that lose frames, and an estimator (`mecanum_env.senses`)
    plant         the physics of a batch of robots
    randomize     robots drawn from the uncertainty of the identification
    arena         all of this together, for any number of episodes
    build         arguments of `gymnasium.make` and `reset` -> episodes
    env, vector   Gymnasium's interfaces to one episode and to many
    drawing       pictures of an episode
    pair          the physics of two robots in one model
    bout          two commanded robots against each other: swords, rules, any number of bouts
    duel          PettingZoo's interface to one bout
    duel_drawing  pictures of a bout

Arrays have the episode on their last axis, except where Gymnasium or MuJoCo want it first.
"""

import contextlib

import lazy_loader

from mecanum_env.errors import BackendError
from mecanum_env.rendering.backend import use_backend

# MuJoCo chooses its graphics library when it is imported; without one, only drawing fails.
with contextlib.suppress(BackendError):
    use_backend()

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
