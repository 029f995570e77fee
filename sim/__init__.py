"""The robot in MuJoCo: model, driver, simulation of a plan, pictures."""
