"""Opening a CAN bus with python-can, and one clear sentence for each way in which that fails."""

from __future__ import annotations

import errno
import logging

import can

from naoimitate.core.errors import DriverError
from naoimitate.robot.model import RobotModel

USUAL_BITRATE = 1_000_000
"""bit/s of a CAN bus in a robot, where robot.yaml says nothing: the fastest that classic CAN has."""

logging.getLogger("can").addHandler(logging.NullHandler())  # its backends warn at import about drivers nobody asked for


def bitrate_of(robot: RobotModel) -> int:
    """bit/s of the bus in a robot with a section ``can`` in its robot.yaml."""
    return int(robot.data["can"].get("bitrate", USUAL_BITRATE))


def open_bus(interface: str, channel: str, bitrate: int) -> can.BusABC:
    """Open a channel of any interface of python-can; bitrate in bit/s, where the interface sets it itself.

    Raises DriverError that says what to do.
    """
    if not interface or not channel:
        raise DriverError("which CAN bus? Give an interface and a channel, such as socketcan and can0")
    try:
        return can.Bus(interface=interface, channel=channel, bitrate=bitrate)
    except can.CanInterfaceNotImplementedError as error:
        raise DriverError(_unusable(interface, error)) from error
    except Exception as error:  # the backends raise whatever their drivers' libraries do
        raise DriverError(_reason(interface, channel, bitrate, error)) from error


def _unusable(interface: str, error: Exception) -> str:
    if interface not in can.VALID_INTERFACES:
        return f"there is no CAN interface {interface!r}: give one of {', '.join(sorted(can.VALID_INTERFACES))}"
    needs = (
        "pip install naoimitate[can-udp]" if interface == "udp_multicast" else "install what python-can names for it"
    )
    return f"the CAN interface {interface!r} cannot be used here ({_line(error)}): {needs}"


def _reason(interface: str, channel: str, bitrate: int, error: Exception) -> str:
    number = getattr(error, "errno", None) or getattr(error, "error_code", None)
    where = f"CAN channel {channel!r} of {interface}"
    if interface == "socketcan" and number == errno.EAFNOSUPPORT:
        return "this kernel has no SocketCAN: load its modules (modprobe can can_raw), or use another CAN interface"
    if interface == "socketcan" and number == errno.ENODEV:
        return f"there is no {where}: see `ip link`; plug the adapter in, or correct the channel"
    if interface == "socketcan" and number == errno.ENETDOWN:
        return f"the {where} is down: ip link set {channel} up type can bitrate {bitrate}"
    if interface == "udp_multicast" and number == errno.ENODEV:
        return f"the {where} has no multicast route: ip route add 224.0.0.0/4 dev lo"
    return f"the {where} cannot be opened ({_line(error)}): check the name, the adapter and its driver"


def _line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
