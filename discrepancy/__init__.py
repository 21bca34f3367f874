"""Which physics did the simulation leave out? Locate it, name it, fit it, and prove it on data the fit never saw.

The engine is pure and knows no machine: a model (discrepancy.model) is a description and one function.
"""
