"""From a folder of recordings to summaries: which commands are to be run, and which of them are done already."""
