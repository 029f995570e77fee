"""The whole pipeline, frame by frame: whatever comes in, every command is finite, stable and within its limits."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from people import bare, moved, person, tpose, turned, without

from naoimitate.core.errors import CalibrationError
from naoimitate.core.frames import LANDMARKS, GivenUp, HumanFrame, RobotCommand
from naoimitate.core.geometry import convex_hull, matrix_from_rotation_vector, polygon_margin, yaw_matrix
from naoimitate.imitator import Imitator
from naoimitate.motion.builtin import HANGING, builtin_motion
from naoimitate.robot.model import RobotModel
from naoimitate.run.limits import COUPLED_TOLERANCE, SPEED_FRACTION
from naoimitate.run.replay import replay
from naoimitate.settings import PAPER, Settings

MARGIN, SLIP, LEVEL = 0.005, 0.5e-3, 0.5e-3
"""m: least static margin, largest travel of a stance sole, largest height of it."""
CLEAR = 0.005
ARM_UP = (3.0, 0.1, 0.2, 0.0)
LEFT_LIFTED = {"feet": [[0.0, 0.1, 0.2, 0.0, 0.0, 0.0], [0.0, -0.1, 0.0, 0.0, 0.0, 0.0]], "com": [0.04, -0.1]}


@dataclass
class Judge:
    """Takes every command of one stream and checks all of it anew, from joint angles and torso pose alone."""

    robot: RobotModel
    commands: list[RobotCommand] = field(default_factory=list)
    planted: list[np.ndarray | None] = field(default_factory=lambda: [None, None])

    def take(self, command: RobotCommand) -> RobotCommand:
        self._numbers(command)
        self._ranges(command)
        pose = replay(self.robot, command.q[None], command.base_pos[None], command.base_quat[None])
        carries = [sole[0] for sole, mode in zip(pose.soles, "RL", strict=True) if command.support != mode]
        margin = polygon_margin(convex_hull(np.concatenate(carries)[:, :2]), *pose.com[0, :2])
        assert margin >= MARGIN, f"margin {1000 * margin:.1f} mm at {command.time:.2f} s"
        assert command.com == pytest.approx(pose.com[0], abs=1e-6)
        for side, mode in enumerate("RL"):
            self._sole(side, pose.soles[side][0], command.support != mode)
        if self.commands:
            self._motion(self.commands[-1], command)
        self.commands.append(command)
        return command

    def _numbers(self, command: RobotCommand) -> None:
        for name in ("q", "base_pos", "base_quat", "com", "soles", "posture"):
            assert np.isfinite(getattr(command, name)).all(), name
        assert np.linalg.norm(command.base_quat) == pytest.approx(1.0)
        assert command.support in "DLR" and command.human_support in "DLRF"
        assert 0.0 <= command.offset <= 1.0 and np.isfinite(command.human_offset)

    def _ranges(self, command: RobotCommand) -> None:
        q, robot = command.q, self.robot
        assert (q >= robot.lower - 1e-9).all() and (q <= robot.upper + 1e-9).all()
        for table in robot.tables:
            low, high = table.bounds(q[table.x])
            assert low - 1e-9 <= q[table.y] <= high + 1e-9
        for leader, follower in robot.coupled:
            assert abs(q[leader] - q[follower]) <= COUPLED_TOLERANCE

    def _sole(self, side: int, outline: np.ndarray, carries: bool) -> None:
        if not carries:
            if outline[:, 2].min() >= CLEAR:
                self.planted[side] = None
            return
        assert np.abs(outline[:, 2]).max() <= LEVEL
        before = self.planted[side]
        if before is None:
            self.planted[side] = outline
        else:
            assert np.linalg.norm(outline - before, axis=1)[:].max() <= SLIP, "a stance foot slips"

    def _motion(self, before: RobotCommand, command: RobotCommand) -> None:
        dt = command.time - before.time
        assert 0.0 < dt <= 0.05 + 1e-9
        fastest = (np.abs(command.q - before.q) / self.robot.speed).max() / dt
        assert fastest <= SPEED_FRACTION, f"a joint at {fastest:.2f} of its speed"
        assert {before.support, command.support} != {"L", "R"}, "both feet at once"

    @property
    def supports(self) -> str:
        """The modes in order, without repetition."""
        modes = [c.support for c in self.commands]
        return "".join(m for i, m in enumerate(modes) if i == 0 or m != modes[i - 1])

    @property
    def given_up(self) -> GivenUp:
        """Every bit that was set."""
        bits = GivenUp(0)
        for command in self.commands:
            bits |= command.given_up
        return bits


def imitate(
    robot: RobotModel, frames: Iterable[HumanFrame], choice: Settings | None = None, dt: float | None = None
) -> Judge:
    """Calibrate on a T-pose and imitate the frames, everything checked."""
    imitator, judge = Imitator(robot, choice), Judge(robot)
    imitator.calibrate(tpose())
    for frame in frames:
        judge.take(imitator.step(frame, dt))
    return judge


def stream(name: str, rate: float, start: float = 0.0, end: float = np.inf) -> list[HumanFrame]:
    """A built-in motion as a camera of this rate sees it: landmarks and orientations, nothing else."""
    motion = builtin_motion(name)
    times = np.arange(start, min(end, motion.duration), 1.0 / rate)
    return [replace(motion.at(float(t)), support=None, contacts=None, com=None) for t in times]


def still(count: int, dt: float = 0.02, frame: HumanFrame | None = None, start: float = 0.0) -> list[HumanFrame]:
    """The same posture for some time."""
    return [replace(frame or person(), time=start + k * dt) for k in range(count)]


@pytest.mark.parametrize("rate", [20.0, 60.0, 120.0, 240.0])
def test_limits_hold_at_any_frame_rate(robot: RobotModel, rate: float) -> None:
    """The march, from its first lift-off to its second, as a live stream: dt from the frames' own times."""
    judge = imitate(robot, stream("march", rate, 3.0, 7.0))
    assert judge.commands[-1].time == pytest.approx(4.0, abs=0.1)
    assert "L" in judge.supports


