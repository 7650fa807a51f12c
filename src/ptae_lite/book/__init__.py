"""The book as files: its notebooks, its site, its course, and the doctor of its environment."""
