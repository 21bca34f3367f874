"""Campaigns: many runs and one table, each written by one command, with commit and seed in its header."""
