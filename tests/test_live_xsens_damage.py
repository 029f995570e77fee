"""Xsens MVN: damaged, hostile and foreign datagrams."""

from __future__ import annotations

import contextlib
import struct
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from xsens_packets import EXAMPLES, PERSON, changed, only, parts_of, pose_datagram, values_of, with_values

from naoimitate.core.errors import DatagramError
from naoimitate.core.frames import LANDMARK, SEGMENT
from naoimitate.live.protocols import mxtp
from naoimitate.live.protocols.xsens import XSENS, XsensDecoder


@pytest.mark.parametrize("name", list(EXAMPLES))
def test_anything_shorter_than_a_header_is_refused(name):
    for size in range(24):
        with pytest.raises(DatagramError):
            XSENS.decoder().feed(EXAMPLES[name][:size])


@pytest.mark.parametrize("name", list(EXAMPLES))
def test_a_datagram_that_is_cut_off_is_refused(name):
    for size in range(24, len(EXAMPLES[name])):
        with pytest.raises(DatagramError, match="look for loss"):
            XSENS.decoder().feed(EXAMPLES[name][:size])


def test_more_items_than_bytes_are_refused_with_and_without_a_payload_size():
    datagram = changed(pose_datagram(), items=24)
    for bad in (datagram, datagram[:22] + b"\0\0" + datagram[24:]):
        with pytest.raises(DatagramError, match="24 segments"):
            XSENS.decoder().feed(bad)


def test_a_payload_size_that_is_not_true_is_refused():
    datagram = pose_datagram()
    for size in (1, 735, 737, 65535):
        with pytest.raises(DatagramError, match=f"of {size} bytes"):
            XSENS.decoder().feed(datagram[:22] + struct.pack(">H", size) + datagram[24:])


@pytest.mark.parametrize("size", [-1, -(2**31), 39, 2**31 - 1])
def test_texts_of_impossible_length_are_refused(size):
    for name in ("meta", "origins"):
        at = 24 if name == "meta" else 28
        bad = EXAMPLES[name][:at] + struct.pack(">i", size) + EXAMPLES[name][at + 4 :]
        with pytest.raises(DatagramError):
            XSENS.decoder().feed(bad)


def test_other_protocols_are_no_xsens():
    for other in (b"", b"#bundle\0", b'{"version": "3,0"}', b"XTLP" + bytes(40), b"MXT"):
        assert not XSENS.recognises(other)
        with pytest.raises(DatagramError, match="no Xsens"):
            XSENS.decoder().feed(other)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 3e38, 1e6])
def test_impossible_positions_are_missing_landmarks(value):
    _, values = values_of(pose_datagram())
    values[mxtp.ROW["LeftForeArm"], 1] = value
    got = only(XSENS.decoder().feed(with_values(pose_datagram(), values)))
    assert np.isnan(got["l_elbow"]).all()
    others = [row for name, row in LANDMARK.items() if name != "l_elbow"]
    np.testing.assert_allclose(got.landmarks[others], PERSON.landmarks[others], atol=1e-3)


@pytest.mark.parametrize("turn", [[0, 0, 0, 0], [np.nan, 0, 0, 1], [3e38, 0, 0, 1], [0, np.inf, 0, 0], [5, 0, 0, 0]])
def test_impossible_turns_are_missing_orientations(turn):
    _, values = values_of(pose_datagram())
    values[mxtp.ROW["LeftFoot"], 3:] = turn
    got = only(XSENS.decoder().feed(with_values(pose_datagram(), values)))
    assert np.isnan(got.orientations[SEGMENT["l_foot"]]).all()
    assert np.isfinite(np.delete(got.orientations, SEGMENT["l_foot"], axis=0)).all()


def test_a_damaged_leg_does_not_change_the_unit():
    _, values = values_of(pose_datagram())
    values[mxtp.ROW["LeftLowerLeg"], 0] = 120.0
    got = only(XSENS.decoder().feed(with_values(pose_datagram(), values)))
    np.testing.assert_allclose(got["r_wrist"], PERSON["r_wrist"], atol=1e-3)


SEEDS = [*EXAMPLES.values(), *XSENS.encoder().encode(PERSON, 0, 0.0), *parts_of(pose_datagram(), (12, 11))]


def survives(decoder: XsensDecoder, datagram: bytes) -> None:
    """Whatever comes: good samples or a DatagramError; the good stream of another character goes on."""
    try:
        for sample in decoder.feed(datagram):
            finite = sample.frame.landmarks[np.isfinite(sample.frame.landmarks)]
            assert np.abs(finite).max(initial=0.0) <= 1001.0
            turns = sample.frame.orientations
            assert np.allclose(np.linalg.norm(turns[np.isfinite(turns).all(axis=1)], axis=1), 1.0)
            assert not np.isinf(sample.frame.landmarks).any()
    except DatagramError:
        pass
    got = only(decoder.feed(GOOD))
    np.testing.assert_allclose(got.landmarks, PERSON.landmarks, atol=1e-3)


GOOD = changed(pose_datagram(), person=200, counter=7)

FUZZED = XsensDecoder()

TYPED = st.builds(lambda a, b: b"MXTP" + a + b, st.sampled_from([b"02", b"12", b"13", b"24"]), st.binary(max_size=200))


@settings(max_examples=1500, deadline=None)
@given(st.binary(max_size=600) | TYPED)
def test_random_bytes_do_no_harm(data):
    survives(FUZZED, data)


@settings(max_examples=2500, deadline=None)
@given(st.sampled_from(SEEDS), st.lists(st.tuples(st.integers(0, 4000), st.integers(0, 255)), max_size=12),
       st.integers(0, 900), st.booleans())  # fmt: skip
def test_mutated_packets_do_no_harm(seed, changes, cut, sized):
    data = bytearray(seed)
    for at, value in changes:
        data[at % len(data)] = value
    if cut < len(data) // 2:
        del data[len(data) - cut :]
    if not sized and len(data) >= 24:
        data[22:24] = b"\0\0"
    survives(FUZZED, bytes(data))


def test_the_largest_datagrams_stay_small_in_memory():
    tracemalloc.start()
    for seed in (b"MXTP02", b"MXTP13", b"MXTP12"):
        datagram = seed + struct.pack(">IBBIBBBBHH", 1, 0x80, 255, 1, 0, 23, 0, 40, 0, 0) + b"\0\0\0\x01" * 16000
        with contextlib.suppress(DatagramError):
            XSENS.decoder().feed(datagram)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1_000_000


@pytest.mark.parametrize("lists", [(mxtp.LONGEST_LIST + 1, 0), (0, mxtp.LONGEST_LIST + 1)])
def test_a_scaling_longer_than_any_persons_is_refused(lists):
    origins, points = lists
    payload = struct.pack(">I", origins) + struct.pack(">i3f", 0, 0.0, 0.0, 0.0) * origins
    payload += struct.pack(">I", points) + struct.pack(">HHiI3f", 1, 1, 0, 0, 0.0, 0.0, 0.0) * points
    with pytest.raises(DatagramError, match="longer than any person's"):
        mxtp.read_scaling(payload)
