"""The command `loaderhil`: command line, terminal output and demo; the only place that puts all other folders together."""
