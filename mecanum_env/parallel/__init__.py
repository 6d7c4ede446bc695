"""Work on many processors: one executor for processes of this machine and for a Ray cluster.

workers    where tasks run (`Workers`) and the executor for it
tasks      a task, how a worker answers it, and what happens to its errors
here       work in this process: tasks one by one, simulations in threads, linear algebra with one thread
local      processes on this machine
cluster    a Ray cluster
same_code  refuses workers that have another version of this package

A task has its own seed in its arguments, and results come in the order of the tasks, so backend and number of
jobs change only how long it takes. Linear algebra has one thread everywhere: the last digits of its results
depend on the number of threads.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
