"""Numerics of the depth images, on arrays."""
