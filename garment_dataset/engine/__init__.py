"""The cached graph of stages: keys, fingerprints, store, plan and run. It knows subjects and sources, and nothing of what they are."""
