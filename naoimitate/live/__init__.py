"""Live teleoperation: from a stream of motion capture to a robot that follows it."""
