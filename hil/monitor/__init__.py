"""`loaderhil monitor`: what is on a bus or in a recording, raw as candump prints it or decoded."""
