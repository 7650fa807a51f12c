"""A full re-run, compared with the stored files; and a certificate of one run."""
