"""Small models of published recordings, as a user would write them: one file each, for `loaderhil diagnose --model FILE.py`."""