@pytest.mark.parametrize("rate", [20.0, 60.0, 120.0, 240.0])
def test_a_fast_arm_is_held_back_by_the_clock_and_not_by_the_frames(nao: RobotModel, rate: float) -> None:
    """Arms thrown up within a frame: the hand arrives when its speed allows, whatever the frame rate."""
    up = person(arms=[ARM_UP, ARM_UP])
    frames = still(int(0.5 * rate), 1.0 / rate) + still(int(2.5 * rate), 1.0 / rate, up, 0.5)
    judge = imitate(nao, frames)
    assert GivenUp.SPEED in judge.given_up
    hands = np.array([c.q[nao.joint("LShoulderPitch")] for c in judge.commands])
    times = np.array([c.time for c in judge.commands])
    half = times[np.argmax(hands < 0.5 * (hands[0] + hands[-1]))]
    assert 0.6 < half < 1.5


def test_frames_without_a_needed_calibration_are_refused(nao: RobotModel) -> None:
    with pytest.raises(CalibrationError, match="calibrate"):
        Imitator(nao).step(person())


def test_the_first_command_is_a_double_support_stand_near_the_person(robot: RobotModel) -> None:
    judge = imitate(robot, [person(arms=[(1.2, 0.2, 0.5, 0.0), HANGING])])
    command = judge.commands[0]
    assert command.support == "D" and command.time == 0.0
    assert command.soles[:, 2] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert abs(command.soles[:, 1].mean()) < 1e-6


def test_calibrating_again_starts_again(nao: RobotModel) -> None:
    imitator = Imitator(nao)
    imitator.calibrate(tpose())
    first = [imitator.step(f) for f in still(20)]
    imitator.calibrate(tpose())
    again = [imitator.step(f) for f in still(20)]
    for a, b in zip(first, again, strict=True):
        assert np.array_equal(a.q, b.q) and a.time == b.time


def test_the_same_stream_gives_the_same_commands(robot: RobotModel) -> None:
    frames = stream("side-kick", 50.0, 2.0, 6.0)
    a, b = imitate(robot, frames), imitate(robot, frames)
    for x, y in zip(a.commands, b.commands, strict=True):
        assert np.array_equal(x.q, y.q) and np.array_equal(x.base_pos, y.base_pos) and x.given_up == y.given_up


