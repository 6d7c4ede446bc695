from .metrics import Episode, Mean, Reason, Recording, Share, mean, share, success_of, summarise
from .play import (
    ControllerFactory,
    Evaluation,
    Job,
    Setup,
    controller_factory,
    evaluate_controller,
    play_jobs,
)

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
    "evaluate_controller",
    "mean",
    "play_jobs",
    "share",
    "success_of",
    "summarise",
]
