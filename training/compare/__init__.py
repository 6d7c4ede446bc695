"""All controllers side by side: `python -m training.compare`.

comparison  what is played, the results of each controller, and both as text and Markdown
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
