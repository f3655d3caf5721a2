"""Named tuples of arrays that kernels take by reference.

Numba passes a named tuple by value: every array of it as seven words, on every call, and each
access counts references. With some hundred arrays that costs far more than the work, and minutes of
compilation. A class marked `@by_reference` is passed as one pointer instead, to a block that
describes its arrays; `bundle.field` reads one description from there. Python sees a named tuple.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cached_property
from typing import Any, TypeVar

import di_envs.numerics.kernels  # noqa: F401  # isort: skip (says how Numba loads, so it comes first)
import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.imputils import impl_ret_borrowed
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)

Bundle = TypeVar("Bundle", bound=type)

_WORD = 8  # bytes; everything in a block is made of words
_DATA_WORD = 4  # of those that describe an array: where its elements begin


class BundleType(types.Type):
    """Numba's type of a bundle: its class and the types of its fields."""

    def __init__(self, class_name: str, fields: tuple[tuple[str, Any], ...]) -> None:
        self.types = dict(fields)
        self.offsets: dict[str, int] = {}
        words, data = 0, []
        for name, field in fields:
            self.offsets[name] = words * _WORD
            if isinstance(field, types.Array):
                data.append(words + _DATA_WORD)
            words += _words(field)
        self.data_words = np.array(data, np.intp)  # of a block, those that say where arrays lie
        # short, as it becomes part of the names of all functions that take the bundle
        digest = hashlib.blake2b(repr(fields).encode(), digest_size=6).hexdigest()
        super().__init__(name=f"{class_name}_{digest}")


def _words(field: Any) -> int:
    return 5 + 2 * field.ndim if isinstance(field, types.Array) else 1


# By what tells them apart, since Numba takes milliseconds to work out those of a world, and every
# episode makes new arrays
_BUNDLE_TYPES: dict[tuple[Any, ...], BundleType] = {}
_LAYOUT_FLAGS = 0x001 | 0x002 | 0x100  # of `flags.num`: C order, Fortran's order, aligned


def _kind(value: Any) -> Any:
    """What tells the type of a field from that of others: equal kinds, equal types."""
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim, value.flags.num & _LAYOUT_FLAGS
    return value.bundle_type.name if hasattr(value, "bundle_type") else type(value)


def _type_of_field(owner: str, name: str, value: Any) -> Any:
    """The type of a field; arrays count as writable, so that read-only views compile nothing new.

    Raises:
        TypeError: If the value is neither an array, a bundle, an int nor a float.
    """
    if isinstance(value, np.ndarray):
        array = numba.typeof(value)
        return types.Array(array.dtype, array.ndim, array.layout, aligned=array.aligned)
    if isinstance(value, int):
        return types.int64
    if isinstance(value, float):
        return types.float64
    if hasattr(value, "bundle_address"):
        return value.bundle_type
    raise TypeError(
        f"{owner}.{name} must be an array, a bundle, an int or a float, got {type(value).__name__}"
    )


def _bundle_type(value: Any) -> BundleType:
    """The type of a bundle: worked out once for all that are alike."""
    kinds = (type(value), *map(_kind, value))
    if (found := _BUNDLE_TYPES.get(kinds)) is None:
        owner = type(value).__name__
        fields = zip(value._fields, value, strict=True)
        named = tuple((name, _type_of_field(owner, name, field)) for name, field in fields)
        found = _BUNDLE_TYPES[kinds] = BundleType(owner, named)
    return found


def _block(value: Any) -> np.ndarray[Any, np.dtype[np.int64]]:
    """The words that describe a bundle, laid out as Numba lays out its array structures."""
    words: list[int] = []
    for field in value:
        if isinstance(field, np.ndarray):
            words += [0, 0, field.size, field.itemsize, field.__array_interface__["data"][0]]
            words += [*field.shape, *field.strides]
        elif isinstance(field, int):
            words.append(field)
        elif isinstance(field, float):
            words.append(int(np.float64(field).view(np.int64)))
        else:
            words.append(field.bundle_address)
    return np.array(words, np.int64)


class _ByReference:
    """What `by_reference` adds to a named tuple."""

    @cached_property
    def bundle_type(self) -> BundleType:
        return _bundle_type(self)

    @cached_property
    def bundle_block(self) -> np.ndarray[Any, np.dtype[np.int64]]:
        return _block(self)

    @cached_property
    def bundle_address(self) -> int:
        return int(self.bundle_block.ctypes.data)

    def lie_as(self, like: Any, moved: int) -> None:
        """Takes over the description of a bundle whose arrays are like these, but lie elsewhere.

        Nothing checks that they do. It takes a tenth of the time of describing each array.

        Args:
            like: The other bundle, of the same class.
            moved: How many bytes behind its arrays all of these lie.
        """
        block = like.bundle_block.copy()
        block[like.bundle_type.data_words] += moved
        vars(self).update(bundle_type=like.bundle_type, bundle_block=block)

    def __reduce__(self) -> tuple[Any, ...]:
        fields: Any = self
        return type(self), tuple(fields)  # never the address, which is this process's own


def by_reference(cls: Bundle) -> Bundle:
    """Makes kernels take a NamedTuple class of arrays, numbers and bundles as one pointer."""
    names = {name: getattr(cls, name) for name in ("__module__", "__qualname__", "__doc__")}
    bundle: Any = type(cls.__name__, (_ByReference, cls), names)
    typeof_impl.register(bundle)(lambda value, _context: value.bundle_type)
    return bundle


@register_model(BundleType)
class _BundleModel(models.OpaqueModel):
    """A pointer to the block."""


def unboxed_by(attribute: str) -> Callable[[types.Type, Any, Any], NativeValue]:
    """How a kernel takes what an object's attribute says the address of: as a pointer."""

    def unboxed(_typ: types.Type, value: Any, c: Any) -> NativeValue:
        address = c.pyapi.object_getattr_string(value, attribute)
        pointer = c.pyapi.long_as_voidptr(address)
        c.pyapi.decref(address)
        return NativeValue(pointer, is_error=cgutils.is_not_null(c.builder, c.pyapi.err_occurred()))

    return unboxed


unbox(BundleType)(unboxed_by("bundle_address"))


@infer_getattr
class _BundleAttributes(AttributeTemplate):
    key = BundleType

    def generic_resolve(self, bundle: BundleType, name: str) -> Any:
        return bundle.types.get(name)


@lower_getattr_generic(BundleType)
def _get(context: Any, builder: Any, bundle: BundleType, value: Any, name: str) -> Any:
    field = bundle.types[name]
    at = builder.gep(value, [ir.Constant(ir.IntType(64), bundle.offsets[name])])
    kind = context.get_value_type(field)
    load = builder.load(builder.bitcast(at, kind.as_pointer()))
    # the block never changes while a kernel runs: loads may be merged and moved
    load.set_metadata("invariant.load", builder.module.add_metadata([]))
    return impl_ret_borrowed(context, builder, field, load)
