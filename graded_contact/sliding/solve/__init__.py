"""From a case to its contact: steady, periodic, transient, heated."""
