"""Report pages: text, tables and plots as Markdown or as a single HTML file."""
