"""The run file: what is written comes back, and a broken file is refused in one line that names the key."""

from __future__ import annotations

import dataclasses
import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

from naoimitate.core.errors import RunFileError
from naoimitate.run.file import KEYS, Run, load_run, save
from naoimitate.run.provenance import provenance, settings_of
from naoimitate.run.schema import SCHEMA


def make(frames: int = 5, joints: int = 3) -> Run:
    rng = np.random.default_rng(7)
    quat = rng.normal(size=(frames, 4))
    return Run(
        robot="toy",
        robot_version="v1",
        method="static",
        retarget="planted",
        source="clip.bvh",
        provenance="{}",
        time=np.arange(frames) / 100.0,
        human_time=np.arange(frames) / 100.0 + 1.0,
        joint_names=np.array([f"J{j}" for j in range(joints)]),
        q=rng.normal(size=(frames, joints)),
        base_pos=rng.normal(size=(frames, 3)),
        base_quat=quat / np.linalg.norm(quat, axis=1, keepdims=True),
        support=np.array(list("DLRDD")[:frames]),
        human_support=np.array(list("DLRFD")[:frames]),
        contact_names=np.array(["l_sole", "r_sole"]),
        contacts=rng.random((frames, 2)) < 0.5,
        contact_points=rng.normal(size=(frames, 2, 3)),
        offset=rng.random(frames),
        human_offset=rng.random(frames),
        com=rng.normal(size=(frames, 3)),
        human_posture=rng.normal(size=(frames, 4, 3)),
        ref_human=rng.normal(size=(4, 3)),
        ref_robot=rng.normal(size=(4, 3)),
        scale=rng.random(4) + 0.1,
        hand_opening=np.full((frames, 2), np.nan),
        given_up=np.arange(frames, dtype=np.uint8),
        step_time=rng.random(frames),
        ik_iterations=np.arange(frames),
    )


SIMULATED = {
    "session": np.array(["tracking"] * 5),
    "latency": np.full(5, np.nan),
    "sim_base_pos": np.zeros((5, 3)),
    "sim_base_quat": np.tile([1.0, 0.0, 0.0, 0.0], (5, 1)),
    "sim_q": np.zeros((5, 3)),
    "sim_fsr": np.ones((5, 2, 4)),
    "sim_fell": True,
}


@pytest.mark.parametrize("extra", [{}, SIMULATED], ids=["imitated", "live and simulated"])
def test_a_run_comes_back_as_it_was_written(tmp_path: Path, extra: dict) -> None:
    run = dataclasses.replace(make(), **extra)
    save(run, tmp_path / "run.npz")
    again = load_run(tmp_path / "run.npz")
    for key in KEYS:
        want, got = getattr(run, key), getattr(again, key)
        assert (want is None) == (got is None), key
        if want is not None:
            np.testing.assert_array_equal(want, got, err_msg=key)


def test_fields_and_schema_name_the_same_keys() -> None:
    assert set(KEYS) == set(SCHEMA)


