"""Roll-over margin and its prediction, permitted articulation rate and speed, turning torque."""
