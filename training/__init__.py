"""Controllers of the Mecanum robot: their training, evaluation, certificates and videos."""

from typing import TYPE_CHECKING

from mecanum_env.lazy import lazy_exports

if TYPE_CHECKING:
    from training.certify import Certificate, Thresholds, read_certificate, write_certificate
    from training.certify import Options as CertifyOptions
    from training.certify import certify as certify_controller
    from training.compare import compare as compare_controllers
    from training.controllers.interface import Controller
    from training.controllers.named import make_controller
    from training.controllers.policy import load_policy
    from training.evaluate import Evaluation, Setup, controller_factory
    from training.evaluate import evaluate as evaluate_controller
    from training.train.run import train as train_policy
    from training.train.settings import Settings as TrainingSettings
else:
    __getattr__, __dir__ = lazy_exports(__name__, __file__)

# The functions certify, compare, evaluate and train have longer names here, since those are subpackages.
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