def test_the_file_opens_without_pickle_and_has_the_contracts_types(tmp_path: Path) -> None:
    save(make(), tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz", allow_pickle=False) as file:
        assert str(file["format"]) == "naoimitate-run/1"
        assert file["given_up"].dtype == np.uint8
        assert file["contacts"].dtype == np.bool_
        assert file["support"].dtype.kind == "U"
        assert file["q"].shape == (5, 3)


BREAKS = {
    "time": {"time": np.array([0.0, 0.01, 0.01, 0.03, 0.04])},
    "time ": {"time": np.arange(5) / 30.0},
    "human_time": {"human_time": np.array([0.0, 0.02, 0.01, 0.03, 0.04])},
    "human_posture": {"human_posture": np.full((5, 4, 3), np.nan)},
    "q": {"q": np.zeros((4, 3))},
    "q ": {"q": np.full((5, 3), np.nan)},
    "com": {"com": np.zeros((5, 2))},
    "base_quat": {"base_quat": np.zeros((5, 4))},
    "support": {"support": np.array(list("DLRFD"))},
    "human_support": {"human_support": np.array(list("DLRXD"))},
    "contact_names": {"contact_names": np.array(["l_sole", "l_hand"])},
    "joint_names": {"joint_names": np.array(["J0", "J0", "J1"])},
    "contacts": {"contacts": np.zeros((5, 2))},
    "offset": {"offset": np.full(5, 1.5)},
    "scale": {"scale": np.zeros(4)},
    "provenance": {"provenance": "not json"},
    "format": {"format": "naoimitate-run/9"},
    "sim_q": {"sim_q": np.zeros((5, 2))},
    "sim_fsr": {"sim_fsr": np.zeros((5, 8))},
    "sim_fsr ": {"sim_fsr": np.full((5, 2, 4), -1.0)},
    "com ": {"com": np.full((5, 3), 1e300)},
    "human_time ": {"human_time": np.array([0.0, 0.0, 0.0, 0.0, np.inf])},
    "time  ": {"time": np.arange(5) * 1e-300},
    "provenance ": {"provenance": "[" * 100_000},
}


@pytest.mark.parametrize("key", BREAKS)
def test_a_broken_key_is_named_on_writing_and_on_reading(tmp_path: Path, key: str) -> None:
    run = dataclasses.replace(make(), **BREAKS[key])
    path = tmp_path / "run.npz"
    with pytest.raises(RunFileError, match=f"key '{key.strip()}'"):
        save(run, path)
    assert not list(tmp_path.iterdir())
    np.savez(path, **{k: getattr(run, k) for k in KEYS if getattr(run, k) is not None})
    with pytest.raises(RunFileError, match=f"key '{key.strip()}'") as error:
        load_run(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("key", [key for key in SCHEMA if not SCHEMA[key].optional])
def test_a_missing_key_is_named(tmp_path: Path, key: str) -> None:
    run = make()
    np.savez(tmp_path / "run.npz", **{k: getattr(run, k) for k in KEYS if k != key and getattr(run, k) is not None})
    with pytest.raises(RunFileError, match=f"'{key}' is missing"):
        load_run(tmp_path / "run.npz")


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_a_file_cut_short_is_one_clear_error(tmp_path: Path, share: float) -> None:
    path = tmp_path / "run.npz"
    save(make(), path)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(RunFileError, match="whole"):
        load_run(path)


def test_other_files_and_missing_files_are_one_clear_error(tmp_path: Path) -> None:
    for name, content in {"text.npz": b"hello", "array.npz": b"\x93NUMPY\x01\x00", "pickle.npz": b"\x80\x04N."}.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(RunFileError):
            load_run(tmp_path / name)
    np.save(tmp_path / "plain.npy", np.zeros(3))
    with zipfile.ZipFile(tmp_path / "other.npz", "w") as archive:
        archive.writestr("readme.txt", "hello")
    for name in ("plain.npy", "other.npz", "absent.npz", "."):
        with pytest.raises(RunFileError):
            load_run(tmp_path / name)


def test_a_failed_write_leaves_the_old_file_alone(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    save(make(), path)
    before = path.read_bytes()
    with pytest.raises(RunFileError):
        save(dataclasses.replace(make(), scale=np.zeros(4)), path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
    with pytest.raises(RunFileError, match="cannot write"):
        save(make(), tmp_path / "no" / "such" / "folder.npz")


def test_a_reader_ignores_keys_that_it_does_not_know(tmp_path: Path) -> None:
    run = make()
    arrays = {k: getattr(run, k) for k in KEYS if getattr(run, k) is not None}
    np.savez(tmp_path / "run.npz", future=np.zeros(2), **arrays)
    assert len(load_run(tmp_path / "run.npz")) == 5


def test_provenance_holds_program_settings_hashes_and_seed() -> None:
    @dataclasses.dataclass(frozen=True)
    class Settings:
        retarget: str = "planted"
        margin: float = 0.025

    text = provenance(Settings(), source_sha256="ab", seed=3, speed="auto")
    value = json.loads(text)
    assert (value["program"], value["seed"], value["source_sha256"]) == ("naoimitate", 3, "ab")
    assert value["version"][0].isdigit()
    assert settings_of(text) == {"retarget": "planted", "margin": 0.025, "speed": "auto"}


def members(path: Path) -> dict[str, bytes]:
    save(make(), path)
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def rewrite(path: Path, contents: dict[str, bytes]) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            archive.writestr(name, content)


def test_a_small_file_that_claims_to_hold_terabytes_takes_no_memory(tmp_path: Path) -> None:
    path = tmp_path / "run.npz"
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (10**12, 3)})
    rewrite(path, {**members(path), "q.npy": header.getvalue() + bytes(100)})
    with pytest.raises(RunFileError, match="whole"):
        load_run(path)


def test_damaged_headers_are_one_clear_error_or_do_no_harm(tmp_path: Path) -> None:
    path, rng = tmp_path / "run.npz", np.random.default_rng(3)
    good = members(path)
    refused = 0
    for _ in range(150):
        name = rng.choice(list(good))
        bad = bytearray(good[name])
        for place in rng.integers(0, 128, size=3):
            bad[place] = rng.choice(list(b"\x00\xff('9 {}"))
        rewrite(path, {**good, name: bytes(bad)})
        try:
            load_run(path)
        except RunFileError as error:
            assert "\n" not in str(error)
            refused += 1
    assert refused > 100
