"""Rest-bus simulation: the messages of any nodes of any DBC, with right counters and checksums."""
