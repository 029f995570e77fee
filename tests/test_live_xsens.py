"""Xsens MVN: the packets of the protocol sheet, a person there and back, parts and persons."""

from __future__ import annotations

import math
import tracemalloc
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from xsens_packets import EXAMPLES, MOTIONS, PERSON, changed, only, parts_of, pose_datagram, values_of, with_values

from naoimitate.core.errors import DatagramError
from naoimitate.core.frames import LANDMARK
from naoimitate.live.protocols import mxtp
from naoimitate.live.protocols.mxtp import Header
from naoimitate.live.protocols.mxtp_com import AGE
from naoimitate.live.protocols.mxtp_parts import WAITING, Parts
from naoimitate.live.protocols.xsens import CHARACTERS, XSENS, XsensDecoder
from naoimitate.live.protocols.xsens_encoder import SCALING_EVERY
from naoimitate.motion.builtin import builtin_names, tpose

WHOLE = only(XSENS.decoder().feed(pose_datagram()))


# -- the example packets


def test_the_tracked_object_is_read_as_the_sheet_says():
    header, payload = mxtp.open_datagram(EXAMPLES["object"])
    assert header == Header(b"02", 1000, 0, True, 1, 16683, 1, 1, 0, 0)
    numbers, values = mxtp.read_poses(mxtp.pose_items(header, payload))
    assert numbers.tolist() == [1]
    assert values.tolist() == [[1.25, -0.5, 0.875, 0.5, 0.5, 0.5, 0.5]]


def test_a_tracked_object_is_no_person():
    assert XSENS.decoder().feed(EXAMPLES["object"]) == []


def test_a_prop_follows_the_body():
    header, _ = mxtp.open_datagram(EXAMPLES["prop"])
    numbers, values = values_of(EXAMPLES["prop"])
    assert (header.counter, header.milliseconds, header.body, header.props, header.fingers) == (1001, 16700, 2, 1, 0)
    assert numbers.tolist() == [1, 2, 24]
    root = float(np.float32(math.sqrt(0.5)))
    assert values.tolist() == [
        [0.0, 0.0, 0.96875, 1.0, 0.0, 0.0, 0.0],
        [0.0625, 0.0, 1.0625, root, 0.0, 0.0, root],
        [-0.5, 0.25, 1.5, 0.0, 1.0, 0.0, 0.0],
    ]


@pytest.mark.parametrize("order", [("part 0", "part 1"), ("part 1", "part 0")])
def test_the_split_example_joins_to_the_whole_one_in_either_order(order):
    parts, out = Parts(), []
    for name in order:
        header, payload = mxtp.open_datagram(EXAMPLES[name])
        out.append(parts.add(header, mxtp.pose_items(header, payload)))
    assert out[0] is None
    assert out[1] == mxtp.open_datagram(EXAMPLES["prop"])[1]


@pytest.mark.parametrize("form", ["com 12", "com 36"])
def test_both_forms_of_the_centre_of_mass_are_read(form):
    header, payload = mxtp.open_datagram(EXAMPLES[form])
    assert (header.kind, header.counter, header.milliseconds) == (b"24", 1005, 16767)
    assert mxtp.read_com(payload) == (0.015625, -0.03125, 0.984375)


def test_the_scaling_examples_are_read():
    origins = mxtp.read_scaling(mxtp.open_datagram(EXAMPLES["origins"])[1])
    points = mxtp.read_scaling(mxtp.open_datagram(EXAMPLES["points"])[1])
    assert origins == mxtp.Scaling({"Pelvis": (0.0, 0.0, 0.96875), "L5": (0.0, 0.0, 1.0625)}, {})
    assert points == mxtp.Scaling({}, {(1, "pHipOrigin"): (0.0, 0.0, 0.0), (1, "pSacrum"): (-0.125, 0.0, 0.0625)})
    assert mxtp.read_scaling(mxtp.open_datagram(EXAMPLES["origins"])[1][:-4]) == origins, (
        "the point list may be missing"
    )


def test_the_meta_data_name_the_character():
    decoder = XsensDecoder()
    assert decoder.feed(EXAMPLES["meta"]) == []
    assert decoder.names == {0: "Alice"}
    tags = mxtp.read_meta(mxtp.open_datagram(EXAMPLES["meta"])[1])
    assert tags == {"name": "Alice", "xmid": "00B40ABC", "color": "FF8000"}


