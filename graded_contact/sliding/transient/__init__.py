"""Contacts in a transient motion."""
