"""Contact of a rough rigid surface with a solid given by its kernel. No module knows layers."""
