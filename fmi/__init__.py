"""Models from elsewhere and to elsewhere by FMI 2.0 and 3.0 co-simulation: an FMU as model of a diagnosis or as plant, our plant as FMU."""
