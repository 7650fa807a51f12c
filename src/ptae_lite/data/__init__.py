"""The recorded samples: loading, splits, scaling, task signals and batches."""
