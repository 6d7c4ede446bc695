"""Playing seeded episodes of a controller and measuring them.

play     episodes side by side, one seed each; several evaluations in parallel processes
metrics  the metrics of one episode; shares and means over episodes with confidence intervals
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
