"""Drivers by name, as `python -m training.run --robot` takes them."""

from __future__ import annotations

import importlib
from typing import Final

from mecanum_env.errors import InputError
from training.drivers.interface import Driver
from training.drivers.packet_driver import PacketDriver
from training.drivers.transport import Serial, Udp

PORT: Final = 9750
"""UDP port of a robot, if none is named."""
BAUD: Final = 921600
"""Rate of a serial line, if none is named; reports need 80 kbit/s."""


def open_driver(name: str) -> Driver:
    """Return the driver of a robot, connected.

    Args:
        name: `udp:HOST[:PORT]`, `serial:DEVICE[:BAUD]`, or `MODULE:CLASS` for a driver of one's own, a class
        that
            is called without arguments.

    Raises:
        InputError: there is no such driver, host or device; the message says what would be right.
    """
    kind, _, rest = name.partition(":")
    if not rest:
        raise InputError(
            f"robot {name!r}: must be udp:HOST[:PORT], serial:DEVICE[:BAUD] or MODULE:CLASS of a driver"
        )
    if kind == "udp":
        host, _, port = rest.partition(":")
        return PacketDriver(Udp(host, _whole(name, port) if port else PORT))
    if kind == "serial":
        device, _, baud = rest.partition(":")
        return PacketDriver(Serial(device, _whole(name, baud) if baud else BAUD))
    try:
        driver: Driver = getattr(importlib.import_module(kind), rest)()
    except (ImportError, AttributeError) as error:
        raise InputError(
            f"robot {name!r}: {error}; name a class as MODULE:CLASS, found from the current folder"
        ) from error
    return driver


def _whole(name: str, text: str) -> int:
    if not (text.isdecimal() and 0 < int(text) < 2**32):
        raise InputError(f"robot {name!r}: {text!r} must be a whole number")
    return int(text)
