"""A finding put to work: machine file, calibration, model extension and effect file written from findings.json."""
