"""How to clear the table: one policy a file, chosen by name."""
