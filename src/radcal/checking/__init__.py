"""Check of a whole case before anything is run: its mistakes, what it will need, and what it will meet."""
