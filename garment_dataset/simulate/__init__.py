"""Recordings that a Xtion before a robot could have made, with the truth beside them.

The way in is :func:`garment_dataset.simulate.recording.simulate_recording`. Needs the extra ``simulate`` for anything
with a garment in it.
"""
