"""Lengths of a person's segments for a stature, and the outline of the sole.

Segment lengths as shares of the stature: R. Drillis and R. Contini, "Body segment parameters", 1966, as drawn in
D. Winter, "Biomechanics and Motor Control of Human Movement", figure 4.1. What that figure does not give is marked.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from naoimitate.core.frames import Array

DEFAULT_STATURE = 1.75
"""m; between the male (1.741) and female (1.735) groups of de Leva 1996 and today's young adults."""


@dataclass(frozen=True)
class Anthropometry:
    """Segment lengths of a person of the given stature, all in m.

    stature: height of the standing person, m, e.g. 1.75.
    """

    stature: float = DEFAULT_STATURE

    @property
    def thigh(self) -> float:
        """Hip to knee."""
        return 0.245 * self.stature

    @property
    def shank(self) -> float:
        """Knee to ankle."""
        return 0.246 * self.stature

    @property
    def ankle_height(self) -> float:
        """Ankle above the sole."""
        return 0.039 * self.stature

    @property
    def leg(self) -> float:
        """Hip to knee to ankle to sole, the limb length of design equation (4)."""
        return self.thigh + self.shank + self.ankle_height

    @property
    def upper_arm(self) -> float:
        """Shoulder to elbow."""
        return 0.186 * self.stature

    @property
    def forearm(self) -> float:
        """Elbow to wrist."""
        return 0.146 * self.stature

    @property
    def hand(self) -> float:
        """Wrist to the third knuckle: 0.45 of the hand's length (0.108 statures)."""
        return 0.45 * 0.108 * self.stature

    @property
    def hips(self) -> float:
        """Left to right hip joint: 0.72 of the 0.24 m between the iliac spines (Bell, Brand, Pedersen 1989)."""
        return 0.100 * self.stature

    @property
    def shoulders(self) -> float:
        """Left to right shoulder joint; the figure's 0.259 statures reach to the outside of the upper arms."""
        return 0.216 * self.stature

    @property
    def waist(self) -> float:
        """Mid-hip to the lumbar joint about which the chest bends (between L4 and L5, estimated)."""
        return 0.090 * self.stature

    @property
    def chest(self) -> float:
        """Lumbar joint to the chest landmark (half-way up the sternum, estimated)."""
        return 0.120 * self.stature

    @property
    def trunk(self) -> float:
        """Lumbar joint to mid-shoulder: shoulder height 0.818 less hip height 0.530 less the waist."""
        return 0.288 * self.stature - self.waist

    @property
    def neck(self) -> float:
        """Mid-shoulder to the head's centre, half-way between chin (0.870) and vertex."""
        return 0.117 * self.stature

    @property
    def foot(self) -> float:
        """Heel to toe tip."""
        return 0.152 * self.stature

    @property
    def heel(self) -> float:
        """Heel behind the ankle: a quarter of the foot (estimated)."""
        return 0.25 * self.foot

    @property
    def ball(self) -> float:
        """Ball of the foot (the toe landmark) in front of the ankle: 0.73 of the foot from the heel (estimated)."""
        return 0.73 * self.foot - self.heel

    @property
    def ball_height(self) -> float:
        """Toe landmark above the sole (estimated)."""
        return 0.011 * self.stature

    @property
    def sole(self) -> Array:
        """Outline of either sole, (N, 2) m, convex, counter-clockwise, x forward from below the ankle, y left.

        Widest at the ball (foot breadth 0.055 statures), 0.62 of it at the heel; toes and heel end in a chamfer.
        """
        half, heel, tip = 0.5 * 0.055 * self.stature, self.heel, self.foot - self.heel
        left = np.array([[-heel + 0.02, 0.62], [self.ball, 1.0], [tip - 0.02, 0.8], [tip, 0.3]])
        left = np.vstack([[-heel, 0.3], left]) * [1.0, half]
        return np.vstack([left * [1.0, -1.0], left[::-1]])

    def leg_reach(self, flexion: float) -> float:
        """Distance from hip to ankle with the knee flexed by ``flexion`` rad, m."""
        return float(np.sqrt(self.thigh**2 + self.shank**2 + 2.0 * self.thigh * self.shank * np.cos(flexion)))
