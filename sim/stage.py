"""One picture of the robot, with a person beside it: the off-screen renderer and its camera."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco

from naoimitate.core.frames import Array
from naoimitate.robot.model import RobotModel
from naoimitate.sim.contacts import SHAPE_GROUP
from naoimitate.sim.gl import Canvas, Image
from naoimitate.sim.hands import CLOSED
from naoimitate.sim.person import draw_person
from naoimitate.sim.physics import Physics
from naoimitate.sim.placement import stand_on_floor
from naoimitate.sim.scene import LOOKS_GROUP, PICTURE_SIZE
from naoimitate.sim.settings import SimSettings

MAX_GEOMS = 1000
"""Room in a scene: a robot has some 80 geoms, a person 24."""


@dataclass(frozen=True)
class View:
    """Where the camera looks from. Angles in deg, as MuJoCo has them: azimuth 180 looks at the robot's face."""

    azimuth: float = 150.0
    elevation: float = -10.0
    distance: float = 3.2
    """In robot heights."""
    height: float = 0.55
    """Of the point in the middle of the picture, in robot heights."""


class Stage:
    """The robot on its floor in front of a camera; a context manager. Raises RenderingUnavailable without OpenGL."""

    def __init__(self, robot: RobotModel, width: int, height: int, *, smooth: bool = True) -> None:
        """Pictures of width x height pixels; smooth: edges antialiased, at twice the time (0.08 against 0.04 s)."""
        self._physics = Physics(robot, SimSettings())
        self.robot_height = standing_height(robot)
        if width > PICTURE_SIZE[0] or height > PICTURE_SIZE[1]:
            raise ValueError(f"pictures are at most {PICTURE_SIZE[0]} x {PICTURE_SIZE[1]} pixels")
        self._physics.model.vis.quality.offsamples = 4 if smooth else 0
        self._canvas = Canvas(self._physics.model, width, height)
        self._scene = mujoco.MjvScene(self._physics.model, maxgeom=MAX_GEOMS)
        self._camera = mujoco.MjvCamera()
        self._options = mujoco.MjvOption()

    def __enter__(self) -> Stage:
        return self

    def __exit__(self, *_: object) -> None:
        self._canvas.close()

    def draw(
        self,
        pose: tuple[Array, Array, Array],
        centre: Array,
        view: View,
        person: Array | None = None,
        *,
        robot: bool = True,
        opening: Array = CLOSED,
    ) -> Image:
        """Picture (H, W, 3): the robot at pose q (J,) rad, torso (3,) m and (4,), unless ``robot`` is False.

        opening: (2,) of its hands, 0 closed to 1 open. centre: (2,) m, the place on the floor that the camera looks at;
        person: landmarks (19, 3) m as staged.
        """
        self._physics.place(*pose, opening)
        camera = self._camera
        camera.lookat[:] = [*centre, view.height * self.robot_height]
        camera.distance = view.distance * self.robot_height
        camera.azimuth, camera.elevation = view.azimuth, view.elevation
        for group in (SHAPE_GROUP, LOOKS_GROUP):
            self._options.geomgroup[group] = robot
        mujoco.mjv_updateScene(
            self._physics.model,
            self._physics.data,
            self._options,
            None,
            camera,
            mujoco.mjtCatBit.mjCAT_ALL,
            self._scene,
        )
        if person is not None:
            draw_person(self._scene, person)
        return self._canvas.draw(self._scene)


def standing_height(robot: RobotModel) -> float:
    """Height (m) of the robot's highest shape in its stand."""
    physics = Physics(robot, SimSettings())
    stand = robot.postures["stand"]
    physics.place(stand, *stand_on_floor(robot, stand))
    model, data = physics.model, physics.data
    names = [model.geom(shape.name).id for shape in robot.shapes]
    return float(max(data.geom_xpos[geom, 2] + model.geom_rbound[geom] for geom in names))
