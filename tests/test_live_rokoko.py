"""Rokoko Studio's datagrams: the examples of its format, round trips of whole motions, and hostile ones."""

from __future__ import annotations

import hashlib
import json
from typing import Any

import lz4.block
import lz4.frame
import numpy as np
import pytest
from hostile import MEGABYTE, peak_memory, spoiled, texts
from hypothesis import given, settings
from hypothesis import strategies as st

from naoimitate.core.errors import DatagramError
from naoimitate.core.frames import LANDMARK, HumanFrame
from naoimitate.live.protocols.lz4_frame import unpack
from naoimitate.live.protocols.rokoko import ROKOKO, RokokoDecoder
from naoimitate.live.protocols.rokoko_encoder import RokokoEncoder
from naoimitate.live.sample import LARGEST, Sample
from naoimitate.motion.builtin import builtin_motion, tpose

EXAMPLE = (
    b'{"version":"3,0","fps":60.0,"scene":{"timestamp":1.25,"actors":[{"name":"Ada","color":[255,128,0],"meta":'
    b'{"hasGloves":false,"hasLeftGlove":false,"hasRightGlove":false,"hasBody":true,"hasFace":false},"dimensions":'
    b'{"totalHeight":1.75,"hipHeight":0.9375},"body":{"hip":{"position":{"x":0.125,"y":0.9375,"z":-0.25},"rotation":'
    b'{"x":0,"y":0.5,"z":0,"w":0.8660254}}}}],"props":[{"name":"cam","color":[0,0,255],"type":1,"position":'
    b'{"x":0,"y":1.5,"z":2},"rotation":{"x":0,"y":1,"z":0,"w":0}}]}}'
)
STORED = bytes.fromhex("04224d18604082e5010080") + EXAMPLE + bytes(4)
PACKED = bytes.fromhex(
    "04224d186040825f010000f06d7b2276657273696f6e223a22332c30222c22667073223a36302e302c227363656e65223a7b2274696d6573"
    "74616d70223a312e32352c226163746f7273223a5b7b226e616d65223a22416461222c22636f6c6f72223a5b3235352c3132382c305d2c22"
    "6d657461223a7b22686173476c6f766573223a66616c73652c1200414c65667416000815004e52696768160092426f6479223a7472753a00"
    "344661633500807d2c2264696d656ec8001173b000606f74616c4865470000b2007437352c226869701100a1302e393337357d2c22625200"
    "107b1c0000070051706f7369740b01307b227827001031eb0010790a00003100902c227a223a2d302e323b0048726f74612c000328000225"
    "0040302c22773600f002383636303235347d7d7d7d5d2c2270726f5b010633013763616d3301fd03302c302c3235355d2c2274797065223a"
    "312c9100016500133165001f3286000518318400507d7d5d7d7d00000000"
)
QUICK = settings(max_examples=1500, deadline=None)


def example(**changes: Any) -> dict[str, Any]:
    return {**json.loads(EXAMPLE), **changes}


def feed(frame: Any) -> Sample:
    (sample,) = RokokoDecoder().feed(json.dumps(frame).encode())
    return sample


