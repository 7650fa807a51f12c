"""Everything made anew and compared with what is stored; and a certificate of one run."""
