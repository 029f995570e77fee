"""Motors on a CAN bus: the driver, the codecs that speak to the motors, and simulated motors to try them on."""

from naoimitate.hw.can.driver import CanDriver
from naoimitate.hw.can.sender import CanSettings

__all__ = ["CanDriver", "CanSettings"]
