"""Page shell, styles, plots and formulas that every HTML page is made of; knows no run and no machine."""
