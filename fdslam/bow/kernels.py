"""Compiled loops of the word search. Eight Hamming distances at once need LLVM's vector instructions, written out here.

``llvm.ctpop`` on a vector of eight 64-bit integers is one instruction with AVX-512 VPOPCNTDQ; on other processors LLVM
writes it out in what they have, so the numbers are the same everywhere.

What a kernel calls stands in this one file: a compiled kernel is kept on disk until the file that it stands in changes.
Only machines with numba import it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic as _intrinsic

from fdslam.native import njit

intrinsic: Any = _intrinsic  # inside a kernel the first argument, the typing context, is not given
_I32, _I64 = ir.IntType(32), ir.IntType(64)
_EIGHT, _EIGHT_IDS = ir.VectorType(_I64, 8), ir.VectorType(_I32, 8)
_SHIFT = ir.Constant(_EIGHT, [32] * 8)
NONE = np.uint64(0xFFFFFFFFFFFFFFFF)  # the key of nothing, as in hamming.py
HUB_DEPTH = 4  # as in pivots.py
RUN = 16  # blocks searched at once, 18 KB: they stay in the first cache
AHEAD = 16  # blocks that are asked for before the search reaches them
_LOCALITY = 2  # of what is asked for: the second cache


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


def _repeated(builder: Any, value: Any) -> Any:
    """Return a 64-bit integer eight times."""
    undefined = ir.Constant(_EIGHT, ir.Undefined)
    first = builder.insert_element(undefined, value, ir.Constant(_I32, 0))
    return builder.shuffle_vector(first, undefined, ir.Constant(_EIGHT_IDS, [0] * 8))


def _distances(builder: Any, groups: Any, group: Any, query: list[Any]) -> Any:
    """Return the Hamming distances of a group's eight descriptors."""
    base = _at(builder, groups, builder.mul(group, ir.Constant(_I64, 32)))
    distance = None
    for part in range(4):
        bits = builder.xor(_load(builder, _at(builder, base, 8 * part), _EIGHT, 8), query[part])
        count = _call(builder, "ctpop", bits)
        distance = count if distance is None else builder.add(distance, count)
    return distance


def _keys(builder: Any, groups: Any, ids: Any, group: Any, query: list[Any]) -> Any:
    """Return distance << 32 | id of a group's eight descriptors; an id of -1, sign-extended, gives the largest key."""
    distance = _distances(builder, groups, group, query)
    first = _at(builder, ids, builder.mul(group, ir.Constant(_I64, 8)))
    names = builder.sext(_load(builder, first, _EIGHT_IDS, 4), _EIGHT)
    return builder.or_(builder.shl(distance, _SHIFT), names)


@intrinsic
def lanes_within(context, groups, group, q0, q1, q2, q3, limit):
    """Return, as bits of an integer, which of a group's eight descriptors lie within ``limit`` of the query."""
    u64 = types.uint64
    signature = types.uint8(groups, types.int64, u64, u64, u64, u64, u64)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pointer = _pointer(context, builder, signature.args[0], arguments[0])
        distance = _distances(builder, pointer, arguments[1], [_repeated(builder, q) for q in arguments[2:6]])
        near = builder.icmp_unsigned("<=", distance, _repeated(builder, arguments[6]))
        return builder.bitcast(near, ir.IntType(8))

    return signature, generate


@intrinsic
def write_keys(context, groups, ids, group, q0, q1, q2, q3, out):
    """Write the keys of a group's eight descriptors to the beginning of ``out``."""
    u64 = types.uint64
    signature = types.void(groups, ids, types.int64, u64, u64, u64, u64, out)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        arrays = {i: _pointer(context, builder, signature.args[i], arguments[i]) for i in (0, 1, 7)}
        query = [_repeated(builder, q) for q in arguments[3:7]]
        _store(builder, _keys(builder, arrays[0], arrays[1], arguments[2], query), arrays[7])
        return context.get_dummy_value()

    return signature, generate


def _sink(builder: Any, key: Any, best: list[Any]) -> None:
    """Insert a key into sorted registers: each keeps the smaller and hands the larger on."""
    for kept in best:
        old = builder.load(kept)
        builder.store(_call(builder, "umin", old, key), kept)
        key = _call(builder, "umax", old, key)


@intrinsic(prefer_literal=True)
def keep_best(context, groups, ids, begin, end, queries, offset, out, at, depth):
    """Compare groups ``begin`` to ``end`` with a query; update the ``depth`` smallest keys of each place at ``at``."""
    if not isinstance(depth, types.IntegerLiteral):
        return None
    i64 = types.int64
    signature = types.void(groups, ids, i64, i64, queries, i64, out, i64, depth)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        arrays = {i: _pointer(context, builder, signature.args[i], arguments[i]) for i in (0, 1, 4, 6)}
        start = _at(builder, arrays[4], arguments[5])
        query = [_repeated(builder, builder.load(_at(builder, start, part))) for part in range(4)]
        places = [
            _at(builder, arrays[6], builder.add(arguments[7], ir.Constant(_I64, 8 * i)))
            for i in range(depth.literal_value)
        ]
        best = [cgutils.alloca_once_value(builder, _load(builder, place, _EIGHT, 8)) for place in places]
        with cgutils.for_range_slice(builder, arguments[2], arguments[3], ir.Constant(_I64, 1)) as (group, _):
            _sink(builder, _keys(builder, arrays[0], arrays[1], group, query), best)
        for place, kept in zip(places, best, strict=True):
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
        builder.call(function, [byte, *(ir.Constant(_I32, value) for value in (0, _LOCALITY, 1))])
        return context.get_dummy_value()

    return signature, generate


