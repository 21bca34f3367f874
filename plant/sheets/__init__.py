"""Machine sheets: TOML files read and checked, and single keys laid over them."""