def test_the_person_may_face_any_way_and_walk_off(nao: RobotModel) -> None:
    frames = stream("paper", 50.0, 6.0, 10.0)
    here = imitate(nao, frames)
    there = imitate(nao, [turned(f, 2.1, 30.0, -70.0) for f in frames])
    for x, y in zip(here.commands, there.commands, strict=True):
        assert x.q == pytest.approx(y.q, abs=1e-5) and x.support == y.support, "rounding of 1e-14 m, grown in 200 steps"


def test_a_person_who_stands_still_gets_a_robot_that_stands_still(robot: RobotModel) -> None:
    judge = imitate(robot, still(300))
    last = np.array([c.q for c in judge.commands[150:]])
    assert np.abs(np.diff(last, axis=0)).max() < 2e-4
    assert judge.supports == "D"


def steps(count: int, seed: int, seconds: float = 4.0, dt: float = 0.025) -> list[tuple[str, list[HumanFrame]]]:
    """A person who sets one foot after the other anywhere: too far, too narrow, toes turned; and what they stand on."""
    rng, time, phases = np.random.default_rng(seed), 0.0, []
    feet = np.array([[0.0, 0.1, 0.0, 0.0, 0.0, 0.0], [0.0, -0.1, 0.0, 0.0, 0.0, 0.0]])
    for k in range(count):
        swing, stance = k % 2, 1 - k % 2
        sign = 1.0 if swing == 0 else -1.0
        there = yaw_matrix(feet[stance, 3]) @ [rng.uniform(-0.35, 0.35), sign * rng.uniform(0.08, 0.45), 0.0]
        feet[swing, :3] = feet[stance, :3] + there
        feet[swing, 3] = feet[stance, 3] + rng.uniform(-0.7, 0.7)
        for support in ("LR"[stance], "D"):
            held = feet.copy()
            held[swing, 2] = 0.12 if support != "D" else 0.0
            com = feet[stance, :2] if support != "D" else feet[:, :2].mean(axis=0)
            frame = replace(person(feet=held, com=com, height=0.68), support=support)
            phases.append((support, still(round(seconds / dt), dt, frame, time)))
            time += seconds
    return phases


def test_the_robot_is_never_stuck_wherever_the_person_steps(robot: RobotModel) -> None:
    """Five random steps; 4 s on each foot and on both are enough to get there every time."""
    imitator, judge = Imitator(robot), Judge(robot)
    imitator.calibrate(tpose())
    for support, frames in steps(5, seed=0):
        for frame in frames:
            judge.take(imitator.step(frame))
        assert judge.commands[-1].support == support, f"stuck at {judge.commands[-1].time:.1f} s"
    assert GivenUp.LANDING in judge.given_up


# Bad input.


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
def test_landmarks_that_come_and_go(robot: RobotModel, value: float) -> None:
    rng, frames = np.random.default_rng(0), stream("march", 50.0, 2.0, 8.0)
    for i, frame in enumerate(frames):
        lost = [n for n in LANDMARKS if rng.random() < 0.2]
        frames[i] = without(frame, *lost, value=value)
    judge = imitate(robot, frames)
    assert GivenUp.INPUT in judge.given_up


def test_a_stream_that_loses_everything_for_a_second_holds_and_goes_on(nao: RobotModel) -> None:
    frames = stream("march", 50.0, 2.0, 9.0)
    frames[100:150] = [without(f, *LANDMARKS) for f in frames[100:150]]
    judge = imitate(nao, frames)
    lost = [c.given_up for c in judge.commands[100:150]]
    assert all(GivenUp.INPUT in bits for bits in lost)
    assert GivenUp.INPUT not in judge.commands[-1].given_up


