"""Compiles a function that is written for one machine so that it works on several at once, one in each lane of the processor's vectors."""
