"""The ECU as a service of a Linux computer on a CAN bus: its settings, the check before it sends, the files for systemd."""
