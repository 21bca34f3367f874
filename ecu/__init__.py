"""The virtual ECU: estimators, limits and the sans-IO cycle; the node is its shell."""
