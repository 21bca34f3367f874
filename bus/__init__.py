"""CAN buses for every other package: the frame, the transport interface, its implementations, and periodic ticks."""
