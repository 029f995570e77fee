"""Our own protocol: the schema and the decoder agree, frames survive the wire, hostile datagrams do no harm."""

from __future__ import annotations

import json
import re
import socket
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from hostile import MEGABYTE, peak_memory, spoiled, texts
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from naoimitate.core.errors import DatagramError
from naoimitate.core.frames import LANDMARKS, SEGMENTS, HumanFrame
from naoimitate.live.protocols.plain import JSON, JsonDecoder, JsonEncoder, schema
from naoimitate.motion.builtin import builtin_motion, tpose

QUICK = settings(max_examples=1500, deadline=None)
VALIDATOR = jsonschema.Draft202012Validator(schema())
DOCUMENT = Path(__file__).parents[1] / "docs" / "json-stream.md"
SMALL: dict[str, Any] = {
    "format": "naoimitate-frame/1",
    "sequence": 7,
    "time": 0.25,
    "landmarks": {"pelvis": [0.0, 0.1, 0.9], "head": None},
    "person": 2,
    "orientations": {"chest": [0.6, 0.0, 0.8, 0.0]},
    "com": [0.0, 0.0, 1.0],
    "contacts": {"l_foot": True, "r_foot": False},
    "hand_opening": {"r_hand": 0.5},
}


def text(frame: Any) -> bytes:
    return json.dumps(frame).encode()


def accepted(datagram: bytes) -> bool:
    try:
        return len(JsonDecoder().feed(datagram)) == 1
    except DatagramError as error:
        assert len(str(error)) < 300 and str(error).isprintable()
        return False


def test_every_key_reaches_the_sample() -> None:
    (sample,) = JsonDecoder().feed(text(SMALL))
    frame = sample.frame
    assert (sample.sequence, sample.person, frame.time) == (7, 2, 0.25)
    assert frame["pelvis"].tolist() == [0.0, 0.1, 0.9]
    assert np.isnan(np.delete(frame.landmarks, LANDMARKS.index("pelvis"), axis=0)).all()
    assert frame.orientations is not None and frame.contacts is not None and frame.hand_opening is not None
    assert frame.orientations[SEGMENTS.index("chest")] == pytest.approx([0.6, 0.0, 0.8, 0.0])
    assert np.isfinite(frame.orientations).all(axis=1).sum() == 1
    assert frame.com is not None and frame.com.tolist() == [0.0, 0.0, 1.0]
    assert frame.contacts.tolist() == [True, False] and frame.contacts.dtype == bool
    assert frame.hand_opening == pytest.approx([np.nan, 0.5], nan_ok=True)


def test_what_is_not_said_is_not_there() -> None:
    (sample,) = JsonDecoder().feed(text({key: SMALL[key] for key in ("format", "sequence", "time", "landmarks")}))
    frame = sample.frame
    assert sample.person == 0
    assert frame.orientations is None and frame.com is None and frame.contacts is None and frame.hand_opening is None


def frames() -> st.SearchStrategy[HumanFrame]:
    length = st.one_of(st.floats(-1000.0, 1000.0), st.just(np.nan))
    return st.builds(
        HumanFrame,
        time=st.just(0.0),
        landmarks=arrays(float, (19, 3), elements=length),
        orientations=st.one_of(st.none(), st.just(tpose().orientations)),
        com=st.one_of(st.none(), arrays(float, 3, elements=length)),
        contacts=st.one_of(st.none(), arrays(bool, 2)),
        hand_opening=st.one_of(st.none(), arrays(float, 2, elements=st.one_of(st.floats(0.0, 1.0), st.just(np.nan)))),
    )


@settings(max_examples=300, deadline=None)
@given(frames(), st.integers(0, 2**53), st.floats(0.0, 1e9))
def test_frames_survive_the_wire_and_follow_the_schema(frame: HumanFrame, sequence: int, time: float) -> None:
    (datagram,) = JsonEncoder().encode(frame, sequence, time)
    VALIDATOR.validate(json.loads(datagram))
    (sample,) = JsonDecoder().feed(datagram)
    whole = np.isfinite(frame.landmarks).all(axis=1)
    assert np.array_equal(np.isfinite(sample.frame.landmarks).all(axis=1), whole)
    assert np.abs(sample.frame.landmarks[whole] - frame.landmarks[whole]).max(initial=0.0) < 1e-4
    assert (sample.frame.contacts is None) == (frame.contacts is None)
    assert sample.sequence == sequence and sample.frame.time == pytest.approx(time, abs=1e-6)


