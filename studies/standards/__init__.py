"""Standards for earth-moving machinery as tests of the simulated machine: what each asks for, and what was measured.

A requirement whose formula was not read in its source is marked; its verdict is indicative.
"""
