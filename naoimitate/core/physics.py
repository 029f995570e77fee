"""Constants of nature that several rooms need."""

from __future__ import annotations

GRAVITY = 9.81
"""m/s^2."""
