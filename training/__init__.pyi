from .certify import (
    Certificate,
    CertifyOptions,
    Thresholds,
    certify_controller,
    read_certificate,
    write_certificate,
)
from .compare import compare_controllers
from .controllers.interface import Controller
from .controllers.named import make_controller
from .controllers.policy import load_policy
from .evaluate import Evaluation, Setup, controller_factory, evaluate_controller
from .train.run import train_policy
from .train.settings import TrainingSettings

__all__ = [
    "Certificate",
    "CertifyOptions",
    "Controller",
    "Evaluation",
    "Setup",
    "Thresholds",
    "TrainingSettings",
    "certify_controller",
    "compare_controllers",
    "controller_factory",
    "evaluate_controller",
    "load_policy",
    "make_controller",
    "read_certificate",
    "train_policy",
    "write_certificate",
]
