"""The topologies of the zoo's drives, each with the class of real products that it stands for."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from sysid.studies.zoo.drives.drive import Family

FAMILIES: Mapping[Family, str] = MappingProxyType(
    {
        "open_duty": "Duty proportional to the command, no feedback: H-bridge boards with hobby gearmotors "
        "(L298N, TB6612, DRV8833).",
        "open_duty_compensated": "Duty plus a share of the measured R i drop (IxR compensation): small DC "
        "drives without an encoder, motor drivers with current sense.",
        "p": "Proportional speed loop, often with feed-forward, no integral action: teaching robots and "
        "firmwares tuned never to overshoot.",
        "pi": "Proportional-integral speed loop in volts: microcontroller boards with an encoder (Arduino "
        "and STM32 robots, TurtleBot-like bases).",
        "pid": "The textbook PID with a derivative of the measured speed or of the error: hobby PID "
        "libraries on microcontrollers.",
        "cascade": "Speed loop over a current loop: servo amplifiers (EPOS, ESCON, ODrive).",
        "feed_forward": "PI around a back-EMF feed-forward that does most of the work: RoboClaw-like boards "
        "with their QPPS constant.",
        "filtered_set_point": "PI or cascade behind first-order filters of the set-point: VESC, ESCON's "
        "set-value filter, analogue references with an RC filter.",
        "profile": "PI or cascade behind a profile generator with ramps and limited jerk: EPOS in profile "
        "velocity mode, Dynamixel.",
    }
)
"""One line per topology: what it does, and who builds it."""