def test_missing_feet_and_missing_arms(nao: RobotModel) -> None:
    feet = ("l_ankle", "r_ankle", "l_toe", "r_toe", "l_knee", "r_knee")
    arms = ("l_elbow", "r_elbow", "l_wrist", "r_wrist", "l_hand", "r_hand")
    for names in (feet, arms):
        judge = imitate(nao, [without(bare(f), *names) for f in stream("march", 50.0, 2.0, 6.0)])
        assert all(GivenUp.INPUT in c.given_up for c in judge.commands)


def test_teleports_of_two_metres(robot: RobotModel) -> None:
    rng, frames = np.random.default_rng(1), stream("march", 50.0, 2.0, 9.0)
    place = np.zeros(3)
    for i, frame in enumerate(frames):
        if rng.random() < 0.1:
            place = rng.uniform(-2.0, 2.0, 3)
        frames[i] = moved(frame, np.eye(3), place)
    imitate(robot, frames)


def test_a_person_who_turns_round_between_two_frames(nao: RobotModel) -> None:
    rng, frames = np.random.default_rng(2), stream("march", 50.0, 2.0, 8.0)
    yaw = 0.0
    for i, frame in enumerate(frames):
        yaw = rng.uniform(-3.1, 3.1) if rng.random() < 0.1 else yaw
        frames[i] = turned(frame, yaw)
    imitate(nao, frames)


@pytest.mark.parametrize("axis", [(0.0, 1.57, 0.0), (1.57, 0.0, 0.0), (3.14, 0.0, 0.0), (0.0, -1.57, 0.0)])
@pytest.mark.parametrize("whole", [True, False])
def test_a_person_who_lies_down_or_stands_on_the_hands(
    robot: RobotModel, axis: tuple[float, float, float], whole: bool
) -> None:
    """Over a second, or all at once; with and without orientations."""
    frames = still(25)
    for k in range(150):
        part = min(k / 50.0, 1.0) if whole else 1.0
        frame = moved(person(), matrix_from_rotation_vector(part * np.array(axis)), np.array([0.0, 0.0, 0.3 * part]))
        frames.append(replace(frame if whole else bare(frame), time=0.5 + 0.02 * k))
    imitate(robot, frames)


def test_frames_at_once_and_frames_late(robot: RobotModel) -> None:
    """dt of 0, back in time, 10 s late."""
    frames, time = stream("march", 50.0, 2.0, 9.0), 0.0
    steps = [0.02, 0.0, 0.0, -1.0, 10.0, 0.02, 1e-9, 0.3, -0.02]
    for i, frame in enumerate(frames):
        time += steps[i % len(steps)]
        frames[i] = replace(frame, time=time)
    judge = imitate(robot, frames)
    elapsed = np.diff([c.time for c in judge.commands])
    assert elapsed.min() > 0.0 and elapsed.max() <= 0.05 + 1e-12


@pytest.mark.parametrize("dt", [0.0, -1.0, 10.0, np.nan, np.inf])
def test_any_dt_that_the_caller_gives(nao: RobotModel, dt: float) -> None:
    imitate(nao, still(5) + stream("march", 50.0, 3.0, 4.0), dt=dt)


def test_times_that_are_no_times(nao: RobotModel) -> None:
    frames = [
        replace(f, time=(np.nan, np.inf, -np.inf, 1e300)[i % 4]) for i, f in enumerate(stream("wave", 50.0, 3, 5))
    ]
    imitate(nao, frames)


@pytest.mark.parametrize("quaternion", [0.0, np.nan, np.inf, 1e-12, 1e12])
def test_orientations_that_are_no_rotations(nao: RobotModel, quaternion: float) -> None:
    frames = stream("march", 50.0, 3.0, 5.0)
    imitate(nao, [replace(f, orientations=np.full_like(f.orientations, quaternion)) for f in frames])


@pytest.mark.parametrize("com", [np.nan, np.inf, 1e9, -1e300])
def test_a_com_that_is_none(nao: RobotModel, com: float) -> None:
    frames = stream("march", 50.0, 3.0, 5.0)
    imitate(nao, [replace(f, com=np.array([com, 0.0, com])) for f in frames])


GARBAGE = st.floats(allow_nan=True, allow_infinity=True, width=64)
COORDINATE = st.one_of(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), GARBAGE)


