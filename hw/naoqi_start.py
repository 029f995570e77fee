"""Before a NAO moves: is it one, does it stand, and what would it do of its own accord?"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from naoimitate.core.errors import DriverError
from naoimitate.core.frames import Array
from naoimitate.hw.approach import Approach, check_arrival
from naoimitate.hw.naoqi_link import NaoqiLink

OLDEST, NEWEST = (2, 1), (2, 9)
"""NAOqi versions from (included) to (excluded): 2.1 to 2.8 run on NAO V4 to V6, 2.9 on Pepper only."""

ON_ITS_FEET = ("Standing", "Crouching")
"""Posture families (Aldebaran, "ALRobotPosture") from which the robot may be started."""

SHORTEST = 0.1
"""[s] for the smallest way: ALMotion refuses durations of less than a few of its periods."""

Notice = Callable[[str], None]


def check_version(link: NaoqiLink) -> str:
    """The robot's NAOqi version; DriverError where it is none that this driver knows."""
    version = str(link.call("ALSystem", "systemVersion"))
    try:
        major, minor = (int(part) for part in version.split(".")[:2])
    except ValueError:
        raise DriverError(f"the robot's software calls itself {version!r}: not NAOqi 2.1 to 2.8") from None
    if not OLDEST <= (major, minor) < NEWEST:
        raise DriverError(f"NAOqi {version} is not supported: NAO V4 to V6 run 2.1 to 2.8")
    return version


def check_body(link: NaoqiLink, joint_names: Sequence[str]) -> None:
    """DriverError where the robot lacks a joint of the model, such as an H21 or T14."""
    has = set(link.call("ALMotion", "getBodyNames", "Body"))
    missing = [name for name in joint_names if name not in has]
    if missing:
        raise DriverError(f"the robot has no {', '.join(missing)}: only NAO H25 is supported")


def posture_family(link: NaoqiLink) -> str:
    """How the robot holds itself: Standing, LyingBelly and so on."""
    return str(link.call("ALRobotPosture", "getPostureFamily"))


def check_posture(link: NaoqiLink) -> None:
    """DriverError where the robot is not on its feet: to get up by itself needs room that nobody has looked at."""
    family = posture_family(link)
    if family not in ON_ITS_FEET:
        raise DriverError(
            f"the robot's posture is {family}: put it on its feet, standing or crouching, and start again"
        )


def quieten(link: NaoqiLink, notice: Notice) -> None:
    """Switch off what moves the robot besides us, and tell so."""
    if link.has("ALAutonomousLife"):  # not on every version
        life = str(link.call("ALAutonomousLife", "getState"))
        if life != "disabled":
            link.call("ALAutonomousLife", "setState", "disabled", patience=20.0)
            notice(f"autonomous life was {life} and is disabled now; a double press of the chest button brings it back")
    for what, name in (("breathing", "Breath"), ("idle movements", "IdlePosture")):
        if link.call("ALMotion", f"get{name}Enabled", "Body"):
            link.call("ALMotion", f"set{name}Enabled", "Body", False)
            notice(f"{what} switched off")


def keep_reflexes(link: NaoqiLink, notice: Notice) -> None:
    """See that the reflexes that protect the robot are on; they may change what we command."""
    for what, name, arguments in (
        ("collision protection of the arms", "CollisionProtection", ("Arms",)),
        ("fall manager", "FallManager", ()),
        ("smart stiffness", "SmartStiffness", ()),
    ):
        if not link.call("ALMotion", f"get{name}Enabled", *arguments):
            link.call("ALMotion", f"set{name}Enabled", *arguments, True)
            notice(f"{what} was off and is switched on")


def wake(link: NaoqiLink, stiffness: float, ramp: float) -> None:
    """Servos on where the robot is: stiffness 0 to 1 within ``ramp`` s."""
    link.call("ALMotion", "stiffnessInterpolation", "Body", stiffness, ramp, patience=ramp + 10.0)
    link.call("ALMotion", "wakeUp", patience=30.0)


def stand_up(link: NaoqiLink, speed: float) -> None:
    """To NAOqi's own stand, which it finds its way to from every posture; speed 0 to 1."""
    if not link.call("ALRobotPosture", "goToPosture", "StandInit", speed, patience=60.0):
        raise DriverError("the robot could not stand up: is there something in its way, or is a joint too hot?")


def go_to(link: NaoqiLink, joint_names: Sequence[str], servos: Array, speed: float, notice: Notice) -> None:
    """From there to servo angles (J,) rad, both feet down: the farthest joint turns at ``speed`` rad/s at most.

    DriverError names the joints that have not arrived.
    """
    names = list(joint_names)
    here = np.array(link.call("ALMotion", "getAngles", names, True), dtype=np.float64)
    way = Approach(here, servos, np.full(len(names), speed))
    if way.far:
        notice(way.notice)
    if way.duration > 0.0:
        duration = max(way.duration, SHORTEST)
        times = [duration] * len(names)
        link.call("ALMotion", "angleInterpolation", names, servos.tolist(), times, True, patience=duration + 10.0)
    here = np.array(link.call("ALMotion", "getAngles", names, True), dtype=np.float64)
    check_arrival(names, np.abs(servos - here))
