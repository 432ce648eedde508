"""`python -m graded_contact` is the command `graded-contact`."""

from .command.app import run_command

run_command()
