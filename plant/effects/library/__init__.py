"""One left-out effect per file. Every module here that defines EFFECT is found by itself."""
