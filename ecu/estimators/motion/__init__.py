"""How the machine moves: accelerations, speed, planar motion, tilt."""
