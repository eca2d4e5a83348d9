"""Compare features with the truth of simulated recordings."""
