"""Recordings for other programs' viewers: what is shown is gathered once, and written by one module per viewer."""
