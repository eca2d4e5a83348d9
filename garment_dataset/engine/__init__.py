"""The cached graph of stages: keys, fingerprints, store, plan and run. It knows nothing of garments."""
