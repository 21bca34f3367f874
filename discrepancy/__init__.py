"""Which physics did the simulation leave out? Locate, name and fit the missing effect, and prove it on data that the fit has not seen.

The engine is pure and knows no machine: a model (discrepancy.model.description) is a description and one function.
"""