@given(
    seed=st.integers(0, 2**32 - 1),
    spread=st.sampled_from([0.02, 0.3, 3.0, 1e3, 1e8]),
    modes=st.lists(st.sampled_from(["D", "L", "R", "F", None]), min_size=1, max_size=6),
    odd=st.lists(COORDINATE, min_size=3, max_size=3),
)
@settings(max_examples=12, deadline=None)
def test_random_garbage_never_unbalances_the_robot(
    robot: RobotModel, seed: int, spread: float, modes: list[str | None], odd: list[float]
) -> None:
    """Noise of millimetres to light years on every landmark, any support mode, impossible numbers anywhere."""
    rng, frames = np.random.default_rng(seed), []
    for k in range(60):
        frame = person() if k % 20 < 10 else person(**LEFT_LIFTED)
        landmarks = frame.landmarks + rng.normal(0.0, spread, frame.landmarks.shape)
        landmarks[rng.integers(len(landmarks))] = odd
        quaternions = frame.orientations + rng.normal(0.0, min(spread, 10.0), frame.orientations.shape)
        support = modes[(k // 12) % len(modes)]
        frames.append(HumanFrame(0.02 * k, landmarks, quaternions, support=support))
    imitate(robot, frames)


# What was given up: every bit.


def test_reach_is_given_up_when_the_arm_cannot_get_there(nao: RobotModel) -> None:
    """Both arms straight behind the back: no shoulder of this robot goes there."""
    behind = (-1.5, 0.0, 0.0, 0.0)
    judge = imitate(nao, still(150, frame=person(arms=[behind, behind])))
    assert GivenUp.REACH in judge.commands[-1].given_up


def test_collision_is_given_up_when_the_body_is_in_the_way(nao: RobotModel) -> None:
    """Hands folded inside the belly."""
    inside = (0.3, -0.9, 1.9, -0.5)
    judge = imitate(nao, still(200, frame=person(arms=[inside, inside])))
    assert GivenUp.COLLISION in judge.given_up


def test_speed_is_given_up_when_an_arm_is_thrown_up(nao: RobotModel) -> None:
    judge = imitate(nao, still(10) + still(10, frame=person(arms=[ARM_UP, ARM_UP]), start=0.2))
    assert GivenUp.SPEED in judge.commands[-1].given_up


def test_balance_is_given_up_when_planted_feet_hold_the_torso(nao: RobotModel) -> None:
    """A twist of the body over planted feet cannot show in the torso of a robot with coupled hips."""
    judge = imitate(nao, still(100, frame=person(trunk=[0.5, 0.5, 0.1], height=0.7)))
    assert GivenUp.BALANCE in judge.commands[-1].given_up


def test_support_is_given_up_while_the_robot_shifts_its_weight(nao: RobotModel) -> None:
    frames = still(20) + [replace(f, support="R") for f in still(150, frame=person(**LEFT_LIFTED), start=0.4)]
    judge = imitate(nao, frames)
    assert GivenUp.SUPPORT in judge.commands[25].given_up
    assert GivenUp.SUPPORT not in judge.commands[-1].given_up
    assert judge.supports == "DR"


def test_support_is_given_up_in_a_flight(nao: RobotModel) -> None:
    judge = imitate(nao, still(5) + [replace(f, support="F") for f in still(50, start=0.1)])
    assert all(GivenUp.SUPPORT in c.given_up for c in judge.commands[5:])
    assert judge.supports == "D"


def test_landing_is_given_up_when_the_step_is_too_long(nao: RobotModel) -> None:
    far = {
        "feet": [[0.5, 0.1, 0.05, 0.0, 0.0, 0.0], [0.0, -0.1, 0.0, 0.0, 0.0, 0.0]],
        "com": [0.04, -0.1],
        "height": 0.75,
    }
    up = [replace(f, support="R") for f in still(200, frame=person(**far))]
    down = [replace(f, support="D") for f in still(150, frame=person(**far), start=4.0)]
    judge = imitate(nao, up + down)
    assert GivenUp.LANDING in judge.given_up
    assert judge.supports == "DRD"


def test_input_is_given_up_when_landmarks_are_missing(nao: RobotModel) -> None:
    judge = imitate(nao, still(5) + [without(f, "l_wrist") for f in still(5, start=0.1)])
    assert [GivenUp.INPUT in c.given_up for c in judge.commands] == [False] * 5 + [True] * 5


def test_hold_is_given_up_when_no_step_passes_the_gate(nao: RobotModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """A gate that refuses everything: the last safe pose is repeated until it opens again."""
    from naoimitate.gate import Gate

    imitator, judge = Imitator(nao), Judge(nao)
    imitator.calibrate(tpose())
    moving = stream("squat", 50.0, 2.0, 4.0)
    for frame in moving[:20]:
        safe = judge.take(imitator.step(frame))
    with monkeypatch.context() as patch:
        patch.setattr(Gate, "passes", lambda *_: False)
        held = [judge.take(imitator.step(frame)) for frame in moving[20:40]]
    assert all(GivenUp.HOLD in c.given_up and np.array_equal(c.q, safe.q) for c in held)
    after = [judge.take(imitator.step(frame)) for frame in moving[40:]]
    assert not any(GivenUp.HOLD in c.given_up for c in after)
    assert np.abs(after[-1].q - safe.q).max() > 0.05


# Other settings.


@pytest.mark.parametrize("orientation", ["free", "upright", "follow"])
def test_every_hand_orientation_is_safe(robot: RobotModel, orientation: str) -> None:
    imitate(robot, stream("wave", 50.0, 2.0, 8.0), Settings(hand_orientation=orientation))


def test_the_papers_settings_keep_limits_and_balance(nao: RobotModel) -> None:
    """Its feet are shifted over the floor, so slip is not judged."""
    imitator, judge = Imitator(nao, PAPER), Judge(nao)
    imitator.calibrate(tpose())
    for frame in stream("paper", 30.0, 0.0, 12.0):
        command = imitator.step(frame)
        judge._numbers(command)
        judge._ranges(command)
        if judge.commands:
            judge._motion(judge.commands[-1], command)
        judge.commands.append(command)
    assert judge.supports.startswith("DL")


@pytest.mark.parametrize("retarget", ["planted", "paper"])
def test_a_robot_that_stands_blends_in_without_a_jump(robot: RobotModel, retarget: str) -> None:
    imitator = Imitator(robot, Settings(retarget=retarget))
    frame = still(1)[0]
    imitator.calibrate(tpose())
    imitator.stand()
    imitator.blend(1.0)
    q, speed = robot.postures["stand"], np.zeros(len(robot.joint_names))
    for _ in range(150):
        command = imitator.step(frame, 0.01)
        assert command.support == "D"
        after = (command.q - q) / 0.01
        assert (np.abs(after) <= 0.9 * robot.speed).all()
        assert np.abs(after - speed).max() * 0.01 < 0.02, "rad of a step that were not in the one before"
        q, speed = command.q, after
    assert not imitator.blending


def test_who_takes_over_is_imitated_from_where_the_robot_is(nao: RobotModel) -> None:
    imitator = Imitator(nao)
    first = imitator.calibrate(tpose())
    frames = still(30)
    last = [imitator.step(f, 0.01) for f in frames][-1]
    imitator.turn_to(first)
    imitator.blend(0.5)
    command = imitator.step(frames[-1], 0.01)
    assert np.abs(command.q - last.q).max() < 0.01
    assert command.time == pytest.approx(last.time + 0.01)


def test_the_upper_body_alone_is_imitated_by_a_robot_that_stands(robot: RobotModel) -> None:
    imitator = Imitator(robot, Settings(upper_body=True))
    imitator.calibrate(tpose())
    commands = [imitator.step(f, 0.02) for f in stream("side-kick", 50.0, 0.0, 8.0)]
    assert {c.support for c in commands} == {"D"}
    q = np.array([c.q for c in commands])
    legs, arms = (robot.chains[f"l_{part}"] for part in ("leg", "arm"))
    assert np.ptp(q[50:, list(legs)], axis=0).max() < 0.1 * np.ptp(q[:, list(arms)], axis=0).max()
