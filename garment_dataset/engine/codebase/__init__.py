"""First-party code as data: what a function reaches, found by reading the source; nothing is imported."""
