"""Two loops that no compiler finds on its own, written in LLVM's vector instructions: eight Hamming distances at once.

``llvm.ctpop`` on a vector of eight 64-bit integers is one instruction with AVX-512 VPOPCNTDQ; on other processors LLVM
writes it out in what they have, so the numbers are the same everywhere.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic as _intrinsic

intrinsic: Any = _intrinsic  # inside a kernel the first argument, the typing context, is not given
_I32, _I64 = ir.IntType(32), ir.IntType(64)
_EIGHT, _EIGHT_IDS = ir.VectorType(_I64, 8), ir.VectorType(_I32, 8)
_SHIFT = ir.Constant(_EIGHT, [32] * 8)
_LARGEST = ir.Constant(_EIGHT, [-1] * 8)
LOCALITY = 2  # the second cache: a list is asked for while the one before it is searched


def _call(builder: Any, name: str, *values: Any) -> Any:
    kind = ir.FunctionType(_EIGHT, [_EIGHT] * len(values))
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v8i64"), values)


def _at(builder: Any, pointer: Any, index: Any) -> Any:
    return builder.gep(pointer, [index if isinstance(index, ir.Value) else ir.Constant(_I64, index)])


def _load(builder: Any, pointer: Any, kind: Any, align: int) -> Any:
    value = builder.load(builder.bitcast(pointer, kind.as_pointer()))
    value.align = align
    return value


def _store(builder: Any, value: Any, pointer: Any) -> None:
    builder.store(value, builder.bitcast(pointer, value.type.as_pointer())).align = 8


def _pointer(context: Any, builder: Any, kind: Any, array: Any) -> Any:
    return context.make_array(kind)(context, builder, array).data


def _query(builder: Any, pointer: Any, offset: Any) -> list[Any]:
    """Return the four 64-bit parts of a query, each repeated eight times."""
    parts, undefined = [], ir.Constant(_EIGHT, ir.Undefined)
    for part in range(4):
        value = builder.load(_at(builder, _at(builder, pointer, offset), part))
        first = builder.insert_element(undefined, value, ir.Constant(_I32, 0))
        parts.append(builder.shuffle_vector(first, undefined, ir.Constant(_EIGHT_IDS, [0] * 8)))
    return parts


def _keys(builder: Any, groups: Any, ids: Any, group: Any, query: list[Any]) -> Any:
    """Return distance << 32 | id of a group's eight descriptors; an id of -1, sign-extended, gives the largest key."""
    base = _at(builder, groups, builder.mul(group, ir.Constant(_I64, 32)))
    distance = None
    for part in range(4):
        bits = builder.xor(_load(builder, _at(builder, base, 8 * part), _EIGHT, 8), query[part])
        count = _call(builder, "ctpop", bits)
        distance = count if distance is None else builder.add(distance, count)
    first = _at(builder, ids, builder.mul(group, ir.Constant(_I64, 8)))
    names = builder.sext(_load(builder, first, _EIGHT_IDS, 4), _EIGHT)
    return builder.or_(builder.shl(distance, _SHIFT), names)


@intrinsic
def keep_two(context, groups, ids, first, count, queries, offset, lanes, at):
    """Compare groups ``first`` to ``first + count`` with the query at ``offset``; update the lanes from ``at`` on.

    ``lanes[at:at + 8]`` are the smallest keys of the eight places so far, ``lanes[at + 8:at + 16]`` the second ones.
    """
    i64 = types.int64
    signature = types.void(groups, ids, i64, i64, queries, i64, lanes, i64)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        arrays = {i: _pointer(context, builder, signature.args[i], arguments[i]) for i in (0, 1, 4, 6)}
        query = _query(builder, arrays[4], arguments[5])
        places = [_at(builder, arrays[6], builder.add(arguments[7], ir.Constant(_I64, shift))) for shift in (0, 8)]
        best = [cgutils.alloca_once_value(builder, _load(builder, place, _EIGHT, 8)) for place in places]
        with cgutils.for_range(builder, arguments[3]) as loop:
            group = builder.add(arguments[2], loop.index)
            _sink(builder, _keys(builder, arrays[0], arrays[1], group, query), best)
        for place, kept in zip(places, best, strict=True):
            _store(builder, builder.load(kept), place)
        return context.get_dummy_value()

    return signature, generate


def _sink(builder: Any, key: Any, best: list[Any]) -> None:
    """Insert a key into sorted registers: each keeps the smaller and hands the larger on."""
    for kept in best:
        old = builder.load(kept)
        builder.store(_call(builder, "umin", old, key), kept)
        key = _call(builder, "umax", old, key)


@intrinsic(prefer_literal=True)
def keep_best(context, groups, ids, count, queries, offset, out, at, depth):
    """Compare the first ``count`` groups with a query; write the ``depth`` smallest keys of each place to ``at``."""
    if not isinstance(depth, types.IntegerLiteral):
        return None
    i64 = types.int64
    signature = types.void(groups, ids, i64, queries, i64, out, i64, depth)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        arrays = {i: _pointer(context, builder, signature.args[i], arguments[i]) for i in (0, 1, 3, 5)}
        query = _query(builder, arrays[3], arguments[4])
        best = [cgutils.alloca_once_value(builder, _LARGEST) for _ in range(depth.literal_value)]
        with cgutils.for_range(builder, arguments[2]) as loop:
            _sink(builder, _keys(builder, arrays[0], arrays[1], loop.index, query), best)
        for i, kept in enumerate(best):
            place = _at(builder, arrays[5], builder.add(arguments[6], ir.Constant(_I64, 8 * i)))
            _store(builder, builder.load(kept), place)
        return context.get_dummy_value()

    return signature, generate


@intrinsic
def prefetch(context, array, index):
    """Ask for the cache line that holds ``array[index]`` ahead of its use."""
    signature = types.void(array, types.int64)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = _at(builder, _pointer(context, builder, signature.args[0], arguments[0]), arguments[1])
        byte = builder.bitcast(place, ir.IntType(8).as_pointer())
        kind = ir.FunctionType(ir.VoidType(), [byte.type, _I32, _I32, _I32])
        function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        builder.call(function, [byte, *(ir.Constant(_I32, value) for value in (0, LOCALITY, 1))])
        return context.get_dummy_value()

    return signature, generate
