"""VMC: the example packets of shared/protocols.md byte for byte, round trips, and whatever may arrive."""

from __future__ import annotations

import contextlib
import math
import struct
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from naoimitate.core.errors import DatagramError
from naoimitate.core.frames import LANDMARK, SEGMENT, HumanFrame
from naoimitate.live.protocols import osc
from naoimitate.live.protocols.unity import from_world
from naoimitate.live.protocols.vmc import PATIENCE, VMC, VmcDecoder
from naoimitate.live.protocols.vmc_encoder import LARGEST
from naoimitate.motion.builtin import builtin_motion, builtin_names, tpose

MESSAGE, BUNDLE = (
    bytes.fromhex(line.split(": ")[1])
    for line in (Path(__file__).parent / "data/vmc_datagrams.txt").read_text().splitlines()
)
"""The worked examples of shared/protocols.md, section 3."""
ROOT_HALF = float(np.float32(math.sqrt(0.5)))
BONE, ROOT, TIME = "/VMC/Ext/Bone/Pos", "/VMC/Ext/Root/Pos", "/VMC/Ext/T"
STILL = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
MOTIONS = {name: builtin_motion(name) for name in builtin_names()}
PERSON = MOTIONS["paper"][200]


def encoded(frame: HumanFrame = PERSON, time: float = 0.5) -> list[bytes]:
    return VMC.encoder().encode(frame, 0, time)


def singles(frame: HumanFrame = PERSON, time: float = 0.5) -> list[bytes]:
    """The messages of a frame, each in a datagram of its own."""
    return [message for datagram in encoded(frame, time) for message in osc.messages(datagram)]


def fed(decoder: VmcDecoder, datagrams: list[bytes]) -> list[HumanFrame]:
    return [sample.frame for datagram in datagrams for sample in decoder.feed(datagram)]


def moved(by: float) -> HumanFrame:
    return replace(PERSON, landmarks=PERSON.landmarks + np.array([by, 0.0, 0.0]))


# -- the example packets


def test_the_bone_message_is_read_and_written_byte_for_byte():
    values = osc.arguments(MESSAGE, "sfffffff")
    assert osc.address_of(MESSAGE) == BONE
    assert values == ["LeftUpperArm", -0.125, 0.0, 0.0, 0.0, 0.0, ROOT_HALF, ROOT_HALF]
    assert osc.message(BONE, *values) == MESSAGE


def test_the_bundle_is_read_and_written_byte_for_byte():
    packed = osc.messages(BUNDLE)
    assert [osc.address_of(m) for m in packed] == [TIME, "/VMC/Ext/OK", ROOT, BONE, BONE]
    assert osc.arguments(packed[0], "f") == [12.5]
    assert osc.arguments(packed[1], "i") == [1]
    assert osc.arguments(packed[2], "sfffffff") == ["root", *STILL]
    assert osc.arguments(packed[3], "sfffffff") == ["Hips", 0.0, 0.9375, 0.25, 0.0, 0.0, 0.0, 1.0]
    assert packed[4] == MESSAGE
    assert osc.bundles(packed, LARGEST) == [BUNDLE]


def test_the_bundle_is_a_frame_of_its_time_in_our_axes():
    (sample,) = VMC.decoder().feed(BUNDLE)
    assert (sample.frame.time, sample.sequence, sample.person) == (12.5, None, 0)
    np.testing.assert_allclose(sample.frame["l_shoulder"], [0.25, 0.125, 0.9375])
    np.testing.assert_allclose(sample.frame.orientations[SEGMENT["pelvis"]], [1.0, 0.0, 0.0, 0.0])
    assert np.isnan(np.delete(sample.frame.landmarks, LANDMARK["l_shoulder"], axis=0)).all()


def test_a_turn_in_the_left_handed_world_is_mirrored_as_the_sheet_says():
    decoder = VMC.decoder()
    hand = osc.message(BONE, "LeftHand", 0.0, 0.0, 0.0, 0.0, 0.0, ROOT_HALF, ROOT_HALF)
    hips = osc.message(BONE, "Hips", *STILL)
    (frame,) = fed(decoder, osc.bundles([hips, hand], LARGEST))
    np.testing.assert_allclose(frame.orientations[SEGMENT["l_hand"]], [ROOT_HALF, -ROOT_HALF, 0.0, 0.0], atol=1e-7)


# -- a person


