"""The recorded samples: loaded, split, scaled, and wired to the task signals in batches."""
