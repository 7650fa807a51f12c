"""What a reader sees: figures, panels with sliders, the 3-D scene, and the book's notebooks.

This part knows the library; the library does not know it.
"""

import os


def is_static() -> bool:
    """Whether this runs for a page without a kernel: `PTAE_STATIC=1`, as the site's build sets."""
    return os.environ.get("PTAE_STATIC") == "1"
