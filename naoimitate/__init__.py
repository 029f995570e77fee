"""Live imitation of a person by a small humanoid, statically stable by a stated margin."""
