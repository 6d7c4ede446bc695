from .here import map_in_threads, one_thread
from .local import environment_of_workers
from .tasks import Executor, Task, Tell, WorkerLostError
from .workers import Workers, executor, run_tasks

__all__ = [
    "Executor",
    "Task",
    "Tell",
    "WorkerLostError",
    "Workers",
    "environment_of_workers",
    "executor",
    "map_in_threads",
    "one_thread",
    "run_tasks",
]
