"""To trust what the book says: its state here, a full re-run, and a certificate of one."""
