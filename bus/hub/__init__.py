"""A CAN bus as a Unix socket: server, client and wire format; for machines without CAN in the kernel."""
