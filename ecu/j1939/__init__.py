"""Network management of SAE J1939 for the ECU: its NAME, its address, and answers to requests."""