@pytest.mark.parametrize("name", ["paper", "walk"])
def test_a_motion_survives_the_wire(name: str) -> None:
    motion, encoder, decoder = builtin_motion(name), JsonEncoder(), JsonDecoder()
    for i in range(0, len(motion), 20):
        seen = decoder.feed(encoder.encode(motion[i], i, motion.time[i])[0])[0].frame
        assert np.abs(seen.landmarks - motion[i].landmarks).max() < 1e-4
        assert seen.orientations == pytest.approx(motion[i].orientations, abs=1e-5)
        assert np.array_equal(seen.contacts, motion[i].contacts)


values = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(-3, 2000), st.floats(-1200.0, 1200.0), st.text(max_size=5)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.dictionaries(st.sampled_from([*LANDMARKS[:5], *SEGMENTS, "x"]), inner, max_size=3),
    ),
    max_leaves=6,
)


@QUICK
@given(st.sampled_from([*SMALL, "other"]), st.one_of(values, st.just("away")))
def test_decoder_and_schema_agree_about_changed_frames(key: str, value: Any) -> None:
    frame = {k: v for k, v in {**SMALL, key: value}.items() if (k, v) != (key, "away")}
    quaternions = (frame.get("orientations") or {}) if key == "orientations" else {}
    if VALIDATOR.is_valid(frame) and any(
        q is not None and not 0.9 <= float(np.linalg.norm(q)) <= 1.1 for q in quaternions.values()
    ):
        assert not accepted(text(frame))  # the one rule that a schema cannot say
    else:
        assert accepted(text(frame)) == VALIDATOR.is_valid(frame)


@pytest.mark.parametrize(
    "number", ["NaN", "Infinity", "-Infinity", "1e308", "1e999", '"1"', "true", "[1]", "{}", "9" * 400]
)
@pytest.mark.parametrize("place", ['"sequence": 7', '"time": 0.25', "[0.0, 0.1, 0.9]", "0.6", "0.5"])
def test_numbers_that_are_none_are_refused(place: str, number: str) -> None:
    key, _, value = place.rpartition(" ")
    changed = json.dumps(SMALL).replace(place, f"{key} {number}]" if value.endswith("]") else f"{key} {number}")
    assert changed != json.dumps(SMALL)
    assert not accepted(changed.encode())


def test_the_last_of_two_equal_keys_counts() -> None:
    doubled = text(SMALL).replace(b'"time": 0.25', b'"time": 0.25, "time": 0.75')
    assert JsonDecoder().feed(doubled)[0].frame.time == 0.75


def test_counters_written_with_a_point_are_whole_numbers() -> None:
    assert JsonDecoder().feed(text({**SMALL, "sequence": 7.0}))[0].sequence == 7
    assert not accepted(text({**SMALL, "sequence": 7.5}))


def at_landmarks(value: bytes) -> bytes:
    return b'{"format":"naoimitate-frame/1","sequence":1,"time":0,"landmarks":' + value + b"}"


def at_point(value: bytes) -> bytes:
    return at_landmarks(b'{"head":' + value + b"}")


def at_format(value: bytes) -> bytes:
    return b'{"sequence":1,"time":0,"landmarks":{},"format":' + value + b"}"


@pytest.mark.parametrize("place", [at_landmarks, at_point, at_format])
def test_huge_texts_take_little_memory(place: Any) -> None:
    for datagram in texts(b'"head"', place):
        assert peak_memory(lambda datagram=datagram: accepted(datagram)) < MEGABYTE


@QUICK
@given(st.one_of(st.binary(max_size=300), spoiled(text(SMALL)), spoiled(JsonEncoder().encode(tpose(), 1, 0.1)[0])))
def test_hostile_datagrams_raise_nothing_but_datagram_errors(datagram: bytes) -> None:
    accepted(datagram)
    assert accepted(text(SMALL))


def test_the_example_of_the_documentation_is_a_stream(monkeypatch: pytest.MonkeyPatch) -> None:
    (example,) = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(), re.DOTALL)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5.0)
        quick = example.replace(str(JSON.port), str(receiver.getsockname()[1])).replace("1 / 60", "0.0001")
        exec(compile(quick, "json-stream.md", "exec"), {})
        samples = [JsonDecoder().feed(receiver.recv(65536))[0] for _ in range(60)]
    assert [sample.sequence for sample in samples] == list(range(60))
    assert np.isfinite(samples[0].frame["l_wrist"]).all()
    assert len([line for line in example.splitlines() if line.strip()]) <= 10


def test_it_knows_its_own_datagrams() -> None:
    assert JSON.recognises(text(SMALL))
    assert not JSON.recognises(b'{"version":"3,0","scene":{"timestamp":0,"actors":[]}}')
