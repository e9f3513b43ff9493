"""Check of a case before any simulator run: its mistakes, and the runs, memory and time that it will need."""
