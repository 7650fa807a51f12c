"""How annotations are checked while the tests run; `conftest.py` installs it."""

from beartype import BeartypeConf, beartype

# As in Python's own typing rules, an int will do where a float is asked for.
checked = beartype(conf=BeartypeConf(is_pep484_tower=True))
