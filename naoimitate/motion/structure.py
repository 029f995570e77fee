"""A person in a skeleton whose names say nothing: two equal legs, two equal arms further up."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from naoimitate.core.frames import Array
from naoimitate.motion.clip import Skeleton
from naoimitate.motion.names import side_and_word

SAME_LENGTH = 0.04
"""Left and right limb of a person differ by less than this share."""
LIMBS = (("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist"))
"""Joints of a leg and of an arm, from the body outwards."""
LIMB_SHARE = 0.4
"""An arm is longer than this share of a leg; pairs of fingers and eyes are not."""


@dataclass(frozen=True)
class _Pair:
    """Two equal chains below one node. length: of one chain in file units."""

    branch: int
    chains: tuple[list[int], list[int]]
    length: float


def limbs_by_structure(skeleton: Skeleton, postures: Array) -> dict[str, int] | None:
    """Hip, knee, ankle, shoulder, elbow and wrist of both sides as nodes by landmark; None when there is no person.

    postures: (K, J, 3) of the recording, in which the toes tell what is in front.
    """
    pairs = sorted(_pairs(skeleton), key=lambda p: -p.length)
    for first, second in combinations(pairs, 2):
        if second.length < LIMB_SHARE * first.length or set(first.chains[0]) & set(second.chains[0]):
            continue
        legs, arms = _legs_and_arms(skeleton, first, second)
        found = _assigned(skeleton, postures, legs, arms)
        if found:
            return found
    return None


def _pairs(skeleton: Skeleton) -> list[_Pair]:
    """All pairs of equal chains that hang on one node."""
    lengths = np.linalg.norm(skeleton.offsets, axis=1)
    pairs = []
    for node in range(len(skeleton)):
        chains = [_longest_chain(skeleton, child, lengths) for child in skeleton.children(node)]
        for a, b in combinations(chains, 2):
            la, lb = float(lengths[a].sum()), float(lengths[b].sum())
            if len(a) == len(b) >= 3 and abs(la - lb) <= SAME_LENGTH * max(la, lb) and la > 0.0:
                pairs.append(_Pair(node, (a, b), la))
    return pairs


def _longest_chain(skeleton: Skeleton, node: int, lengths: Array) -> list[int]:
    """The longest way from a node down to an end."""
    reach = np.zeros(len(skeleton))
    for i in range(len(skeleton) - 1, node, -1):
        parent = skeleton.parents[i]
        if parent >= 0:
            reach[parent] = max(reach[parent], reach[i] + lengths[i])
    chain = [node]
    while children := skeleton.children(chain[-1]):
        chain.append(max(children, key=lambda i: reach[i] + lengths[i]))
    return chain


def _legs_and_arms(skeleton: Skeleton, first: _Pair, second: _Pair) -> tuple[_Pair, _Pair]:
    """The pair that hangs nearer to the root is the legs; on one node the longer one, which comes first."""
    return (second, first) if second.branch in skeleton.path(first.branch)[1:] else (first, second)


def _assigned(skeleton: Skeleton, postures: Array, legs: _Pair, arms: _Pair) -> dict[str, int] | None:
    leg = [_two_long_bones(skeleton, chain) for chain in legs.chains]
    arm = [_two_long_bones(skeleton, chain) for chain in arms.chains]
    if not all(leg) or not all(arm):
        return None
    left_leg, left_arm = (_left_one(skeleton, postures, pair, legs, arms) for pair in (legs, arms))
    if left_leg is None or left_arm is None:
        return None
    found: dict[str, int] = {}
    for names, limbs, left in (
        (("hip", "knee", "ankle"), leg, left_leg),
        (("shoulder", "elbow", "wrist"), arm, left_arm),
    ):
        for side, limb in (("l", limbs[left]), ("r", limbs[1 - left])):
            found.update({f"{side}_{name}": node for name, node in zip(names, limb, strict=True)})
    return found


def _two_long_bones(skeleton: Skeleton, chain: list[int]) -> list[int]:
    """The three joints of the two successive bones that are longest together; joints in one place count once."""
    lengths = np.linalg.norm(skeleton.offsets[chain], axis=1)
    apart = [
        node for node, length in zip(chain, lengths, strict=True) if length > 1e-3 * lengths.sum() or node == chain[0]
    ]
    if len(apart) < 3:
        return []
    bones = np.linalg.norm(skeleton.offsets[apart], axis=1)
    best = max(range(1, len(apart) - 1), key=lambda i: bones[i] + bones[i + 1])
    return apart[best - 1 : best + 2]


def _left_one(skeleton: Skeleton, postures: Array, pair: _Pair, legs: _Pair, arms: _Pair) -> int | None:
    """0 or 1: which chain of a pair is the left one, by the side in its names, else by where the toes point."""
    votes = [[side_and_word(skeleton.names[i])[0] for i in chain] for chain in pair.chains]
    score = [v.count("l") - v.count("r") for v in votes]
    if score[0] != score[1]:
        return int(np.argmax(score))
    ankles = [_two_long_bones(skeleton, chain)[2] for chain in legs.chains]
    up = postures[:, arms.branch] - postures[:, legs.branch]
    ahead = postures[:, [c[-1] for c in legs.chains]].sum(axis=1) - postures[:, ankles].sum(axis=1)
    across = postures[:, pair.chains[0][0]] - postures[:, pair.chains[1][0]]
    left = np.sum(np.cross(up, ahead) * across, axis=-1)
    sure = np.abs(left) > 0.1 * np.linalg.norm(up, axis=-1) * np.linalg.norm(ahead, axis=-1) * np.linalg.norm(
        across, axis=-1
    )
    if not sure.any():
        return None
    return 0 if np.median(left[sure]) > 0.0 else 1
