"""What joints are called: the vocabulary of motion files, and which side a name speaks of."""

from __future__ import annotations

import os
import re

PREFIXES = ("mixamorig", "Character1", "CC_Base", "Bip001", "Bip01", "ValveBiped", "Genesis", "Armature", "Skeleton", "def", "org", "jnt", "j", "b", "c")  # fmt: skip
"""Names of rigs in front of every joint's own name; anything up to a colon or a bar goes as well."""
PARTS: dict[str, tuple[str, ...]] = {
    "hip": ("upleg", "upperleg", "upleg1", "thigh", "thighbend", "femur", "legupper", "uleg", "hip"),
    "knee": ("leg", "lowerleg", "lowleg", "calf", "shin", "shinbend", "tibia", "leglower", "lleg", "knee"),
    "ankle": ("foot", "ankle", "feet"),
    "toe": ("toebase", "toe", "toes", "toe0", "ball", "football", "foottoe", "forefoot", "metatarsals"),
    "collar": ("collar", "clavicle", "collarbone", "shoulder"),
    "shoulder": ("arm", "upperarm", "uparm", "uarm", "shldr", "shldrbend", "humerus", "armupper", "shoulder"),
    "elbow": ("forearm", "lowerarm", "lowarm", "loarm", "forearmbend", "radius", "armlower", "larm", "elbow"),
    "wrist": ("wrist", "hand", "palm"),
    "knuckle": (
        "fingerbase",
        "hand",
        "handmiddle1",
        "middle1",
        "mid1",
        "middleproximal",
        "finger3proximal",
        "middle01",
        "handmiddle",
        "middlefinger1",
        "finger2",
        "finger20",
        "handmid1",
    ),  # fmt: skip
}
"""Sided landmarks (collar and knuckle beside them) and the words for them, the plainest first."""
HANDS = ("hand", "fingerbase")
"""Words for a hand beyond the wrist."""
HEADS = ("head",)
"""Words for the joint about which the head turns."""
FILLERS = ("twist", "roll", "mesh", "share", "helper", "ik", "pole", "target", "nub", "endsite", "effector", "dummy", "muscle", "bone")  # fmt: skip
"""Words in the names of joints that are none of the body's."""


def plain_names(names: tuple[str, ...]) -> list[str]:
    """The names without their rig's: what is in front of a colon or bar, a known prefix, or one that all share."""
    bare = [re.split(r"[:|]", name)[-1] for name in names]
    shared = os.path.commonprefix(bare) if len(bare) > 3 else ""
    shared = shared[: max(shared.rfind(c) for c in "_-. ") + 1]
    bare = [name[len(shared) :] for name in bare]
    known = re.compile(
        rf"^(?:{'|'.join(PREFIXES[:9])})[0-9]*[_\-. ]*(?=.)|^(?:{'|'.join(PREFIXES[9:])})[_\-.](?=.)", re.I
    )
    return [known.sub("", name, count=1) or name for name in bare]


def side_and_word(name: str) -> tuple[str, str]:
    """Side (``l``, ``r`` or empty) and what is left of a plain name, lower case letters and digits only.

    ``LeftUpLeg``, ``l_upleg``, ``lUpLeg``, ``L.UpLeg``, ``UpLeg_L`` and ``upleg.left`` all give ("l", "upleg").
    """
    for pattern in _SIDED:
        found = pattern.match(name)
        if found:
            return found.group("side")[0].lower(), _letters(found.group("rest"))
    return "", _letters(name)


_SIDED = (
    re.compile(r"^(?P<side>left|right)[_\-. ]*(?P<rest>.+)$", re.I),
    re.compile(r"^(?P<rest>.+?)[_\-. ]*(?P<side>left|right)$", re.I),
    re.compile(r"^(?P<side>[lr])[_\-. ]+(?P<rest>.+)$", re.I),
    re.compile(r"^(?P<rest>.+?)[_\-. ]+(?P<side>[lr])$", re.I),
    re.compile(r"^(?P<side>[lrLR])(?P<rest>[A-Z].*)$"),
    re.compile(r"^(?P<rest>.*[a-z0-9])(?P<side>[LR])$"),
    re.compile(
        r"^(?P<side>[lr])(?P<rest>(?:hipjoint|femur|tibia|foot|toes|clavicle|humerus|radius|wrist|hand|fingers|thumb|hip|thigh|shin|knee|ankle|toe|collar|shoulder|elbow|upperarm|forearm|upleg|leg|arm))$"
    ),  # fmt: skip
)


def _letters(text: str) -> str:
    return re.sub(r"[^a-z0-9]", "", text.lower())


def is_filler(word: str) -> bool:
    """Whether a word is of a helper joint, which is no joint of the body."""
    return any(filler in word for filler in FILLERS) and word not in ("collarbone",)
