"""From logs to the wheel law: command path, delay, ceiling, command times, weights, and the law behind them.

fitting        `fit_law`: the whole way, with the weights of the samples
command_path   what happens to a logged command before the law: clock, rounding, ceiling
command_clock  the clock on which commands were given
wheel_data     the runs of each wheel on the clock of the law
fitter         one fit of the law, with the settings that all fits share
choice         whether a clock, a delay or a ceiling is worth having
behind_path    all starts and methods behind one command path
unseen_swings  a law that swings where no sample shows it, and a tick with which it cannot
command_times  the fit where each change of the command acts at a time of its own
notes          what a user should know about the result
law_fit        `LawFit`, the result
"""

from sysid.fit.drive.command_path import CommandPath, infer_command_path
from sysid.fit.drive.command_times import STAGE, with_times_by, with_times_of_commands
from sysid.fit.drive.fitting import fit_law
from sysid.fit.drive.law_fit import LawFit, latency, wheel_model
from sysid.fit.drive.wheel_data import wheel_columns, wheel_run

__all__ = [
    "STAGE",
    "CommandPath",
    "LawFit",
    "fit_law",
    "infer_command_path",
    "latency",
    "wheel_columns",
    "wheel_model",
    "wheel_run",
    "with_times_by",
    "with_times_of_commands",
]
