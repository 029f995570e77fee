"""Which joints of a skeleton are a person's landmarks: by names that the hierarchy confirms, else by it alone."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import SIDES
from naoimitate.motion.clip import Clip, Skeleton
from naoimitate.motion.families import family_of
from naoimitate.motion.names import HANDS, HEADS, KNUCKLES, PARTS, is_filler, side_and_word
from naoimitate.motion.structure import LIMBS, limbs_by_structure

BONE_RATIO = 3.5
"""The two bones of one limb differ by less than this factor (people: 1.0 and 1.3; CMU's skeletons up to 2.3)."""
POSTURES = 50
"""So many postures of a recording are enough to tell left from right."""
SHORT = 0.02
"""Bones below this share of a leg have no direction."""
EXTREMITY = 0.5
"""Legs beyond which no knuckle and no ball is from its wrist or ankle: helpers of a rig hang there."""
TOES = 0.25
"""What is beyond the ball of a foot by more than this share of a leg is no toe (CMU's skeletons: 0.08)."""


@dataclass(frozen=True)
class Anatomy:
    """Where a person's landmarks are in a skeleton.

    family: what the skeleton is, for people. nodes: landmark to node, for shoulders, elbows, wrists, hips, knees and
    ankles always, for hands and toes where the skeleton has them. pelvis, chest: nodes from which legs and arms part
    (the same one when there is no spine). head: the joint about which the head turns. head_end: the end of its bone.
    palms: (left, right) joints that turn the hands. tips: (left, right) ends of the toes beyond their joints, or None.
    """

    family: str
    nodes: dict[str, int]
    pelvis: int
    chest: int
    head: int | None
    head_end: int | None
    palms: tuple[int, int]
    tips: tuple[int | None, int | None]


def recognise(clip: Clip) -> Anatomy:
    """Find the landmarks of a recording's skeleton.

    Raises MotionFormatError, which names the first landmark that is missing, when it is no person with arms and legs.
    """
    skeleton = clip.skeleton
    words = _words(skeleton)
    family = family_of(skeleton)
    nodes: dict[str, int] | None = {}
    missing = ""
    for limb in LIMBS:
        for side in SIDES:
            chain = _chain(skeleton, words, side, limb)
            if isinstance(chain, str):
                missing = missing or chain
            elif nodes is not None:
                nodes.update({f"{side}_{part}": node for part, node in zip(limb, chain, strict=True)})
    if missing:
        nodes = limbs_by_structure(skeleton, clip.positions[:: max(1, len(clip) // POSTURES)])
        family = family or "a skeleton of unknown names, recognised by its two arms and two legs"
    if nodes is None:
        raise MotionFormatError(f"no {missing} was found in the skeleton: export a whole body with common joint names")
    chest = _junction(skeleton, nodes["l_shoulder"], nodes["r_shoulder"])
    pelvis = _junction(skeleton, nodes["l_hip"], nodes["r_hip"])
    for side in SIDES:
        nodes.update(_extremities(skeleton, words, side, nodes))
    head, head_end = _head(skeleton, words, nodes, chest)
    palms = _palm(words, nodes, "l"), _palm(words, nodes, "r")
    tips = _toe_tip(skeleton, nodes, "l"), _toe_tip(skeleton, nodes, "r")
    return Anatomy(family or "common joint names", nodes, pelvis, chest, head, head_end, palms, tips)


def _words(skeleton: Skeleton) -> list[tuple[str, str]]:
    """Side and word of every joint's name; ends and helper joints have none."""
    words = [side_and_word(name) for name in skeleton.names]
    return [("", "") if end or is_filler(w[1]) else w for w, end in zip(words, skeleton.ends, strict=True)]


def _chain(skeleton: Skeleton, words: list[tuple[str, str]], side: str, limb: tuple[str, ...]) -> tuple[int, ...] | str:
    """The joints of a limb: each above the next, as few joints between them as possible; or what is missing.

    So ``LeftShoulder`` is the shoulder joint only where nothing nearer to the elbow is called an arm.
    """
    candidates = [[i for i, w in enumerate(words) if w[0] == side and w[1] in PARTS[part]] for part in limb]
    if not candidates[2]:
        candidates[2] = [e for i in candidates[1] for e in skeleton.children(i) if skeleton.ends[e]]
    for part, found in zip(limb, candidates, strict=True):
        if not found:
            return f"{'left' if side == 'l' else 'right'} {part}"
    chains = [c for c in product(*candidates) if _is_limb(skeleton, c)]
    if not chains:
        return f"{'left' if side == 'l' else 'right'} {'leg' if limb == LIMBS[0] else 'arm'}"
    return min(chains, key=lambda c: len(skeleton.path(c[2])) - len(skeleton.path(c[0])))


def _is_limb(skeleton: Skeleton, chain: tuple[int, ...]) -> bool:
    """Whether each joint is above the next, with two bones of about the same length between them."""
    upper, lower = (bone_length(skeleton, a, b) for a, b in pairwise(chain))
    return min(upper, lower) > 0.0 and max(upper, lower) < BONE_RATIO * min(upper, lower)


def bone_length(skeleton: Skeleton, above: int, below: int) -> float:
    """Length in the rest pose from a joint to one below it, file units; 0 when it is not below."""
    if above == below or above not in skeleton.path(below):
        return 0.0
    rest = skeleton.rest
    return float(np.linalg.norm(rest[below] - rest[above]))


def leg_length(skeleton: Skeleton, nodes: dict[str, int]) -> float:
    """Thigh and shank, mean of both sides, file units."""
    return 0.5 * sum(
        bone_length(skeleton, nodes[f"{s}_{a}"], nodes[f"{s}_{b}"])
        for s in SIDES
        for a, b in (("hip", "knee"), ("knee", "ankle"))
    )


def _junction(skeleton: Skeleton, a: int, b: int) -> int:
    """The lowest joint above both."""
    return next((i for i in skeleton.path(a) if i in skeleton.path(b)), 0)


def _extremities(skeleton: Skeleton, words: list[tuple[str, str]], side: str, nodes: dict[str, int]) -> dict[str, int]:
    """Hand (knuckle) and toe (ball) of one side: named joints below wrist and ankle, else the ends of their bones."""
    found = {}
    for vocabulary, name, above in ((HANDS + KNUCKLES, "hand", "wrist"), (PARTS["toe"], "toe", "ankle")):
        start = nodes[f"{side}_{above}"]
        leg = leg_length(skeleton, nodes)
        far = {i: bone_length(skeleton, start, i) for i in skeleton.below(start)}
        below = [i for i, distance in far.items() if SHORT * leg < distance < EXTREMITY * leg]
        named = [i for i in below if words[i][0] in (side, "") and words[i][1] in vocabulary]
        ends = [i for i in below if skeleton.ends[i] and _only_way(skeleton, start, i)]
        choice = named or ends
        if choice:
            depth = {i: len(skeleton.path(i)) for i in choice}
            nearest = min(depth.values())
            found[f"{side}_{name}"] = max((i for i in choice if depth[i] == nearest), key=far.__getitem__)
        elif inner := [i for i in skeleton.children(start) if i in below]:
            found[f"{side}_{name}"] = _middle_one(skeleton, inner)
    return found


def _toe_tip(skeleton: Skeleton, nodes: dict[str, int], side: str) -> int | None:
    """The farthest point beyond the ball of one foot; None where the skeleton ends there or has no toes."""
    toe = nodes.get(f"{side}_toe")
    if toe is None:
        return None
    leg = leg_length(skeleton, nodes)
    beyond = {i: bone_length(skeleton, toe, i) for i in skeleton.below(toe)}
    toes = [i for i, far in beyond.items() if SHORT * leg < far < TOES * leg]
    return max(toes, key=beyond.__getitem__, default=None)


def _middle_one(skeleton: Skeleton, nodes: list[int]) -> int:
    """Of joints that spread like fingers, the one in the middle."""
    offsets = skeleton.offsets[nodes]
    return nodes[int(np.argmin(np.linalg.norm(offsets - offsets.mean(axis=0), axis=1)))]


def _palm(words: list[tuple[str, str]], nodes: dict[str, int], side: str) -> int:
    """The joint that turns the hand: the wrist, or a hand of its own beyond it (CMU's wrists turn the forearm)."""
    hand = nodes.get(f"{side}_hand")
    return hand if hand is not None and words[hand][1] in HANDS else nodes[f"{side}_wrist"]


def _only_way(skeleton: Skeleton, start: int, end: int) -> bool:
    """Whether an end belongs to the bone itself: nothing but joints in one place lie between."""
    between = skeleton.path(end)[1:]
    between = between[: between.index(start)]
    return all(
        np.linalg.norm(skeleton.offsets[i]) < 1e-6 + 1e-3 * np.linalg.norm(skeleton.offsets[end]) for i in between
    )


def _head(
    skeleton: Skeleton, words: list[tuple[str, str]], nodes: dict[str, int], chest: int
) -> tuple[int | None, int | None]:
    """The head's joint and the end of its bone; without a name, the last joint of the chain between the arms."""
    named = [i for word in HEADS for i, w in enumerate(words) if w == ("", word)]
    if named:
        head = named[0]
    else:
        arms = {i for s in SIDES for i in skeleton.path(nodes[f"{s}_shoulder"])}
        chain = [i for i in skeleton.below(chest) if not arms & set(skeleton.path(i)[: -len(skeleton.path(chest))])]
        joints = [i for i in chain if not skeleton.ends[i] and chest in skeleton.path(i)[1:]]
        if not joints or chest == _junction(skeleton, nodes["l_hip"], nodes["r_hip"]):
            return None, None
        head = max(joints, key=lambda i: len(skeleton.path(i)))
    rest = skeleton.rest
    ends = [i for i in skeleton.children(head) if skeleton.ends[i] or "end" in words[i][1] or "top" in words[i][1]]
    return head, max(ends, key=lambda i: float(np.linalg.norm(rest[i] - rest[head])), default=None)
