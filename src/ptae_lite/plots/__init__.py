"""Figures: one module a chapter, and the style that all share."""
