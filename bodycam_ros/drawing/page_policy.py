"""What a page that we write may do in a browser: show the pictures that are in it, and nothing else."""

PAGE_POLICY = (
    '<meta http-equiv="Content-Security-Policy" '
    "content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'; form-action 'none'\">"
)
"""For the head of a page, before anything else: names of cameras and files come from anywhere."""
