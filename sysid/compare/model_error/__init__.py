"""How wrong a model may be without a gap: its own error, its uncertain parameters, and whitening by them."""

from sysid.compare.model_error.adopted import as_fitted, covariance_of, with_adopted
from sysid.compare.model_error.exchange import Exchange, Place
from sysid.compare.model_error.freedom import KNOWN, DifferenceCounts
from sysid.compare.model_error.further_repeats import Moved
from sysid.compare.model_error.known_error import without_known_error
from sysid.compare.model_error.learned import Learned, learn
from sysid.compare.model_error.marginal import Marginal
from sysid.compare.model_error.nuisance import plausible_models, shape_columns
from sysid.compare.model_error.own_error import block_residuals, with_own_error
from sysid.compare.model_error.physics_step import step_error
from sysid.compare.model_error.repeated import RepeatedCommands, repeated_commands
from sysid.compare.model_error.same_commands import with_same_commands
from sysid.compare.model_error.shape import ShapeBasis
from sysid.compare.model_error.size import ModelError, estimate_model_error, model_error_of
from sysid.compare.model_error.whitening import Whitener

__all__ = [
    "KNOWN",
    "DifferenceCounts",
    "Exchange",
    "Learned",
    "Marginal",
    "ModelError",
    "Moved",
    "Place",
    "RepeatedCommands",
    "ShapeBasis",
    "Whitener",
    "as_fitted",
    "block_residuals",
    "covariance_of",
    "estimate_model_error",
    "learn",
    "model_error_of",
    "plausible_models",
    "repeated_commands",
    "shape_columns",
    "step_error",
    "with_adopted",
    "with_own_error",
    "with_same_commands",
    "without_known_error",
]
