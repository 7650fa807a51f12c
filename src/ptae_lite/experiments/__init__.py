"""Experiments: a trained model or a recipe in, a tidy table out."""
