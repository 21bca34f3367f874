"""Tyre grip, steering lag and sensor lags of a car that motion capture follows."""
