"""The person: segment masses, centre of mass, posture, support estimate, and a procedural person."""
