"""The DBC files and everything that turns frames into physical values and back."""
