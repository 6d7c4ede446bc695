"""All controllers side by side: `python -m training.compare`.

comparison  what is played, and the results of each controller
report      both as text and as a Markdown page
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
