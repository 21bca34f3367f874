"""Did everything come in time: deadlines of messages, lateness of processes, waits for a processor, the state of the host."""