@pytest.mark.parametrize("name", builtin_names())
def test_a_person_comes_back_within_a_tenth_of_a_millimetre(name):
    motion, encoder, decoder = MOTIONS[name], VMC.encoder(), VMC.decoder()
    for i in range(0, len(motion), max(1, len(motion) // 40)):
        sent = motion[i]
        got = fed(decoder, encoder.encode(sent, i, sent.time))[-1]
        assert got.time == pytest.approx(sent.time, abs=1e-5)
        np.testing.assert_allclose(got.landmarks, sent.landmarks, atol=1e-4)
        assert np.abs(np.sum(got.orientations * sent.orientations, axis=1)).min() > 1.0 - 1e-6


def test_bundles_travel_in_one_piece():
    sizes = [len(datagram) for datagram in encoded(replace(PERSON, hand_opening=np.array([0.2, 0.7])))]
    assert max(sizes) <= LARGEST and len(sizes) > 1


def test_hands_open_and_close():
    sent = replace(PERSON, hand_opening=np.array([0.25, 1.0]))
    np.testing.assert_allclose(fed(VMC.decoder(), encoded(sent))[-1].hand_opening, [0.25, 1.0], atol=1e-3)


def test_a_person_without_orientations_can_be_sent():
    sent = replace(tpose(), orientations=None)
    got = fed(VMC.decoder(), encoded(sent))[-1]
    np.testing.assert_allclose(got.landmarks, sent.landmarks, atol=5e-3)
    assert np.abs(got.orientations[:, 0]).min() > 0.99


def test_the_root_carries_the_whole_person():
    place, half = np.array([1.0, 2.0, 0.5]), 0.5 * math.radians(30.0)
    turn = (0.0, math.sin(half), 0.0, math.cos(half))  # to the right about Unity's y
    packed = [m for m in singles() if osc.address_of(m) != ROOT]
    root = osc.message(ROOT, "root", *from_world(place).tolist(), *turn)
    got = fed(VMC.decoder(), osc.bundles([root, *packed], 60000))[-1]
    c, s = math.cos(2.0 * half), math.sin(2.0 * half)
    expected = PERSON.landmarks @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]).T + place
    np.testing.assert_allclose(got.landmarks, expected, atol=1e-5)


