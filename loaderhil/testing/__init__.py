"""Commands that test a controller: conform, restbus, compare, verify."""