@njit
def scan(groups, ids, begin, end, queries, offset, leave, out, at, keys):
    """Compare groups ``begin`` to ``end`` with the query at ``offset`` and update its two smallest keys at ``out[at]``.

    Ids from ``leave[at // 2, 0]`` to before ``leave[at // 2, 1]`` are passed over; for None numba compiles code of its
    own, without the question. Few groups hold a descriptor nearer than the second best so far; only their keys are
    looked at one by one.
    """
    q0, q1, q2, q3 = queries[offset], queries[offset + 1], queries[offset + 2], queries[offset + 3]
    first = out[at]
    second = out[at + 1]
    limit = second >> np.uint64(32)
    for group in range(begin, end):
        if lanes_within(groups, group, q0, q1, q2, q3, limit) != 0:
            write_keys(groups, ids, group, q0, q1, q2, q3, keys)
            for lane in range(8):
                key = keys[lane]
                if leave is not None:
                    name = np.int64(key & np.uint64(0xFFFFFFFF))
                    if leave[at // 2, 0] <= name < leave[at // 2, 1]:
                        continue
                if key < first:
                    second = first
                    first = key
                elif key < second:
                    second = key
            limit = second >> np.uint64(32)
    out[at] = first
    out[at + 1] = second


@njit
def two_nearest_kernel(groups, ids, queries, leave, out):
    """Update the two smallest keys of every query by all groups; a tile of 16 KB at a time stays in the first cache."""
    count, total = len(queries) // 4, len(ids) // 8
    keys = np.empty(8, np.uint64)
    for begin in range(0, total, 64):
        for i in range(count):
            scan(groups, ids, begin, min(begin + 64, total), queries, 4 * i, leave, out, 2 * i, keys)


@njit
def nearest_pivots_kernel(hubs, hub_ids, groups, ids, begins, queries, depth, out):
    """Write the ``depth`` smallest keys of each of the eight places; every depth is code of its own."""
    visited = np.empty(8 * HUB_DEPTH, np.uint64)
    out[:] = NONE
    for i in range(len(queries) // 4):
        visited[:] = NONE
        keep_best(hubs, hub_ids, 0, len(hub_ids) // 8, queries, 4 * i, visited, 0, HUB_DEPTH)
        at = i * 8 * depth
        for key in visited:
            if key == NONE:
                continue
            hub = np.int64(key & np.uint64(0xFFFFFFFF))
            begin, end = begins[hub], begins[hub + 1]
            if depth == 1:
                keep_best(groups, ids, begin, end, queries, 4 * i, out, at, 1)
            elif depth == 2:
                keep_best(groups, ids, begin, end, queries, 4 * i, out, at, 2)
            elif depth == 4:
                keep_best(groups, ids, begin, end, queries, 4 * i, out, at, 4)
            else:
                keep_best(groups, ids, begin, end, queries, 4 * i, out, at, 8)


@njit
def count_ones(rows, mine, ones):
    """Add the bits of every row (uint8 [n, 32]) to those of its centre (int32 [count, 256])."""
    for i in range(len(rows)):
        for byte in range(32):
            value = rows[i, byte]
            for bit in range(8):
                ones[mine[i], 8 * byte + bit] += (value >> (7 - bit)) & 1


@njit
def search_lists(groups, ids, following, first, last, fill, queries, leave, wanting, begins, out):
    """Update the two smallest keys of every query by the lists it wants, list after list.

    The blocks to come are asked for little by little while those before them are searched: to wait for memory would
    take as long as the search.
    """
    keys = np.empty(8, np.uint64)
    visited = np.empty(len(following), np.int32)
    starts = np.zeros(len(first) + 1, np.int64)
    count = 0
    for chain in range(len(first)):
        if begins[chain] < begins[chain + 1]:
            block = first[chain]
            while block >= 0:
                visited[count] = block
                count += 1
                block = following[block]
        starts[chain + 1] = count
    asked = 0  # lines of 64 bytes, 16 to a block
    for chain in range(len(first)):
        begin = begins[chain]
        end = begins[chain + 1]
        i = starts[chain]
        while i < starts[chain + 1]:
            j = i + 1  # the end of a run of blocks that lie side by side
            while j < starts[chain + 1] and visited[j] == visited[j - 1] + 1 and j - i < RUN:
                j += 1
            tail = (fill[chain] + 7) // 8 if visited[j - 1] == last[chain] else 4
            end_group = 4 * visited[j - 1] + tail
            line = asked
            asked = 16 * min(j + AHEAD, count)
            share = (asked - line) // (end - begin) + 1
            for w in range(begin, end):
                for ahead in range(line, min(line + share, asked)):
                    prefetch(groups, 128 * visited[ahead // 16] + 8 * (ahead % 16))
                line += share
                query = wanting[w]
                scan(groups, ids, 4 * visited[i], end_group, queries, 4 * query, leave, out, 2 * query, keys)
            i = j
