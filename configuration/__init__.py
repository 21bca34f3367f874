"""Checked reading of TOML files, for whoever has a configuration: plant, ECU, faults, campaigns. Imports only `bus.user_error`."""

from configuration.kinds import reader_of, tables_of
from configuration.table import Change, CheckedTable, ConfigurationError, find_file, read_toml

__all__ = ["Change", "CheckedTable", "ConfigurationError", "find_file", "read_toml", "reader_of", "tables_of"]
