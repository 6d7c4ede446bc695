"""Whether an effect is new since the model was fitted: a comparison with the logs of the fit.

An effect that the fit left out is in the logs of the fit, too: these then fit better with it than without it,
whatever the law. If they fit worse with it, it came later.
"""

from __future__ import annotations

from mecanum_env.model import Model
from sysid.compare.adopted import as_fitted
from sysid.compare.coordinates import EffectSet
from sysid.compare.fitted import Fitted, RefittedLaw, fit
from sysid.compare.learned import Learned
from sysid.compare.problem import ResidualProblem
from sysid.gap.result import Since
from sysid.gap.search.thresholds import THRESHOLDS


def since_of(learned: Learned, chosen: Fitted[EffectSet]) -> dict[str, Since]:
    """Return for each effect of a fitted set whether the logs of the model's fit show it, too.

    `learned` is what these logs taught about the model that the set was fitted to.
    """
    whole = chosen.candidate.model(learned.model, chosen.place)
    model = as_fitted(learned.model)
    without = _cost(learned, model)
    found: dict[str, Since] = {}
    for name in chosen.names:
        # Beside the effects of the model, this one alone; it takes the place of another form of its cause.
        own = EffectSet((name,), ()).model(model, ())
        there = _cost(learned, own.with_effect(name, **whole.effects[name]))
        needed = THRESHOLDS.tie_sigmas**2
        if without is None or there is None or abs(there - without) <= needed:
            found[name] = "unknown"
        else:
            found[name] = "already when fitted" if there < without else "new"
    return found


def _cost(learned: Learned, model: Model) -> float | None:
    """Return the cost of a model in the logs of the fit, with its law fitted again; None without a fit."""
    study = learned.simulators.full.study
    problem = ResidualProblem(model, learned.whitener, study, learned.simulators, learned.before())
    rival = RefittedLaw(model)
    found = fit(problem, rival, rival.start(), most=8)
    return None if found is None else found.cost
