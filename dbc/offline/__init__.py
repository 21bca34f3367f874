"""Recordings of any length decoded piece by piece, into tables on disk."""
