"""A recording session for a user's own robot: commands to play, how often, and what to do with the logs."""

from sysid.logs.plan.layout import Plan, make_plan
from sysid.logs.plan.protocol import write_plan
from sysid.logs.plan.sequences import Form, Sequence, Size

__all__ = ["Form", "Plan", "Sequence", "Size", "make_plan", "write_plan"]
