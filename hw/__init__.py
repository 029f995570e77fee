"""Drivers of robots, the guard that stands before each of them, and what is theirs to do: servo compensation."""
