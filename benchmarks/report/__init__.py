"""What a reader opens after a run: tables, plots and words, as Markdown and as one page."""
