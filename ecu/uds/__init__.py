"""Diagnosis on the bus: UDS (ISO 14229-1) on ISO-TP (ISO 15765-2)."""
