"""Certifying a controller: fixed episodes on many plants, metrics with intervals, pass or fail.

plants       the variants of the robot that it is played on
variations   opponents and senses beside them, and what no training has seen
adversary    an opponent searched against the controller
run          what is played, and the certificate of the results
warning      success against warning time
thresholds   what a controller must reach
results      the metrics of one plant
checks       passed, missed, undecided
certificate  the content of a certificate, and its JSON file
report       a certificate as text and as an HTML page
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
