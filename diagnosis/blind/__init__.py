"""Blind tests of the diagnosis: `conceal` hides an effect in a recording, `score` compares findings with what was hidden."""
