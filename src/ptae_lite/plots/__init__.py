"""Figures: one module a chapter, and the style of all of them."""
