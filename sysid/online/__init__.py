"""Online identification: the wheel law is estimated while the wheel runs.

`OnlineEstimator.update` takes one sample at a time; `track` feeds it arrays; `python -m sysid.online LOG`
replays a log through it.
"""

from typing import TYPE_CHECKING

from mecanum_env.lazy import lazy_exports

if TYPE_CHECKING:
    from sysid.online.estimator import OnlineEstimate, OnlineEstimator, first_order_law
    from sysid.online.history import History, LawMetrics, law_metrics, mean_lag_s, track
    from sysid.online.projection import OnlineOptions
else:
    __getattr__, __dir__ = lazy_exports(__name__, __file__)

__all__ = [
    "History",
    "LawMetrics",
    "OnlineEstimate",
    "OnlineEstimator",
    "OnlineOptions",
    "first_order_law",
    "law_metrics",
    "mean_lag_s",
    "track",
]
