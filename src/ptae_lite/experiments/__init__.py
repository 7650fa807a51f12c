"""Experiments: each trains or loads models, scores them, and writes a table."""
