"""Recordings as estimators that work on clouds read them: the garment's points frame by frame, and what moves it."""
