"""What the parts of a scenario ask of their numbers."""

from __future__ import annotations


def require(condition: bool, message: str) -> None:  # noqa: FBT001
    """Refuse a value, in words that name its key.

    Raises
    ------
    ValueError
        The condition does not hold.
    """
    if not condition:
        raise ValueError(message)


def require_sizes(owner: object, *names: str) -> None:
    """Refuse standard deviations and sizes below 0.

    Raises
    ------
    ValueError
        One of the named values, or of the values in it, is negative.
    """
    for name in names:
        value = getattr(owner, name)
        values = value if isinstance(value, tuple) else (value,)
        require(min(values, default=0.0) >= 0, f"{name} must not be negative")
