"""A person in a skeleton whose names say nothing: two equal legs, two equal arms further up."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from naoimitate.core.frames import Array
from naoimitate.motion.clip import Skeleton
from naoimitate.motion.names import plain_names, side_and_word

SAME_LENGTH = 0.04
"""Left and right limb of a person differ by less than this share."""
LIMB_SHARE = 0.4
"""An arm is longer than this share of a leg; pairs of fingers and eyes are not."""


@dataclass(frozen=True)
class _Pair:
    """Two equal chains below one node. length: of one chain in file units."""

    branch: int
    chains: tuple[list[int], list[int]]
    length: float


def limbs_by_structure(skeleton: Skeleton) -> dict[str, int] | None:
    """Hip, knee, ankle, shoulder, elbow and wrist of both sides as nodes by landmark; None when there is no person."""
    pairs = sorted(_pairs(skeleton), key=lambda p: -p.length)
    for first, second in combinations(pairs, 2):
        if second.length < LIMB_SHARE * first.length or set(first.chains[0]) & set(second.chains[0]):
            continue
        legs, arms = _legs_and_arms(skeleton, first, second)
        found = _assigned(skeleton, legs, arms)
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


def _assigned(skeleton: Skeleton, legs: _Pair, arms: _Pair) -> dict[str, int] | None:
    leg = [_two_long_bones(skeleton, chain) for chain in legs.chains]
    arm = [_two_long_bones(skeleton, chain) for chain in arms.chains]
    if not all(leg) or not all(arm):
        return None
    left_leg, left_arm = (_left_one(skeleton, pair, legs, arms) for pair in (legs, arms))
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


def _left_one(skeleton: Skeleton, pair: _Pair, legs: _Pair, arms: _Pair) -> int | None:
    """0 or 1: which chain of a pair is the left one, by the side in its names, else by where the toes point."""
    plain = plain_names(skeleton.names)
    votes = [[side_and_word(plain[i])[0] for i in chain] for chain in pair.chains]
    score = [v.count("l") - v.count("r") for v in votes]
    if score[0] != score[1]:
        return int(np.argmax(score))
    rest = skeleton.rest
    up = rest[arms.branch] - rest[legs.branch]
    ahead = sum((rest[c[-1]] - rest[_two_long_bones(skeleton, c)[2]] for c in legs.chains), np.zeros(3))
    left = np.cross(up, ahead)
    across = rest[pair.chains[0][-1]] - rest[pair.chains[1][-1]]
    if np.linalg.norm(left) < 0.05 * np.linalg.norm(up) * np.linalg.norm(ahead) or abs(left @ across) < 1e-9:
        return None
    return 0 if left @ across > 0.0 else 1
