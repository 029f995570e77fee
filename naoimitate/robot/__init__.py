"""Robots: their model, loaded from data, and the compiled kinematics on it."""

from naoimitate.robot.load import load_robot, robot_names, robot_versions
from naoimitate.robot.model import CouplingTable, Point, RobotModel, Shape, Tree

__all__ = ["CouplingTable", "Point", "RobotModel", "Shape", "Tree", "load_robot", "robot_names", "robot_versions"]
