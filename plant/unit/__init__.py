"""The machine on the bus: driver, script, actuators, limits, sensors and the frames they travel in."""