@pytest.mark.parametrize("name", ["object", "prop", "part 0", "part 1", "com 12", "origins"])
def test_written_datagrams_are_the_examples_byte_for_byte(name):
    header, payload = mxtp.open_datagram(EXAMPLES[name])
    if header.kind == mxtp.POSE:
        payload = mxtp.write_poses(*mxtp.read_poses(payload))
    elif header.kind == mxtp.COM:
        payload = mxtp.write_com(np.array(mxtp.read_com(payload)))
    else:
        payload = mxtp.write_scaling(mxtp.read_scaling(payload))
    assert mxtp.make_datagram(header, payload) == EXAMPLES[name]


@pytest.mark.parametrize("name", ["01", "03", "05", "20", "21", "22", "23 short", "23 long", "25 text", "25 bare"])
def test_types_that_tell_nothing_new_pass_without_effect(name):
    decoder = XSENS.decoder()
    assert XSENS.recognises(EXAMPLES[name])
    assert decoder.feed(EXAMPLES[name]) == []
    assert len(decoder.feed(pose_datagram())) == 1


def test_an_unknown_type_is_skipped():
    assert XSENS.decoder().feed(b"MXTP99" + EXAMPLES["25 bare"][6:]) == []


# -- a person


@pytest.mark.parametrize("name", builtin_names())
def test_a_person_comes_back_within_a_tenth_of_a_millimetre(name):
    motion, encoder, decoder = MOTIONS[name], XSENS.encoder(), XSENS.decoder()
    for i in range(0, len(motion), max(1, len(motion) // 40)):
        sent = replace(motion[i], com=motion[i]["pelvis"] + [0.01, 0.02, 0.1])
        samples = [s for datagram in encoder.encode(sent, i, sent.time) for s in decoder.feed(datagram)]
        got = only(samples)
        assert samples[0].sequence == i and samples[0].person == 0
        assert got.time == pytest.approx(sent.time, abs=6e-4)
        np.testing.assert_allclose(got.landmarks, sent.landmarks, atol=1e-4)
        np.testing.assert_allclose(got.com, sent.com, atol=1e-5)
        assert np.abs(np.sum(got.orientations * sent.orientations, axis=1)).min() > 1.0 - 1e-6


def test_without_scaling_head_and_hands_come_by_proportions():
    got = only(XSENS.decoder().feed(pose_datagram()))
    np.testing.assert_allclose(got.landmarks, PERSON.landmarks, atol=1e-3)


def test_scaling_gives_the_hand_that_the_sender_has():
    landmarks = PERSON.landmarks.copy()
    for side in "lr":
        wrist, hand = landmarks[LANDMARK[f"{side}_wrist"]], landmarks[LANDMARK[f"{side}_hand"]]
        landmarks[LANDMARK[f"{side}_hand"]] = wrist + 2.0 * (hand - wrist)
    sent, decoder = replace(PERSON, landmarks=landmarks), XSENS.decoder()
    samples = [s for datagram in XSENS.encoder().encode(sent, 0, 0.0) for s in decoder.feed(datagram)]
    np.testing.assert_allclose(only(samples).landmarks, landmarks, atol=1e-4)


def test_a_person_without_orientations_can_be_sent():
    sent = replace(tpose(), orientations=None)
    got = only(XSENS.decoder().feed(pose_datagram(sent)))
    np.testing.assert_allclose(got.landmarks, sent.landmarks, atol=5e-3)
    assert np.abs(got.orientations[:, 0]).min() > 0.99, "a T-pose that faces x is identity"


def test_the_scaling_is_repeated_for_those_who_come_late():
    encoder = XSENS.encoder()
    kinds = [[d[4:6] for d in encoder.encode(PERSON, i, 0.0)] for i in (0, 1, SCALING_EVERY)]
    assert kinds == [[b"13", b"13", b"24", b"02"], [b"24", b"02"], [b"13", b"13", b"24", b"02"]]


def test_centimetres_are_recognised_in_any_posture():
    _, values = values_of(pose_datagram())
    lying = np.array([0.0, 0.0, -0.85])
    for shift in (np.zeros(3), lying, np.array([3.0, -4.0, 6.0])):
        moved = values.copy()
        moved[:, :3] = 100.0 * (moved[:, :3] + shift)
        got = only(XSENS.decoder().feed(with_values(pose_datagram(), moved)))
        np.testing.assert_allclose(got.landmarks, PERSON.landmarks + shift, atol=1e-3)


@pytest.mark.parametrize("name", ["walk", "bow-and-reach"])
def test_the_y_up_option_of_mvn_is_recognised(name):
    for i in range(0, len(MOTIONS[name]), 50):
        sent = MOTIONS[name][i]
        _, values = values_of(pose_datagram(sent))
        x, y, z, w, a, b, c = values.T
        turned = np.column_stack([x, z, -y, w, a, c, -b])
        got = only(XSENS.decoder().feed(with_values(pose_datagram(), turned)))
        np.testing.assert_allclose(got.landmarks, sent.landmarks, atol=1e-3)
        assert np.abs(np.sum(got.orientations * sent.orientations, axis=1)).min() > 1.0 - 1e-6


def test_old_headers_without_counts_and_size_are_read():
    datagram = pose_datagram()
    old = datagram[:17] + bytes(7) + datagram[24:]
    assert np.array_equal(only(XSENS.decoder().feed(old)).landmarks, only(XSENS.decoder().feed(datagram)).landmarks)


def test_props_and_fingers_change_nothing_of_the_body():
    header, payload = mxtp.open_datagram(pose_datagram())
    for props, fingers in ((1, 0), (4, 0), (0, 40), (3, 40)):
        extra = np.tile([9.0, 9.0, 9.0, 1.0, 0.0, 0.0, 0.0], (props + fingers, 1))
        more = header._replace(items=header.items + props + fingers, props=props, fingers=fingers)
        datagram = mxtp.make_datagram(more, payload + mxtp.write_poses(np.arange(24, 24 + props + fingers), extra))
        got = only(XSENS.decoder().feed(datagram))
        np.testing.assert_allclose(got.landmarks, PERSON.landmarks, atol=1e-3)
        assert (got.hand_opening is None) == (fingers == 0)


def test_bent_fingers_close_the_hand():
    header, payload = mxtp.open_datagram(pose_datagram())
    fingers = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (40, 1))
    for phalanx, bend in ((1, 0.5 * math.pi), (2, math.pi), (3, math.pi)):
        for finger in range(4):
            fingers[20 + 4 + 4 * finger + phalanx, 3:] = [math.cos(bend / 2), math.sin(bend / 2), 0.0, 0.0]
    full = header._replace(items=64, props=1, fingers=40)
    prop = np.array([[1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]])
    more = mxtp.write_poses(np.arange(24, 65), np.vstack([prop, fingers]))
    np.testing.assert_allclose(only(XSENS.decoder().feed(mxtp.make_datagram(full, payload + more))).hand_opening,
                               [1.0, 0.0], atol=1e-6)  # fmt: skip


def test_segments_are_known_by_their_numbers():
    header, payload = mxtp.open_datagram(pose_datagram())
    items = [payload[32 * i : 32 * i + 32] for i in range(23)]
    shuffled = mxtp.make_datagram(header, b"".join(items[::-1]))
    assert np.array_equal(only(XSENS.decoder().feed(shuffled)).landmarks, WHOLE.landmarks)
    upper = mxtp.make_datagram(header._replace(items=15, body=15), b"".join(items[:15]))
    got = only(XSENS.decoder().feed(upper))
    assert np.isnan(got["l_knee"]).all() and np.isfinite(got["l_wrist"]).all()


def test_signs_of_quaternions_go_on():
    decoder = XSENS.decoder()
    first = only(decoder.feed(pose_datagram()))
    _, values = values_of(pose_datagram())
    values[::2, 3:] *= -1.0
    second = only(decoder.feed(with_values(pose_datagram(), values)))
    np.testing.assert_allclose(second.orientations, first.orientations, atol=1e-6)


# -- the centre of mass


def test_the_centre_of_mass_of_the_same_sample_is_taken_as_it_is():
    decoder, (_, _, com, pose) = XSENS.decoder(), XSENS.encoder().encode(PERSON, 0, 0.0)
    assert decoder.feed(com) == []
    np.testing.assert_allclose(only(decoder.feed(pose)).com, PERSON.com, atol=1e-6)


def test_a_centre_of_mass_after_its_pose_is_carried_along_for_a_few_samples():
    decoder, encoder = XSENS.decoder(), XSENS.encoder()
    com, pose = encoder.encode(PERSON, 1, 0.0)
    assert only(decoder.feed(pose)).com is None
    decoder.feed(com)
    way = np.array([0.1, 0.2, 0.0])
    moved = replace(PERSON, landmarks=PERSON.landmarks + way, com=None)
    for ahead in range(1, AGE + 1):
        got = only(decoder.feed(encoder.encode(moved, 1 + ahead, 0.0)[-1]))
        np.testing.assert_allclose(got.com, PERSON.com + way, atol=1e-6)
    assert only(decoder.feed(encoder.encode(moved, 2 + AGE, 0.0)[-1])).com is None


@pytest.mark.parametrize("com", [[np.nan, 0, 0], [np.inf, 0, 1], [3e38, 0, 1], [2.0, 0.0, 0.9]])
def test_an_impossible_centre_of_mass_is_none(com):
    decoder = XSENS.decoder()
    with np.errstate(all="ignore"):
        com_datagram, pose = XSENS.encoder().encode(replace(PERSON, com=np.array(com)), 1, 0.0)
    decoder.feed(com_datagram)
    assert only(decoder.feed(pose)).com is None


def test_every_character_has_its_own_centre_of_mass():
    decoder, (com, pose) = XSENS.decoder(), XSENS.encoder().encode(PERSON, 1, 0.0)
    decoder.feed(changed(com, person=3))
    assert only(decoder.feed(pose)).com is None
    np.testing.assert_allclose(only(decoder.feed(changed(pose, person=3))).com, PERSON.com, atol=1e-6)


# -- parts, orders, persons, counters


@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_parts_in_any_order_and_twice_give_the_sample_once(order):
    parts, decoder = parts_of(pose_datagram(), (10, 9, 4)), XSENS.decoder()
    got = [s for i in order[:-1] for part in (parts[i], parts[i]) for s in decoder.feed(part)]
    assert got == []
    assert np.array_equal(only(decoder.feed(parts[order[-1]])).landmarks, WHOLE.landmarks)


def test_samples_whose_parts_mingle_are_both_found():
    decoder = XSENS.decoder()
    (a, b), (c, d) = (parts_of(pose_datagram(sequence=i), (12, 11)) for i in (7, 8))
    assert [[s.sequence for s in decoder.feed(part)] for part in (c, a, b, d)] == [[], [], [7], [8]]


def test_a_lost_part_loses_one_sample_only():
    decoder, seen = XSENS.decoder(), []
    for i in range(40):
        first, second = parts_of(pose_datagram(sequence=i), (12, 11))
        for part in (second,) if i % 3 == 0 else (first, second):
            seen += [s.sequence for s in decoder.feed(part)]
    assert seen == [i for i in range(40) if i % 3]


def test_parts_of_a_sender_that_starts_again_are_not_mixed():
    decoder = XSENS.decoder()
    old, _ = parts_of(pose_datagram(sequence=5, time=100.0), (12, 11))
    first, second = parts_of(pose_datagram(sequence=5, time=0.1), (12, 11))
    assert decoder.feed(old) == decoder.feed(second) == []
    assert only(decoder.feed(first)).time == pytest.approx(0.1)


def test_counters_may_jump_either_way_and_wrap():
    decoder = XSENS.decoder()
    for counter in (5, 4, 2**32 - 1, 0, 1000, 3):
        assert [s.sequence for s in decoder.feed(changed(pose_datagram(), counter=counter))] == [counter]
        first, second = parts_of(changed(pose_datagram(), counter=counter), (12, 11))
        assert decoder.feed(first) == []
        assert [s.sequence for s in decoder.feed(second)] == [counter]


def test_persons_on_one_port_are_told_apart():
    decoder, people = XSENS.decoder(), {n: MOTIONS["walk"][30 * n] for n in range(4)}
    parts = {n: parts_of(changed(pose_datagram(frame), person=n), (12, 11)) for n, frame in people.items()}
    for n in people:
        assert decoder.feed(parts[n][1]) == []
    for n, frame in people.items():
        samples = decoder.feed(parts[n][0])
        assert samples[0].person == n
        np.testing.assert_allclose(only(samples).landmarks, frame.landmarks, atol=1e-3)


def test_memory_is_bounded():
    decoder = XsensDecoder()
    tracemalloc.start()
    peaks = []
    for counter in range(6000):
        first, _ = parts_of(changed(pose_datagram(), counter=counter, person=counter % 256), (20, 3))
        assert decoder.feed(first) == []
        peaks.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert len(decoder._characters) == CHARACTERS
    assert all(len(c.parts._partials) <= WAITING for c in decoder._characters.values())
    assert max(peaks[3000:]) < max(peaks[:3000]) + 200_000


def test_a_sample_of_endless_parts_is_refused():
    decoder, datagram = XSENS.decoder(), pose_datagram()
    with pytest.raises(DatagramError, match="more than 255 segments"):
        for part in range(20):
            decoder.feed(changed(datagram, part=part, last=False))
    assert len(decoder.feed(datagram)) == 1
