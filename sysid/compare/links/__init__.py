"""What a link does to commands on their way to the drive: delay, jitter and loss, from bench logs."""

from sysid.compare.links.aligned_logs import AlignedLogs
from sysid.compare.links.delays import LinkClock, LinkDelays, delays_between_rows, link_delays
from sysid.compare.links.faults import LinkFault, LinkState, known_state, link_fault
from sysid.compare.links.in_model import JITTER, LOSS, with_stamps

__all__ = [
    "JITTER",
    "LOSS",
    "AlignedLogs",
    "LinkClock",
    "LinkDelays",
    "LinkFault",
    "LinkState",
    "delays_between_rows",
    "known_state",
    "link_delays",
    "link_fault",
    "with_stamps",
]
