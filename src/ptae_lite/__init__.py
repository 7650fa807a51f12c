"""PTAE-lite: bidirectional action-language translation, rebuilt on a laptop.

Data flows one way, and so do the imports: `language`, `robot`, `dataset`, `vision`, `scaling`,
`signals`, `models`, `training`, `evaluation`, `experiments`; then `plots`, `widgets` and the book,
which know the library while the library knows neither.

One alphabet of shapes everywhere: `B` batch, `T` frames, `N` tokens, `J` joints (5),
`F` visual features (30), `H` hidden (256), `V` words (23).
"""

__version__ = "0.1.0"
