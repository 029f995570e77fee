"""Motors on a CAN bus: the driver, the codecs that speak to the motors, and simulated motors to try them on."""

from naoimitate.hw.can.driver import CanDriver, CanSettings

__all__ = ["CanDriver", "CanSettings"]
