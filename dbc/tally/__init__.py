"""Counts over the frames of a recording, taken piece by piece: gaps, counters and contents of each message.

A count takes pieces of any size and gives what one piece with all frames would give. Its memory does not grow with them.
"""
