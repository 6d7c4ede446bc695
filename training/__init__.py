"""Controllers of the Mecanum robot: their training, evaluation, certificates and videos.

In the order in which a policy meets them (docs/training.md; each program has `--help`):

controllers  what acts: `reset()`, `act(observation)`; scripts, LQR, planner, policies, all by name
train        `python -m training.train`: a policy by PPO or SAC; `training.train.planned`: by imitation
evaluate     seeded episodes and their metrics, for all below
certify      `python -m training.certify`: one controller on many robots, against many opponents
compare      `python -m training.compare`: many controllers side by side
record       `python -m training.record`: a video of an episode
duel         `python -m training.duel`: two controllers against each other, and self-play
export       `python -m training.export`: a policy as ONNX and C
run          `python -m training.run`: a controller on a robot; also a robot to try it on
drivers      how bytes get to a robot and back

The folder `policies` holds trained policies that come with the package, with their cards.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
