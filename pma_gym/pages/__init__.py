"""Pages that a reader opens: words, tables and plots as Markdown or as one file of HTML."""
