"""Numbers that the paper's text states, for comparison with our results.

S. Nie, N. Igo and K. Hoshino, "Parameter Identification of Mecanum Wheel Robot Using Descent with Stability
Criterion". Numbers that are only drawn in its figures are not included.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

FIT_STEPS_RPM: Final = (10, 40, 80, 130)
"""Section 4.1: four sets of steps, three repeats each (section 5)."""
FIT_REPEATS: Final = 3
TEST_STEPS_RPM: Final = tuple(range(10, 131, 10))
"""Section 4.2: thirteen sets of steps, five repeats each."""
TEST_REPEATS: Final = 5
BEYOND_RPM: Final = 140
"""Section 4.3: a step beyond the linear range."""
CEILING_RPM: Final = 135.0
"""Section 4.3: no faster than this, whatever the command."""
TRIALS: Final = 5
TRIAL_S: Final = 5.2
"""Section 4.4: five random trials of this length, five long and five short holds each."""
SEARCH_RPM: Final = 60
"""Section 1: the exhaustive search is fitted at this speed alone."""
STARTS: Final = 10
"""Section 4.1: sets of random initial parameters."""
SHOWN_STEPS_RPM: Final = (10, 80, 130)
"""Fig. 3."""

OPTIMAL_COST_RPM2: Final = 21.80
"""Section 4.1: H at the published optimum, a mean squared error."""
SUCCESS: Final[Mapping[str, float]] = {"gradient": 0.9, "kkt": 0.6, "poles": 0.0}
STABLE: Final[Mapping[str, float]] = {"gradient": 0.3, "kkt": 0.6}
"""Section 4.1; "all successful models being stable" for kkt. None is printed for poles."""
STEADY_ERROR: Final[Mapping[str, float]] = {
    "target": 4.52e-4,
    "exhaustive": 2.79e-6,
    "gradient": 1.09e-2,
    "kkt": -4.41e-8,
}
RISE_S: Final[Mapping[str, float]] = {"target": 0.11, "exhaustive": 0.11, "gradient": 0.11, "kkt": 0.12}
SETTLING_S: Final[Mapping[str, float]] = {"target": 0.25, "exhaustive": 0.23, "gradient": 0.22, "kkt": 0.23}
"""Section 4.2."""
MSE_KKT_MINUS_GRADIENT_RPM2: Final = 1.077
"""Section 4.4: average of the random trials; exhaustive is worse than kkt. Table 1 is not in the text."""
ROBOT_LOSS: Final[Mapping[str, float]] = {
    "straight 10 rpm": 0.186,
    "straight 40 rpm": 0.0689,
    "straight 80 rpm": 0.156,
    "straight 130 rpm": 0.310,
    "turn 1.484 rad/s": 0.0306,
}
"""Section 4.5: relative steady-state errors; the model is always faster than the robot."""
ROTATION_RAD_S: Final = 1.484
ROBOT_RISE_S: Final = 0.19
MODEL_RISE_S: Final = 0.12
