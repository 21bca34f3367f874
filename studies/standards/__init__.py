"""Tests of the simulated machine against standards for earth-moving machinery: requirement, measured value, verdict.

A requirement whose formula was not read in its source is marked as unverified; its verdict is only indicative.
"""
