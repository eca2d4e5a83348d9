"""Results, read back and compared."""
