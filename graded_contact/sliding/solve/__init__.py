"""From a case to its contact: steady, periodic, heated."""
