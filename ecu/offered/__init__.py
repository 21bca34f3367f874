"""What an ECU offers on the bus beside its cycle, by the user's options."""
