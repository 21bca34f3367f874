"""`loaderhil mqtt`: a bus, decoded, on an MQTT broker."""
