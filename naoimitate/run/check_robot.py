"""What was recognised of a robot, in words and as a picture: its shapes, points and soles in its postures."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from naoimitate.core.frames import Array
from naoimitate.core.geometry import convex_hull
from naoimitate.robot.model import RobotModel, Shape
from naoimitate.run.figures import LEFT, RIGHT
from naoimitate.run.overlap import nearest_pairs
from naoimitate.run.replay import Replay, place, replay

CIRCLE = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
VIEWS = (("from the front", np.array([0.0, 1.0, 0.0])), ("from its right", np.array([1.0, 0.0, 0.0])))
"""Name of a view and the world's direction that points to the right in the picture."""
DRAWN = ("zero", "stand", "calibration")
"""Postures that every robot has, and that are drawn."""
UPRIGHT = np.array([[1.0, 0.0, 0.0, 0.0]])


def describe_robot(robot: RobotModel) -> list[str]:
    """What is known about a robot, a line each."""
    shared = [f"{robot.joint_names[b]} = {robot.joint_names[a]}" for a, b in robot.coupled]
    outline = robot.soles["l"]
    lengths = ", ".join(f"{name} {length:.3f} m" for name, length in robot.limb_length.items())
    lines = [
        f"{robot.name} {robot.version}: {robot.mass:.3f} kg, {len(robot.joint_names)} joints",
        f"  chains: {', '.join(f'{name} {len(joints)}' for name, joints in robot.chains.items())}",
        f"  joints of one motor: {', '.join(shared) or 'none'}; coupling tables: {len(robot.tables)}",
        f"  limbs: {lengths}",
        f"  soles: {np.ptp(outline[:, 0]):.3f} m long, {np.ptp(outline[:, 1]):.3f} m wide, {len(outline)} corners",
        f"  shapes: {len(robot.shapes)}, pairs that must not overlap: {len(robot.pairs)}",
    ]
    for name, q in robot.postures.items():
        pose = standing_pose(robot, q)
        both = 1000.0 * float(pose.margins(np.array(["D"]))[0])
        nearest = 1000.0 * float(nearest_pairs(robot, pose)[0])
        near = "nothing near" if np.isinf(nearest) else f"nearest shapes {nearest:+.1f} mm"
        lines.append(f"  posture {name}: centre of mass {both:+.1f} mm inside the soles' hull, {near}")
    return lines


def picture_robot(robot: RobotModel) -> Figure:
    """The robot in its main postures, from two sides, all to one scale."""
    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    grid = figure.subplots(len(VIEWS), len(DRAWN), squeeze=False, sharex=True, sharey=True)
    for column, name in enumerate(DRAWN):
        pose = standing_pose(robot, robot.postures[name])
        for row, (view, right) in enumerate(VIEWS):
            _draw(grid[row][column], robot, pose, right)
            grid[row][column].set_title(f"{name}, {view}", fontsize=10)
    figure.suptitle(f"{robot.name} {robot.version}, lengths in m")
    return figure


def standing_pose(robot: RobotModel, q: Array) -> Replay:
    """The pose at joint angles q (J,) rad with the torso upright and the lowest sole on the floor."""
    pose = replay(robot, q[None], np.zeros((1, 3)), UPRIGHT)
    height = -min(float(pose.low(0)[0]), float(pose.low(1)[0]))
    return replay(robot, q[None], np.array([[0.0, 0.0, height]]), UPRIGHT)


def _draw(axes: Axes, robot: RobotModel, pose: Replay, right: Array) -> None:
    for shape in robot.shapes:
        outline = _outline(shape, pose, right)
        axes.add_patch(Polygon(convex_hull(outline), facecolor="#c9d2da", edgecolor="#66737f", alpha=0.6))
    for name in robot.points:
        at = pose.base_pos[0] + place(robot, pose, name)[0]
        colour = {"l_": LEFT, "r_": RIGHT}.get(name[:2], "#444444")
        axes.plot(at @ right, at[2], ".", color=colour, ms=5)
    com = pose.com[0]
    axes.plot([com @ right] * 2, [0.0, com[2]], color="#c0392b", lw=1, marker="x", ms=4)
    axes.axhline(0.0, color="#888888", lw=1)
    axes.set(aspect="equal")
    axes.autoscale_view()


def _outline(shape: Shape, pose: Replay, right: Array) -> Array:
    """Points in the picture's plane whose convex hull is the outline of a shape, (N, 2) m."""
    row = shape.joint + 1
    axis = np.stack([right, [0.0, 0.0, 1.0]])
    rot, at = axis @ pose.links_rot[0, row], axis @ (pose.base_pos[0] + pose.links_pos[0, row])
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    corners = [p + signs * shape.half for p in (shape.p0, shape.p1)]
    flat = np.concatenate(corners) @ rot.T + at
    circle = max(shape.radius, 1e-6) * np.column_stack([np.cos(CIRCLE), np.sin(CIRCLE)])
    return np.asarray((flat[:, None] + circle).reshape(-1, 2))
