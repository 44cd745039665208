"""A report for people: one page, as Markdown and as HTML."""
