"""The bench: lockstep, processes in real time, gateway, faults, recording, replay, check, monitor, MQTT."""
