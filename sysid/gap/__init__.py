"""Where simulation and measurement disagree, which effect is missing, and whether adding it closes the gap.

`analyse` runs a study; `python -m sysid.gap` is its command line. `search` decides which effects are missing,
`design` finds the next experiment, `report` puts out the results; CONTRIBUTING.md has the path of a study.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
