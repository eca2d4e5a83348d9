"""Numerics of the colour images, on arrays."""
