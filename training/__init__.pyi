from .certify import CertifyOptions, certify_controller
from .controllers.named import make_controller
from .controllers.policy import bundled, load_policy
from .drivers import Reading, Sample, open_driver
from .evaluate import Setup, controller_factory, evaluate_controller
from .export import export_policy
from .train.run import train_policy
from .train.settings import TrainingSettings

__all__ = [
    "CertifyOptions",
    "Reading",
    "Sample",
    "Setup",
    "TrainingSettings",
    "bundled",
    "certify_controller",
    "controller_factory",
    "evaluate_controller",
    "export_policy",
    "load_policy",
    "make_controller",
    "open_driver",
    "train_policy",
]
