"""PTAE-lite: bidirectional action-language translation, rebuilt on a laptop.

Data flows one way, and so do the imports: `language`, `robot`, `data`, `vision`, `models`,
`training`, `evaluation`, `experiments`; then `paper`, `plots`, `widgets`, `reproduce` and the book,
which nothing before them imports.

One alphabet of shapes everywhere: `B` batch, `T` frames, `N` tokens, `J` joints (5),
`F` visual features (30), `H` hidden (256), `V` words (23).
"""

from contextlib import suppress
from pathlib import Path

__version__ = "0.1.0"


def _belongs_here(package: Path, folder: Path) -> None:
    """Raise `ImportError` where `folder` lies in a project that has a library of its own.

    A project that was copied, or cloned twice, would else run the code and the data of the other.
    """
    for project in (folder, *folder.parents):
        own = project / "src" / "ptae_lite"
        if (own / "__init__.py").is_file():
            if not own.samefile(package):
                raise ImportError(
                    f"{project} has a ptae_lite of its own, but this Python has found the one in "
                    f"{package.parent}; use python3 run.py there, or install the one that you "
                    f'mean: python -m pip install --no-deps -e "{project}"',
                    name="ptae_lite",
                )
            return


with suppress(FileNotFoundError):  # a shell may stand in a folder that is gone
    _belongs_here(Path(__file__).parent, Path.cwd())
