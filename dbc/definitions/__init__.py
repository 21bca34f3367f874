"""What DBC files say, as plain data: read, limited, and kept from one start to the next."""