def test_root_messages_of_newer_senders_have_more_arguments():
    longer = osc.message(ROOT, "root", *STILL, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
    packed = [longer if osc.address_of(m) == ROOT else m for m in singles()]
    np.testing.assert_allclose(
        fed(VMC.decoder(), osc.bundles(packed, 60000))[-1].landmarks, PERSON.landmarks, atol=1e-4
    )


def test_missing_bones_are_skipped_and_ends_come_by_proportions():
    messages = [m for m in singles(tpose()) if not any(name in m for name in (b"Toes", b"MiddleProximal"))]
    (frame,) = fed(VMC.decoder(), osc.bundles(messages, 60000))
    np.testing.assert_allclose(frame.landmarks, tpose().landmarks, atol=1e-3)


def test_bones_that_do_not_come_again_keep_their_values():
    decoder = VMC.decoder()
    fed(decoder, encoded())
    only_hips = osc.bundles([m for m in singles() if b"Hips" in m], LARGEST)
    for _ in range(2):
        frames = fed(decoder, only_hips)
    np.testing.assert_allclose(frames[-1].landmarks, PERSON.landmarks, atol=1e-4)


# -- where a frame ends


def test_a_frame_in_one_bundle_is_given_with_the_bundle():
    decoder = VMC.decoder()
    for i in range(5):
        (frame,) = fed(decoder, osc.bundles(singles(moved(i), float(i)), 60000))
        assert frame.time == i
        np.testing.assert_allclose(frame.landmarks, moved(i).landmarks, atol=1e-4)


@pytest.mark.parametrize("largest", [300, 600, LARGEST])
def test_a_frame_split_over_bundles_is_given_whole_with_the_last_one(largest):
    decoder = VMC.decoder()
    fed(decoder, osc.bundles(singles(moved(0)), largest))
    for i in range(1, 5):
        split = osc.bundles(singles(moved(i), float(i)), largest)
        assert len(split) > 1
        assert fed(decoder, split[:-1]) == []
        (frame,) = fed(decoder, split[-1:])
        assert frame.time == i
        np.testing.assert_allclose(frame.landmarks, moved(i).landmarks, atol=1e-4)


@pytest.mark.parametrize("time_last", [False, True])
def test_single_messages_are_given_whole_with_the_last_bone(time_last):
    decoder, seen = VMC.decoder(), []
    for i in range(6):
        messages = singles(moved(i), float(i))
        seen.append(fed(decoder, messages[1:] + messages[:1] if time_last else messages))
    assert seen[0] == [] or time_last
    for i, frames in enumerate(seen[2:], start=2):
        np.testing.assert_allclose([f.landmarks for f in frames], [moved(i).landmarks], atol=1e-4)


def test_one_who_joins_in_the_middle_of_a_frame_gets_whole_frames():
    decoder, messages = VMC.decoder(), singles(moved(0))
    assert fed(decoder, messages[9:]) == []
    seen = [fed(decoder, singles(moved(i))) for i in range(1, 5)]
    for i, frames in enumerate(seen[1:], start=2):
        np.testing.assert_allclose(frames[-1].landmarks, moved(i).landmarks, atol=1e-4)


def test_lost_bundles_do_not_shift_what_comes_after():
    decoder = VMC.decoder()
    for i in range(30):
        split = osc.bundles(singles(moved(0.01 * i)), 600)
        frames = fed(decoder, [d for n, d in enumerate(split) if i % 4 or n != i // 4 % len(split)])
        if i % 4 > 1:
            (frame,) = frames
            np.testing.assert_allclose(frame.landmarks, moved(0.01 * i).landmarks, atol=1e-4)


def test_bones_that_stop_are_waited_for_only_a_few_frames():
    decoder = VMC.decoder()
    fed(decoder, osc.bundles(singles(), 60000))
    fewer = osc.bundles([m for m in singles() if b"Toes" not in m], 60000)
    counts = [len(fed(decoder, fewer)) for _ in range(PATIENCE + 4)]
    assert counts[0] == 0 and counts[-3:] == [1, 1, 1]


def test_other_messages_change_nothing():
    decoder = VMC.decoder()
    others = [
        osc.message("/VMC/Ext/Blend/Val", "Joy", 0.5),
        osc.message("/VMC/Ext/Blend/Apply"),
        osc.message("/VMC/Ext/Cam", "Camera", *STILL, 90.0),
        osc.message("/VMC/Ext/OK", 1, 3, 0, 1),
        osc.message("/somebody/else", 1),
        osc.message(BONE, "LastBone", *STILL),
        osc.message(BONE, "Jaw", *STILL),
    ]
    for other in others:
        assert decoder.feed(other) == []
    assert decoder.feed(osc.bundles(others, LARGEST)[0]) == []
    np.testing.assert_allclose(fed(decoder, encoded())[-1].landmarks, PERSON.landmarks, atol=1e-4)


# -- damaged datagrams


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 3e38, 1e6])
@pytest.mark.parametrize("at", [0, 5])
def test_impossible_bones_are_missing_landmarks_until_they_come_again(value, at):
    decoder = VMC.decoder()
    packed = [m for m in singles() if b"LeftLowerArm" not in m]
    numbers = list(STILL)
    numbers[at] = value
    bad = osc.message(BONE, "LeftLowerArm", *numbers)
    got = fed(decoder, osc.bundles([*packed, bad], 60000))[-1]
    for name in ("l_elbow", "l_wrist", "l_hand"):
        assert np.isnan(got[name]).all()
    np.testing.assert_allclose(got["r_wrist"], PERSON["r_wrist"], atol=1e-4)
    assert np.isfinite(got.orientations[SEGMENT["r_hand"]]).all()
    good = fed(decoder, osc.bundles(singles(), 60000))[-1]
    np.testing.assert_allclose(good.landmarks, PERSON.landmarks, atol=1e-4)


def test_a_time_that_is_no_number_is_nan():
    (frame,) = fed(VMC.decoder(), osc.bundles([osc.message(TIME, math.inf), *singles()[1:]], 60000))
    assert math.isnan(frame.time)


@pytest.mark.parametrize("example", [MESSAGE, BUNDLE])
def test_a_datagram_that_is_cut_off_is_refused(example):
    starts = {16}  # a bundle of nothing is no mistake
    at = 16
    while example is BUNDLE and at < len(BUNDLE):
        at += 4 + int.from_bytes(BUNDLE[at : at + 4], "big")
        starts.add(at)
    for size in set(range(len(example))) - (starts if example is BUNDLE else set()):
        with pytest.raises(DatagramError):
            VMC.decoder().feed(example[:size])


def test_a_bad_message_in_a_bundle_leaves_everything_as_it_was():
    decoder = VMC.decoder()
    fed(decoder, osc.bundles(singles(), 60000))
    before = dict(decoder._local)
    bad = osc.message(BONE, "Hips", 1.0, 2.0)
    with pytest.raises(DatagramError, match="has arguments"):
        decoder.feed(osc.bundles([*singles(moved(1.0)), bad], 60000)[0])
    assert decoder._local == before and not decoder._pending


@pytest.mark.parametrize("size", [0, -1, -8, -(2**31), 2**31 - 1, 21])
def test_impossible_sizes_in_a_bundle_are_refused(size):
    with pytest.raises(DatagramError, match="cut off"):
        VMC.decoder().feed(BUNDLE[:16] + struct.pack(">i", size) + BUNDLE[20:40])


def test_bundles_in_bundles_end_somewhere():
    packet = MESSAGE
    for depth in range(2500):
        packet = osc.BUNDLE + osc.IMMEDIATELY + struct.pack(">i", len(packet)) + packet
        if depth == 1:
            assert osc.messages(packet) == [MESSAGE]
    tracemalloc.start()
    with pytest.raises(DatagramError, match="nests"):
        VMC.decoder().feed(packet)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1_000_000


def test_the_largest_datagrams_stay_small_in_memory():
    tiny = struct.pack(">i", 8) + b"/a\0\0,\0\0\0"
    floods = [
        osc.BUNDLE + osc.IMMEDIATELY + tiny * 5000,
        b"/VMC/Ext/Bone/Pos\0\0\0,sfffffff" + b"f" * 60000 + bytes(4),
        b"/VMC/Ext/T\0\0,f" + b"[" * 60000 + bytes(6),
        b"/" * 65000,
    ]
    for flood in floods:
        tracemalloc.start()
        with contextlib.suppress(DatagramError):
            VMC.decoder().feed(flood)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 1_000_000


def test_other_protocols_are_no_vmc():
    for other in (b"", b"MXTP02" + bytes(18), b'{"version": 3}', b"#bundle", osc.message("/tracking/head", 1.0)):
        assert not VMC.recognises(other)
    assert VMC.recognises(MESSAGE) and VMC.recognises(BUNDLE)
    for other in (b"", b"MXTP02" + bytes(18), b'{"version": 3}'):
        with pytest.raises(DatagramError, match="no OSC"):
            VMC.decoder().feed(other)


FUZZED = VmcDecoder()
GOOD = osc.bundles(singles(), 60000)[0]


def survives(datagram: bytes) -> None:
    """Whatever comes: samples without infinities or a DatagramError; the good stream goes on."""
    try:
        for sample in FUZZED.feed(datagram):
            assert not np.isinf(sample.frame.landmarks).any()
            turns = sample.frame.orientations
            assert np.allclose(np.linalg.norm(turns[np.isfinite(turns).all(axis=1)], axis=1), 1.0, atol=1e-5)
    except DatagramError:
        pass
    for _ in range(PATIENCE + 1):
        frames = fed(FUZZED, [GOOD])
        if frames:
            break
    np.testing.assert_allclose(frames[-1].landmarks, PERSON.landmarks, atol=1e-4)


@settings(max_examples=1000, deadline=None)
@given(st.sampled_from([b"", b"/", b"#bundle\0", MESSAGE[:20], MESSAGE[:32]]), st.binary(max_size=300))
def test_random_bytes_do_no_harm(start, data):
    survives(start + data)


@settings(max_examples=2000, deadline=None)
@given(st.sampled_from([MESSAGE, BUNDLE, *singles()[:5]]),
       st.lists(st.tuples(st.integers(0, 2000), st.integers(0, 255)), max_size=10), st.integers(0, 600))  # fmt: skip
def test_mutated_packets_do_no_harm(seed, changes, cut):
    data = bytearray(seed)
    for at, value in changes:
        data[at % len(data)] = value
    if cut < len(data) // 2:
        del data[len(data) - cut :]
    survives(bytes(data))


def test_a_datagram_of_countless_messages_or_arguments_is_soon_read():
    bone = osc.message("/VMC/Ext/Bone/Pos", "Hips", *[0.1] * 6, 1.0)
    empty = osc.BUNDLE + osc.IMMEDIATELY
    for content in (bone, empty, b"/\0\0\0"):
        crowd = osc.bundles([content] * (osc.MESSAGES + 1), 65000)[0]
        with pytest.raises(DatagramError, match="more than 512 messages"):
            VMC.decoder().feed(crowd)
    more = osc.message("/VMC/Ext/Bone/Pos", "Hips", *[0.1] * 6, 1.0, *[1.0] * 10000)
    assert osc.arguments(more, "sfffffff") == osc.arguments(bone, "sfffffff")
