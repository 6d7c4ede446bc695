from .estimator import OnlineEstimate, OnlineEstimator, first_order_law
from .history import History, LawMetrics, law_metrics, mean_lag_s, track
from .options import OnlineOptions

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
