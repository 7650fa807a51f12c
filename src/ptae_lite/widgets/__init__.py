"""Panels with sliders, the 3-D scene, and what else a reader can touch."""