def angles(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles between quaternions, deg."""
    return np.degrees(2.0 * np.arccos(np.clip(np.abs(np.sum(a * b, axis=-1)), 0.0, 1.0)))


@pytest.mark.parametrize("datagram", [EXAMPLE, STORED, PACKED], ids=["plain", "stored", "packed"])
def test_the_example_is_one_person_with_a_hip(datagram: bytes) -> None:
    (sample,) = RokokoDecoder().feed(datagram)
    assert sample.sequence is None and sample.person == 0 and sample.frame.time == 1.25
    assert sample.frame["pelvis"] == pytest.approx([-0.25, -0.125, 0.9375], abs=1e-12)
    others = np.delete(sample.frame.landmarks, LANDMARK["pelvis"], axis=0)
    assert np.isnan(others).all()
    assert ROKOKO.recognises(datagram)


def test_the_examples_are_the_published_bytes() -> None:
    assert hashlib.sha256(EXAMPLE).hexdigest() == "9ce509c4d5bd02c97bb4cff1cf74847140946da89575468ced94011b8f017a93"
    assert hashlib.sha256(STORED).hexdigest() == "aaec7b9a0f721a220611d947648700a7d3dd407111f8477280320bd628e37709"
    assert len(PACKED) == 366
    assert unpack(STORED, LARGEST) == unpack(PACKED, LARGEST) == EXAMPLE


@pytest.mark.parametrize("packed", [True, False])
@pytest.mark.parametrize("name", ["paper", "walk", "wave"])
def test_a_motion_survives_the_wire(name: str, packed: bool) -> None:
    encoder, decoder = RokokoEncoder(packed), RokokoDecoder()
    for i, frame in enumerate(list(builtin_motion(name))[::20]):
        (datagram,) = encoder.encode(frame, i, i / 5.0)
        (sample,) = decoder.feed(datagram)
        assert np.abs(sample.frame.landmarks - frame.landmarks).max() < 1e-3
        assert sample.frame.time == pytest.approx(i / 5.0)


def test_orientations_come_once_a_tpose_was_held() -> None:
    encoder, decoder = RokokoEncoder(), RokokoDecoder()
    early = decoder.feed(encoder.encode(tpose(), 0, 0.0)[0])[0].frame
    assert early.orientations is None
    for i in range(1, 80):
        held = decoder.feed(encoder.encode(tpose(), i, i / 100.0)[0])[0].frame
    assert held.orientations is not None
    assert angles(held.orientations, tpose().orientations).max() < 0.1
    for i, frame in enumerate(list(builtin_motion("paper"))[::20]):
        seen = decoder.feed(encoder.encode(frame, 80 + i, 1.0 + i)[0])[0].frame
        assert angles(seen.orientations, frame.orientations).max() < 0.1


def test_a_tpose_that_faces_elsewhere_gives_the_heading() -> None:
    encoder, decoder = RokokoEncoder(), RokokoDecoder()
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    aside = HumanFrame(0.0, tpose().landmarks @ turn.T, np.tile([1.0, 0.0, 0.0, 0.0], (7, 1)))
    for i in range(80):
        seen = decoder.feed(encoder.encode(aside, i, i / 100.0)[0])[0].frame
    w, x, y, z = tpose().orientations.T
    assert angles(seen.orientations, np.sqrt(0.5) * np.stack([w - z, x - y, y + x, z + w], axis=-1)).max() < 0.1


@pytest.mark.parametrize("opening", [[1.0, 0.0], [0.3, 0.8], [np.nan, 0.5]])
def test_fingers_tell_how_open_gloved_hands_are(opening: list[float]) -> None:
    frame = HumanFrame(0.0, tpose().landmarks, tpose().orientations, hand_opening=np.array(opening))
    seen = RokokoDecoder().feed(RokokoEncoder().encode(frame, 0, 0.0)[0])[0].frame
    assert seen.hand_opening == pytest.approx(opening, abs=0.01, nan_ok=True)


def test_centimetres_are_told_by_the_height_of_the_hip() -> None:
    frame = example()
    actor = frame["scene"]["actors"][0]
    actor["dimensions"] = {"totalHeight": 175.0, "hipHeight": 93.75}
    actor["body"]["hip"]["position"] = {"x": 12.5, "y": 93.75, "z": -25.0}
    assert feed(frame).frame["pelvis"] == pytest.approx([-0.25, -0.125, 0.9375])


def persons(decoder: RokokoDecoder, *names: str) -> list[int]:
    frame = example()
    actor = frame["scene"]["actors"][0]
    frame["scene"]["actors"] = [{**actor, "name": name} for name in names]
    return [sample.person for sample in decoder.feed(json.dumps(frame).encode())]


def test_actors_keep_their_numbers_when_others_come_and_go() -> None:
    decoder = RokokoDecoder()
    assert persons(decoder, "Ada", "Bob", "Cid") == [0, 1, 2]
    assert persons(decoder, "Bob", "Cid") == [1, 2]
    assert persons(decoder, "Eve", "Cid", "Ada") == [3, 2, 0]
    assert persons(decoder, "Bob", "Bob") == [1, 4]


def test_of_too_many_names_the_longest_unseen_is_forgotten() -> None:
    decoder = RokokoDecoder()
    persons(decoder, "Ada")
    for i in range(1000):
        assert max(persons(decoder, f"Bob {i}", "Ada")) < 32
        assert persons(decoder, "Ada") == [0]


def test_an_actor_without_a_body_is_left_out() -> None:
    frame = example()
    frame["scene"]["actors"].insert(0, {"name": "glove", "body": None})
    assert [sample.person for sample in RokokoDecoder().feed(json.dumps(frame).encode())] == [0]


@pytest.mark.parametrize("version", ["3,0", "3", "3.0", 3, 3.0])
def test_version_3_is_taken_however_it_is_written(version: object) -> None:
    assert feed(example(version=version)).frame.time == 1.25


@pytest.mark.parametrize("version", ["2", 2, 30, "33", None, [3], "", "4,0"])
def test_other_versions_are_refused(version: object) -> None:
    with pytest.raises(DatagramError, match="JSON v3"):
        feed(example(version=version))


def test_the_older_layout_that_calls_itself_3_is_refused() -> None:
    frame = example(version="3")
    frame["scene"]["trackers"] = []
    with pytest.raises(DatagramError, match="choose JSON v3"):
        feed(frame)


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e308", "1e999", '"0"', "true", "{}", "null"])
def test_numbers_that_are_none_are_refused(number: str) -> None:
    with pytest.raises(DatagramError):
        RokokoDecoder().feed(EXAMPLE.replace(b"0.125", number.encode()))


@pytest.mark.parametrize("linked", [True, False])
@pytest.mark.parametrize("size", [0, 4, 5, 6, 7])
@pytest.mark.parametrize("checks", [True, False])
def test_every_form_of_lz4_frame_is_unpacked(size: int, linked: bool, checks: bool) -> None:
    text = bytes(np.random.default_rng(1).integers(32, 40, 200_000, dtype=np.uint8))
    frame = lz4.frame.compress(
        text, block_size=size, block_linked=linked, block_checksum=checks, content_checksum=checks, store_size=checks
    )
    assert unpack(frame, LARGEST) == text


def bombs() -> list[bytes]:
    huge = lz4.frame.compress(bytes(20_000_000), block_size=7, store_size=True)
    unsaid = lz4.frame.compress(bytes(20_000_000), block_size=7, store_size=False)
    small_blocks = lz4.frame.compress(bytes(5_000_000), block_size=4, store_size=False)
    zeros = lz4.block.compress(bytes(LARGEST + 1), store_size=False)
    just_over = bytes.fromhex("04224d18604082") + len(zeros).to_bytes(4, "little") + zeros + bytes(4)
    crumbs = bytes.fromhex("04224d18604082") + (b"\x01\x00\x00\x80{" * 13000)[:65000]
    claim = bytes.fromhex("04224d18604082") + b"\xff\xff\xff\xff" + bytes(60000)
    return [huge[:65000], unsaid[:65000], small_blocks, just_over, crumbs, claim, STORED[:-4], PACKED[:40]]


@pytest.mark.parametrize("i", range(8))
def test_a_frame_that_unpacks_to_more_than_it_may_is_refused_before_room_is_made(i: int) -> None:
    bomb = bombs()[i]

    def refused() -> None:
        with pytest.raises(DatagramError):
            RokokoDecoder().feed(bomb)

    assert peak_memory(refused) < MEGABYTE


def test_a_frame_of_exactly_the_largest_size_is_unpacked() -> None:
    assert len(unpack(lz4.frame.compress(bytes(LARGEST), store_size=False), LARGEST)) == LARGEST


def in_scene(value: bytes) -> bytes:
    return EXAMPLE.replace(b'"props":[', b'"props":' + value + b',"more":[')


def in_actors(value: bytes) -> bytes:
    return b'{"version":"3","scene":{"timestamp":0,"actors":' + value + b"}}"


def in_version(value: bytes) -> bytes:
    return EXAMPLE.replace(b'"3,0"', value)


@pytest.mark.parametrize("place", [in_scene, in_actors, in_version])
def test_huge_texts_take_little_memory(place: Any) -> None:
    decoder = RokokoDecoder()
    for text in texts(b'"hip"', place):
        for datagram in (text, lz4.frame.compress(text * (1 if len(text) > LARGEST // 4 else 3))):
            assert peak_memory(lambda datagram=datagram: harmless(decoder, datagram)) < MEGABYTE


def harmless(decoder: RokokoDecoder, datagram: bytes) -> None:
    try:
        decoder.feed(datagram)
    except DatagramError as error:
        assert len(str(error)) < 300 and str(error).isprintable()


@QUICK
@given(st.one_of(st.binary(max_size=600), st.binary(max_size=600).map(lambda tail: bytes.fromhex("04224d18") + tail)))
def test_noise_raises_nothing_but_datagram_errors(datagram: bytes) -> None:
    harmless(RokokoDecoder(), datagram)


WHOLE = RokokoEncoder(packed=False).encode(tpose(), 7, 0.5)[0]


@QUICK
@given(
    st.one_of(
        spoiled(EXAMPLE), spoiled(WHOLE), spoiled(STORED), spoiled(PACKED), spoiled(WHOLE).map(lz4.frame.compress)
    )
)
def test_spoiled_datagrams_leave_the_good_stream_as_it_was(datagram: bytes) -> None:
    decoder = RokokoDecoder()
    harmless(decoder, datagram)
    (sample,) = decoder.feed(WHOLE)
    assert np.abs(sample.frame.landmarks - tpose().landmarks).max() < 1e-3
