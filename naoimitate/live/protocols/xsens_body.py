"""Where a person's landmarks and segments are among those of Xsens."""

from __future__ import annotations

from naoimitate.core.frames import SIDES
from naoimitate.live.protocols.mxtp import ROW
from naoimitate.motion.mvnx import ENDS

SIDE = {"l": "Left", "r": "Right"}
_JOINTS = {"shoulder": "UpperArm", "elbow": "ForeArm", "wrist": "Hand", "hand": "Hand",
           "hip": "UpperLeg", "knee": "LowerLeg", "ankle": "Foot", "toe": "Toe"}  # fmt: skip
JOINT_OF = {"pelvis": "Pelvis", "chest": "T8", "head": "Head",
            **{f"{s}_{joint}": SIDE[s] + name for s in SIDES for joint, name in _JOINTS.items()}}  # fmt: skip
"""The segment at whose origin a landmark is, or from whose origin it is placed (head, hands)."""
SEGMENT_OF = {"pelvis": "Pelvis", "chest": "T8", "head": "Head",
              **{f"{s}_{part.lower()}": SIDE[s] + part for s in SIDES for part in ("Hand", "Foot")}}  # fmt: skip
"""The segment that turns one of ours; a T-pose is identity on both sides."""
POINT_OF = {name: (ROW[JOINT_OF[name]] + 1, ENDS[JOINT_OF[name]]) for name in ("head", "l_hand", "r_hand")}
"""The bony point of MXTP13 beyond the joint of a landmark, as in MVNX files: number of its segment, its name."""
POINT_SHARE = {"head": 0.5, "l_hand": 1.0, "r_hand": 1.0}
"""Where on the way to that point the landmark is: the head's centre is halfway to its top."""
