"""Playing seeded episodes of a controller and measuring them.

play     episodes side by side, one seed each; several evaluations in parallel processes
metrics  the metrics of one episode; shares and means over episodes with confidence intervals
"""

from typing import TYPE_CHECKING

from mecanum_env.lazy import lazy_exports

if TYPE_CHECKING:
    from training.evaluate.metrics import Episode, Mean, Reason, Recording, Share, mean, share, summarise
    from training.evaluate.play import (
        ControllerFactory,
        Evaluation,
        Job,
        Setup,
        controller_factory,
        evaluate,
        play_jobs,
    )
else:
    __getattr__, __dir__ = lazy_exports(__name__, __file__)

__all__ = [
    "ControllerFactory",
    "Episode",
    "Evaluation",
    "Job",
    "Mean",
    "Reason",
    "Recording",
    "Setup",
    "Share",
    "controller_factory",
    "evaluate",
    "mean",
    "play_jobs",
    "share",
    "summarise",
]
