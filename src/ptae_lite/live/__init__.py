"""Live parts of the site: models that run in the page, by scripts of ours and of others."""
