"""Moving CAN frames: the frame, the transport interface, transports, absolute ticks."""
