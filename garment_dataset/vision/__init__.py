"""Numerics on arrays: no files, no tables. Missing is NaN, lengths are metres, pixels count from 0."""
