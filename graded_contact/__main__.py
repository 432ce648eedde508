"""`python -m graded_contact` is the command `graded-contact`."""

from .cli import run_command

run_command()
