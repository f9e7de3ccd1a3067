"""Arrays that cannot change: every data class of the model passes its arrays through here."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def freeze(
    owner: Any, *, may_be_nan: tuple[str, ...] = (), **shapes: tuple[int | None, ...]
) -> None:
    """Copy the named float fields of a frozen dataclass to read-only float64 arrays.

    Parameters
    ----------
    owner
        The dataclass instance, from its ``__post_init__``.
    may_be_nan
        Fields in which NaN stands for "there is none"; infinities are refused all the same.
    **shapes
        Field name and shape; None in a shape stands for any length.

    Raises
    ------
    ValueError
        The field has another shape, or is not finite; the message names class and field.
    """
    for name, shape in shapes.items():
        value = np.array(getattr(owner, name), dtype=np.float64)  # copies: nothing stays aliased
        _check_shape(owner, name, value, shape)
        bad = np.isinf(value) if name in may_be_nan else ~np.isfinite(value)
        if bad.any():
            raise ValueError(
                f"{type(owner).__name__}.{name}: not finite at index "
                f"{tuple(int(i) for i in np.argwhere(bad)[0])}"
            )
        value.flags.writeable = False
        object.__setattr__(owner, name, value)


def freeze_as(owner: Any, dtype: type, **shapes: tuple[int | None, ...]) -> None:
    """Copy the named integer or boolean fields to read-only arrays of `dtype`."""
    for name, shape in shapes.items():
        value: NDArray[Any] = np.array(getattr(owner, name), dtype=dtype)
        _check_shape(owner, name, value, shape)
        value.flags.writeable = False
        object.__setattr__(owner, name, value)


def _check_shape(
    owner: Any,
    name: str,
    value: NDArray[Any],
    shape: tuple[int | None, ...],
) -> None:
    fits = value.ndim == len(shape) and all(
        want is None or want == have for want, have in zip(shape, value.shape, strict=True)
    )
    if not fits:
        raise ValueError(
            f"{type(owner).__name__}.{name}: expected shape {shape}, got {value.shape}"
        )
