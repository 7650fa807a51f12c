"""PTAE-lite: bidirectional action-language translation, rebuilt on a laptop.

Data flow one way through the parts of the library, and so do the imports: `language`, `robot`,
`data`, `vision`, `models`, `training`, `evaluation`, `experiments`. After these come `paper`,
`plots`, `widgets`, `reproduce` and `book`; no earlier part imports them.

All shapes use one alphabet: `B` batch, `S` samples (864), `T` frames, `N` tokens, `J` joints (5),
`F` visual features (30), `H` hidden (256), `V` words (23).
"""

from contextlib import suppress
from pathlib import Path

__version__ = "0.1.0"


def _belongs_here(package: Path, folder: Path) -> None:
    """Raise `ImportError` if `folder` lies in a project that has its own copy of this library.

    Otherwise a copied project, or a second clone, would run the code and the data of the first.
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
