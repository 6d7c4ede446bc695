"""Logs of wheels and robots: reading them strictly, and reporting what is odd in them.

`read_dataset` is the entry point; the folder format is section 1 of FORMATS.md.

reader    a folder or file as a `Dataset`; `settings` reads its `dataset.toml`
runs      columns, runs and datasets, as everything else sees them
splits    repeats and groups; which runs fit, validate and test
common_times  when commands were given, told by all repeats together
checks    findings in a log that a user should know; `quantities` refuses columns in other units
findings  what a finding is, and its words; `describe` says all of a dataset
noise     how much repeats differ
tails     samples that count less: outliers, heavy tails, noise that grows with the speed; `tail_laws` has the
          laws of noise and the step of a sensor, `neighbours` what they are judged by
bodies    robots on any number of omni wheels
of_fit    the logs that a model was fitted to; `first_samples` tells at what speed a run starts
writer    runs as files; `plots` draws them
plan      what to record of a robot
formats   logs of other programs
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
