from .certify import CertifyOptions, certify_controller
from .controllers.named import make_controller
from .controllers.policy import bundled, load_policy
from .evaluate import Setup, controller_factory, evaluate_controller
from .train.run import train_policy
from .train.settings import TrainingSettings

__all__ = [
    "CertifyOptions",
    "Setup",
    "TrainingSettings",
    "bundled",
    "certify_controller",
    "controller_factory",
    "evaluate_controller",
    "load_policy",
    "make_controller",
    "train_policy",
]
