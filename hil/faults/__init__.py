"""Faults that the bench puts between plant and ECU: scripted in a scenario, or live by command."""
