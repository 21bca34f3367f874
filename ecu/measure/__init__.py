"""What can be measured in the ECU and what can be calibrated, for XCP, UDS and the A2L file."""
