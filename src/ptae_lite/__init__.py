"""PTAE-lite: bidirectional action-language translation, rebuilt on a laptop.

Data flows one way, and so do the imports: `language`, `robot`, `data`, `vision`, `models`,
`training`, `evaluation`, `experiments`; then `paper`, `plots`, `widgets`, `reproduce` and the book,
which nothing before them imports.

One alphabet of shapes everywhere: `B` batch, `T` frames, `N` tokens, `J` joints (5),
`F` visual features (30), `H` hidden (256), `V` words (23).
"""

__version__ = "0.1.0"
