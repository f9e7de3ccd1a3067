"""Read-only arrays with checked shapes, used by every data class of the model."""

from __future__ import annotations

from collections.abc import Hashable
from functools import cache
from typing import Annotated, Any, NamedTuple, cast, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

NAN_IS_NONE = "nan"
"""Marker of a field in which NaN means "there is none"; infinities are refused all the same."""

_DTYPES: list[tuple[Any, type]] = [(Floats, np.float64), (Ints, np.int64), (Bools, np.bool_)]


class FrozenArrays:
    """Base class of frozen data classes with arrays, whose annotations give the shapes.

    ``Annotated[Floats, "n", 3]`` is an array of n rows of three numbers. A letter is any size, the
    same wherever the letter occurs in the class. ``Annotated[tuple[str, ...], "n"]`` are n texts.
    `NAN_IS_NONE` after the shape permits NaN.
    """

    def __post_init__(self) -> None:
        freeze(self)


def freeze(owner: Any, **sizes: int) -> None:
    """Copy all arrays of a frozen dataclass to read-only ones, of the shapes in its annotations.

    Parameters
    ----------
    owner
        The dataclass instance, from its ``__post_init__``.
    **sizes
        Required sizes of letters in the annotations; other letters get the size of the first field
        that uses them.

    Raises
    ------
    ValueError
        A field has another shape, or is not finite; the message names class and field.
    """
    for name, dtype, dimensions, may_be_nan in _array_fields(cast("Hashable", type(owner))):
        if dtype is None:  # a tuple is immutable
            _check_shape(owner, name, (len(getattr(owner, name)),), dimensions, sizes)
            continue
        # copied, so that no array is shared with the caller
        value: NDArray[Any] = np.array(getattr(owner, name), dtype=dtype)
        _check_shape(owner, name, value.shape, dimensions, sizes)
        if dtype is np.float64:  # only floats can be infinite or NaN
            bad = np.isinf(value) if may_be_nan else ~np.isfinite(value)
            if bad.any():
                raise ValueError(
                    f"{type(owner).__name__}.{name}: not finite at index "
                    f"{tuple(int(i) for i in np.argwhere(bad)[0])}"
                )
        value.flags.writeable = False
        object.__setattr__(owner, name, value)


def rows_of(owner: Any, index: Ints, size: str = "n") -> dict[str, Any]:
    """Return selected rows of all fields of one length, by name, for ``dataclasses.replace``.

    Parameters
    ----------
    owner
        A dataclass whose annotations give the shapes of its arrays.
    index
        (m,) rows to select, in their new order.
    size
        Letter of the first axis of those fields.
    """
    return {
        name: getattr(owner, name)[index]
        if dtype
        else tuple(getattr(owner, name)[i] for i in index)
        for name, dtype, dimensions, _ in _array_fields(cast("Hashable", type(owner)))
        if dimensions[0] == size
    }


class _ArrayField(NamedTuple):
    """Field with a shape; its dtype is None where it is a tuple instead of an array."""

    name: str
    dtype: type | None
    dimensions: tuple[int | str, ...]
    may_be_nan: bool


@cache
def _array_fields(owner: Hashable) -> tuple[_ArrayField, ...]:
    return tuple(
        _ArrayField(
            name,
            next((dtype for kind, dtype in _DTYPES if kind == get_args(hint)[0]), None),
            dimensions,
            NAN_IS_NONE in get_args(hint),
        )
        for name, hint in get_type_hints(cast("type", owner), include_extras=True).items()
        if get_origin(hint) is Annotated and (dimensions := _dimensions(hint))
    )


def _dimensions(hint: Any) -> tuple[int | str, ...]:
    """Return the shape in an annotation, which may also hold marks of other kinds."""
    marks = (mark for mark in get_args(hint)[1:] if isinstance(mark, int | str))
    return tuple(mark for mark in marks if mark != NAN_IS_NONE)


def _check_shape(
    owner: Any,
    name: str,
    have: tuple[int, ...],
    dimensions: tuple[int | str, ...],
    sizes: dict[str, int],
) -> None:
    """Compare a shape with its annotation; letters without a size yet take theirs from it."""
    known = [
        size if isinstance(size, int) else sizes.setdefault(size, n)
        for size, n in zip(dimensions, have, strict=False)
    ]
    if len(known) == len(dimensions) and tuple(known) == have:
        return
    want = tuple(d if isinstance(d, int) else sizes.get(d) for d in dimensions)
    raise ValueError(f"{type(owner).__name__}.{name}: expected shape {want}, got {have}")
