"""Diagnosis for users: recordings and a model in, findings on the terminal, in findings.json and as one HTML page out."""
