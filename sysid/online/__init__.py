"""Online identification: the wheel law is estimated while the wheel runs.

`OnlineEstimator.update` takes one sample at a time; `track` feeds it arrays; `python -m sysid.online LOG`
replays a log through it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
