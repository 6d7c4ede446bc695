"""Work on many processors: one executor for processes of this machine and for a Ray cluster.

workers    where tasks run (`Workers`) and the executor for it
tasks      a task, how a worker answers it, and what happens to its errors
here       tasks one after the other in this process
local      processes on this machine
cluster    a Ray cluster
same_code  refuses workers that have another version of this package
threads    many simulations inside one process, and one thread for linear algebra

A task has its own seed in its arguments, and results come in the order of the tasks, so backend and number of
jobs change only how long it takes. Linear algebra has one thread everywhere: the last digits of its results
depend on the number of threads.
"""

from mecanum_env.parallel.tasks import Executor, Task, Tell, WorkerLostError
from mecanum_env.parallel.threads import map_in_threads, one_thread
from mecanum_env.parallel.workers import Workers, executor, run_tasks

__all__ = [
    "Executor",
    "Task",
    "Tell",
    "WorkerLostError",
    "Workers",
    "executor",
    "map_in_threads",
    "one_thread",
    "run_tasks",
]
