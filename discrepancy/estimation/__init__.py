"""Parameter estimation: simulated windows, noise model, fit, normal equations."""
