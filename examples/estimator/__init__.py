"""An estimator that reads a snapshot with numpy, scipy and pyarrow; nothing of garment_dataset is imported."""
