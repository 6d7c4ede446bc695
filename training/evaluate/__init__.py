"""Playing seeded episodes of a controller and measuring them.

play       episodes side by side, one seed an episode
episode    what is recorded of one, and what is kept
measures   settling, overshoot and the like, of arrays
jobs       many evaluations at a time
intervals  shares and means with their intervals
"""

from typing import TYPE_CHECKING

from mecanum_env.lazy import lazy_exports

if TYPE_CHECKING:
    from training.evaluate.episode import Ending, Episode, Reason, Trace, summarise
    from training.evaluate.intervals import Mean, Share, mean, share
    from training.evaluate.jobs import Job, play_jobs
    from training.evaluate.play import Evaluation, Maker, Setup, evaluate, named_maker
else:
    __getattr__, __dir__ = lazy_exports(__name__, __file__)

__all__ = [
    "Ending",
    "Episode",
    "Evaluation",
    "Job",
    "Maker",
    "Mean",
    "Reason",
    "Setup",
    "Share",
    "Trace",
    "evaluate",
    "mean",
    "named_maker",
    "play_jobs",
    "share",
    "summarise",
]
