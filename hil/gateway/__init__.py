"""The gateway between the plant's bus and the ECU's: routes, end-to-end checks, injected faults, stamps.

`routes` and `core` are pure: frames and integer nanoseconds in, frames and findings out. `shell` puts
them between two transports.
"""
