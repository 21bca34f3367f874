"""Nodes that are not ours in a run of the bench: waiting for them, their silences, and duplicate senders."""
