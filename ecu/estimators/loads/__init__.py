"""Where the weight stands: centre of gravity, payload, linkage, wheel normal forces."""
