"""Names that have moved: the old ones work until the next major version."""

import warnings


def has_moved(old: str, new: str) -> None:
    """Warns that a name has moved; the old one works until version 2."""
    warnings.warn(
        f"`{old}` is `{new}` now; the old name goes in version 2.", FutureWarning, stacklevel=3
    )
