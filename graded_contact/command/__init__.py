"""The command `graded-contact`, a file for each job."""
