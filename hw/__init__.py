"""Drivers of robots, and what is theirs to do: servo gravity compensation."""
