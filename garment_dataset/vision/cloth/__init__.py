"""Cloth as a whole: its visible patch, carried through a recording, and points that stay on it."""
