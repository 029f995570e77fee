"""What a reader hands over: a skeleton with its joints' paths and rotations, in the file's own unit and axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from naoimitate.core.frames import Array

Indices = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Skeleton:
    """A tree of joints and end points; in its rest pose no joint is turned against the file's axes.

    names: of the J nodes, parents before children. parents: (J,), -1 for a root. offsets: (J, 3) in file units, from
    the parent in the rest pose. ends: (J,) bool, the node is the end of a bone and has no rotation of its own.
    """

    names: tuple[str, ...]
    parents: Indices
    offsets: Array
    ends: npt.NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.names)

    @property
    def rest(self) -> Array:
        """Positions (J, 3) of the nodes in the rest pose, the root at its own offset, file units."""
        positions = self.offsets.copy()
        for i, parent in enumerate(self.parents):
            if parent >= 0:
                positions[i] += positions[parent]
        return positions

    def children(self, node: int) -> list[int]:
        """Nodes whose parent is ``node``."""
        return [int(i) for i in np.flatnonzero(self.parents == node)]

    def path(self, node: int) -> list[int]:
        """The node and all nodes above it, upwards to the root."""
        path = [node]
        while self.parents[path[-1]] >= 0:
            path.append(int(self.parents[path[-1]]))
        return path

    def below(self, node: int) -> list[int]:
        """The node and all nodes below it."""
        inside = {node}
        for i, parent in enumerate(self.parents):
            if int(parent) in inside:
                inside.add(i)
        return sorted(inside)


@dataclass(frozen=True)
class Posture:
    """One moment of a skeleton: positions (J, 3) in file units, rotations (J, 3, 3) world from joint."""

    positions: Array
    rotations: Array


@dataclass(frozen=True)
class Clip:
    """A recording as its file says it.

    format: for people, e.g. ``BVH``. positions: (T, J, 3) in file units and axes. rotations: (T, J, 3, 3), identity in
    the skeleton's rest pose. rate: Hz, or None where the format has none. time: (T,) s, where frames carry their own.
    unit: metres per file unit and up: ``y`` or ``z``, where the format says so. tpose: a calibration posture of the
    file that is not part of the motion. contacts: (T, 2) bool, left and right foot planted. com: (T, 3) in file units.
    notes: what the reader repaired, a sentence each.
    """

    format: str
    skeleton: Skeleton
    positions: Array
    rotations: Array
    rate: float | None = None
    time: Array | None = None
    unit: float | None = None
    up: str | None = None
    tpose: Posture | None = None
    contacts: npt.NDArray[np.bool_] | None = None
    com: Array | None = None
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.positions)

    def posture(self, frame: int) -> Posture:
        """The skeleton as it is in one frame."""
        return Posture(self.positions[frame], self.rotations[frame])

    @property
    def rest(self) -> Posture:
        """The skeleton's rest pose."""
        return Posture(self.skeleton.rest, np.tile(np.eye(3), (len(self.skeleton), 1, 1)))


def forward(
    skeleton: Skeleton, root: Array, local: Array, moving: dict[int, Array] | None = None
) -> tuple[Array, Array]:
    """Forward kinematics of whole clips.

    root: (T, 3) position of the root. local: (T, J, 3, 3) rotation of every node against its parent (identity for
    ends). moving: places (T, 3) in their parents of nodes that have no fixed offset. Returns positions (T, J, 3) and
    rotations (T, J, 3, 3) in the world.
    """
    positions, rotations = np.empty((*local.shape[:2], 3)), np.empty_like(local)
    with np.errstate(over="ignore", invalid="ignore"):
        for i, parent in enumerate(skeleton.parents):
            if parent < 0:
                positions[:, i], rotations[:, i] = root, local[:, i]
            else:
                place = (moving or {}).get(i, skeleton.offsets[i])
                positions[:, i] = positions[:, parent] + (rotations[:, parent] @ place[..., None])[..., 0]
                rotations[:, i] = rotations[:, parent] @ local[:, i]
    return positions, rotations
