"""`python -m graded_contact` is the command `graded-contact`."""

from .cli import app

app(prog_name="graded-contact")
