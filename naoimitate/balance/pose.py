"""A whole-body pose of the robot in the world, with what is derived from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Pose:
    """A whole-body pose of the robot in the world, with what is derived from it.

    q: (J,) rad. base_rot: (3, 3), base_pos: (3,) m. com: (3,) m, world. sole_pos: (2, 3) m, sole_rot: (2, 3, 3), world.
    link_pos, link_rot: link frames in the base frame, as ``kernel.forward`` fills them.
    """

    q: Array
    base_rot: Array
    base_pos: Array
    com: Array
    sole_pos: Array
    sole_rot: Array
    link_pos: Array
    link_rot: Array
