"""Pages about tests of controllers: conformance, comparison of runs, verification of tests."""
