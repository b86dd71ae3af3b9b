"""A diagnosis as text, tables, pictures and a page."""
