"""The packets between controller and robot, the same over UDP and a serial line.

All numbers are little endian. Every packet is a head, a body and the CRC-32 (of zlib, Ethernet) of both:

head      "MT", version u8 = 1, kind u8, session u32, fight u32
BEGIN     nothing                              controller -> robot: the fight begins
COMMAND   tick i32, V i16 [rpm], theta i16 [deg], VC i16 [rpm]
STOP      nothing                              controller -> robot: stand still
REPORT    tick i32, tick of the command held i32, outcome u8, observation's size u8, samples u8, 0 u8,
          sent i64 [us since tick 0], observation f32 each,
          samples: age u32 [us] before `sent`, command held i16 x 3, 10 channels f32     robot -> controller

The session tells one controller from another: a robot obeys the session that began the fight.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.units import FloatArray
from training.drivers.interface import CHANNELS, OUTCOMES, DriveCommand, Outcome, Sample

_MAGIC: Final = b"MT"
_VERSION: Final = 1
_HEAD: Final = struct.Struct("<2sBBII")
_CRC: Final = struct.Struct("<I")
_COMMAND: Final = struct.Struct("<ihhh")
_REPORT: Final = struct.Struct("<iiBBBBq")
_SAMPLE: Final = struct.Struct(f"<Ihhh{len(CHANNELS)}f")
_BEGIN, _ORDER, _STOP, _SENSED = 1, 2, 3, 4
_US: Final = 1e6


@dataclass(frozen=True)
class Begin:
    """The fight begins."""


@dataclass(frozen=True)
class Stop:
    """Stand still until the next fight begins."""


@dataclass(frozen=True)
class Order:
    """A command."""

    tick: int
    """Number of the command period that it is for."""
    command: DriveCommand


@dataclass(frozen=True)
class Report:
    """What the robot reports."""

    tick: int
    held: int
    outcome: Outcome
    observation: FloatArray
    samples: tuple[Sample, ...]
    sent_s: float
    """When it was sent, since tick 0 [s]."""


Body = Begin | Stop | Order | Report


@dataclass(frozen=True)
class Packet:
    """A packet, decoded."""

    session: int
    fight: int
    body: Body


def encode(packet: Packet) -> bytes:
    """Return the bytes of a packet."""
    body = packet.body
    if isinstance(body, Begin):
        kind, data = _BEGIN, b""
    elif isinstance(body, Stop):
        kind, data = _STOP, b""
    elif isinstance(body, Order):
        kind, data = _ORDER, _COMMAND.pack(body.tick, *body.command)
    else:
        kind, data = _SENSED, _report_bytes(body)
    whole = _HEAD.pack(_MAGIC, _VERSION, kind, packet.session, packet.fight) + data
    return whole + _CRC.pack(zlib.crc32(whole))


def decode(data: bytes) -> Packet | None:
    """Return the packet in `data`; None where it is torn, changed, or of another version."""
    if len(data) < _HEAD.size + _CRC.size:
        return None
    whole, crc = data[: -_CRC.size], data[-_CRC.size :]
    if _CRC.unpack(crc)[0] != zlib.crc32(whole):
        return None
    magic, version, kind, session, fight = _HEAD.unpack_from(whole)
    if magic != _MAGIC or version != _VERSION:
        return None
    rest = whole[_HEAD.size :]
    body: Body
    try:
        if kind == _BEGIN:
            body = Begin()
        elif kind == _STOP:
            body = Stop()
        elif kind == _ORDER:
            tick, v, theta, vc = _COMMAND.unpack(rest)
            body = Order(tick, (v, theta, vc))
        elif kind == _SENSED:
            body = _report(rest)
        else:
            return None
    except (struct.error, ValueError, IndexError):
        return None
    return Packet(session, fight, body)


def _report_bytes(report: Report) -> bytes:
    sent_us = round(report.sent_s * _US)
    head = _REPORT.pack(
        report.tick,
        report.held,
        OUTCOMES.index(report.outcome),
        len(report.observation),
        len(report.samples),
        0,
        sent_us,
    )
    seen = np.asarray(report.observation, "<f4").tobytes()
    ages = (max(sent_us - round(sample.time_s * _US), 0) for sample in report.samples)
    pairs = zip(ages, report.samples, strict=True)
    samples = (_SAMPLE.pack(age, *one.command, *one.values) for age, one in pairs)
    return head + seen + b"".join(samples)


def _report(data: bytes) -> Report:
    tick, held, outcome, size, count, _, sent_us = _REPORT.unpack_from(data)
    seen = np.frombuffer(data, "<f4", size, _REPORT.size).astype(float)
    first = _REPORT.size + 4 * size
    if len(data) != first + count * _SAMPLE.size:
        raise ValueError("a report of another length than it says")
    samples = []
    for number in range(count):
        age_us, v, theta, vc, *values = _SAMPLE.unpack_from(data, first + number * _SAMPLE.size)
        samples.append(Sample((sent_us - age_us) / _US, tuple(values), (v, theta, vc)))
    return Report(tick, held, OUTCOMES[outcome], seen, tuple(samples), sent_us / _US)
