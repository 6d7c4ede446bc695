"""Certifying a controller: fixed episodes on many plants, metrics with intervals, pass or fail.

plants       the variants of the robot that it is played on
run          what is played, and the certificate of the results
warning      success against warning time
thresholds   what a controller must reach
certificate  the content of a certificate, its checks, and its JSON file
report       a certificate as text and as an HTML page
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
