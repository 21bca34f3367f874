"""Recordings as users have them, tables, CAN logs, run directories, read into the channels of a model."""
