"""Recordings held against a contract, and against their own names."""
