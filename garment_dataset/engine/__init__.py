"""The cached graph of stages: keys, fingerprints, store, plan, run; of subjects and sources, whatever they are."""
