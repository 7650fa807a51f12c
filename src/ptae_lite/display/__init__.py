"""What a reader sees: figures, panels with sliders, the 3-D scene, and the book's notebooks.

This part knows the library; the library does not know it.
"""
