"""What joints are called: the vocabulary of motion files, and which side a name speaks of."""

from __future__ import annotations

import re

RIGS = ("mixamorig", "character", "cc_base", "bip", "valvebiped", "genesis", "armature", "skeleton")
"""Names of rigs that stand in front of a joint's own name, perhaps with a number; what a colon or bar ends goes too."""
SHORT_RIGS = ("def", "org", "jnt", "j", "b", "c")
"""The same, where a mark must follow."""
PARTS: dict[str, tuple[str, ...]] = {
    "hip": ("upleg", "upperleg", "thigh", "thighbend", "femur", "legupper", "uleg", "hip"),
    "knee": ("leg", "lowerleg", "lowleg", "loleg", "calf", "shin", "shinbend", "tibia", "leglower", "knee"),
    "ankle": ("foot", "ankle", "feet"),
    "toe": ("toebase", "toe", "toes", "toe0", "ball", "football", "foottoe", "forefoot", "metatarsals"),
    "shoulder": ("arm", "upperarm", "uparm", "uarm", "shldr", "shldrbend", "humerus", "armupper", "shoulder"),
    "elbow": ("forearm", "lowerarm", "lowarm", "loarm", "forearmbend", "radius", "armlower", "elbow"),
    "wrist": ("wrist", "hand", "palm"),
}
"""Sided landmarks and the words for their joints."""
HANDS = ("hand", "fingerbase")
"""Words for a hand of its own beyond the wrist."""
KNUCKLES = (
    "handmiddle1", "middle1", "mid1", "handmid1", "middle01", "middleproximal", "finger3proximal", "middlefinger1",
    "handmiddle", "finger2", "finger20",
)  # fmt: skip
"""Words for the knuckle of the middle finger."""
HEADS = ("head",)
"""Words for the joint about which the head turns."""
FILLERS = ("twist", "roll", "mesh", "share", "helper", "target", "nub", "endsite", "effector", "dummy", "muscle")
"""Parts of the names of joints that are none of the body's."""

_RIG = re.compile(
    rf"^(?:{'|'.join(RIGS)})[0-9]*[_\-. ]*(?=.)|^(?:{'|'.join(SHORT_RIGS)})[_\-.](?=.)",
    re.IGNORECASE,
)
_BARE = (
    "hipjoint", "femur", "tibia", "foot", "toes", "clavicle", "humerus", "radius", "wrist", "hand", "fingers", "thumb",
    "hip", "thigh", "shin", "knee", "ankle", "toe", "collar", "shoulder", "elbow", "upperarm", "forearm", "upleg",
    "leg", "arm",
)  # fmt: skip
"""Words before which a lower case l or r without any mark is a side (Acclaim's ``lfemur``)."""
_SIDED = tuple(
    re.compile(pattern, flags)
    for pattern, flags in (
        (r"^(?P<side>left|right)[_\-. ]*(?P<rest>.+)$", re.IGNORECASE),
        (r"^(?P<rest>.+?)[_\-. ]*(?P<side>left|right)$", re.IGNORECASE),
        (r"^(?P<side>[lr])[_\-. ]+(?P<rest>.+)$", re.IGNORECASE),
        (r"^(?P<rest>.+?)[_\-. ]+(?P<side>[lr])$", re.IGNORECASE),
        (r"^(?P<side>[lrLR])(?P<rest>[A-Z].*)$", 0),
        (r"^(?P<rest>.*[a-z0-9])(?P<side>[LR])$", 0),
        (rf"^(?P<side>[lr])(?P<rest>{'|'.join(_BARE)})$", 0),
    )
)


def side_and_word(name: str) -> tuple[str, str]:
    """Side (``l``, ``r`` or empty) and what is left of a joint's name, lower case letters and digits only.

    ``mixamorig:LeftUpLeg``, ``l_upleg``, ``lUpLeg``, ``L.UpLeg``, ``UpLeg_L`` and ``upleg.left`` give ("l", "upleg").
    """
    bare = _RIG.sub("", re.split(r"[:|]", name)[-1], count=1)
    for pattern in _SIDED:
        found = pattern.match(bare)
        if found:
            return found.group("side")[0].lower(), _letters(found.group("rest"))
    return "", _letters(bare)


def is_filler(word: str) -> bool:
    """Whether a word is that of a helper joint, which is no joint of the body."""
    return any(filler in word for filler in FILLERS)


def _letters(text: str) -> str:
    return re.sub(r"[^a-z0-9]", "", text.lower())
