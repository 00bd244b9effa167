"""Spoils good inputs at random: text, YAML trees, raw bytes, and the records and messages inside a bag."""

import json
import random
import struct
from collections.abc import Callable, Sequence
from io import BytesIO
from typing import Any

import numpy as np
import zstandard

from ac_common.yaml_file import parsed, yaml_text

#: Values that a careless or malicious author might put anywhere.
NASTY: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 2**31, 2**63, -(2**63) - 1, 10**400, 1e308, -1e308, 5e-324),
    *(float("nan"), float("inf"), float("-inf")),
    *("", " ", "nan", "1e3", "x" * 5000, "\n", "a\nb: c", "é\u2028☃", "../../x", "!!python/object:os.system x"),
    *([], [[]], {}, {"": ""}, {"kind": None}, [1, "a", None], [{"at_s": 1, "to": float("nan")}], {1: 2}),
)
#: Pieces of text that mean something to a YAML reader.
PIECES = (
    *(":", "- ", "[", "]", "{", "}", "&a ", "*a", "!!int ", "!!binary ", "!x ", "<<: *a", "? ", "|\n", ">\n", "%YAML"),
    *("---\n", "...\n", "\t", "\x00", "\ufeff", "'", '"', "#", "~", "0x", "1:60", "2001-99-99", "9" * 5000, "[" * 3000),
    *(".nan", "-.inf", "1e999", "{{{{", "\\u", "\r", "é", "a: &a [*a]\n", "\n", " "),
)
#: Numbers that a length, a count or an offset in a binary file is better not.
EDGES = (0, 1, 2, 7, 8, 127, 255, 256, 65535, 2**20, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**64 - 1)


def spoiled_text(text: str, rng: random.Random) -> str:
    """`text` with one to four pieces cut out, repeated, replaced or put in."""
    for _ in range(rng.randint(1, 4)):
        start = rng.randrange(len(text) + 1)
        stop = min(len(text), start + rng.choice((0, 1, 1, 3, 10, 60)))
        piece = rng.choice(
            (rng.choice(PIECES), "", text[start:stop] * 2, chr(rng.randrange(1, 0x300)), str(rng.choice(NASTY[:17])))
        )
        text = text[:start] + piece + text[stop:]
    return text


def spoiled_tree(content: Any, rng: random.Random) -> Any:
    """A copy of nested mappings and lists with one entry replaced, removed, doubled or renamed."""
    content = json.loads(json.dumps(content))
    parents = [node for node in _nodes(content) if isinstance(node, dict | list) and node]
    if not parents or rng.random() < 0.03:
        return rng.choice(NASTY)
    parent = rng.choice(parents)
    key = rng.choice(list(parent)) if isinstance(parent, dict) else rng.randrange(len(parent))
    action = rng.random()
    if action < 0.6:
        parent[key] = rng.choice(NASTY)
    elif action < 0.75:
        del parent[key]
    elif isinstance(parent, dict):
        parent[rng.choice((str(key) + "x", "", "seed", "at_s", 7, None, "kind"))] = parent[key]
    else:
        parent.append(parent[key])
    return content


def spoiled_yaml(text: str, rng: random.Random) -> bytes:
    """A YAML document spoiled as text, as a tree, or as bytes."""
    kind = rng.random()
    if kind < 0.45:
        return spoiled_text(text, rng).encode("utf-8", "surrogatepass")
    if kind < 0.9:
        tree = spoiled_tree(parsed(text, "good"), rng)
        return yaml_text(tree).encode("utf-8", "surrogatepass")
    return spoiled_bytes(text.encode(), rng)


def spoiled_bytes(data: bytes, rng: random.Random) -> bytes:
    """`data` with some bytes or numbers changed, a part cut out, doubled or moved, or the end missing."""
    result = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4, 16))):
        if not result:
            break
        at = rng.randrange(len(result))
        action = rng.random()
        if action < 0.4:
            result[at] = rng.randrange(256)
        elif action < 0.65:
            width = rng.choice((1, 2, 4, 8))
            result[at : at + width] = (rng.choice(EDGES) % 256**width).to_bytes(width, "little")
        elif action < 0.75:
            del result[at : at + rng.choice((1, 4, 9, 100))]
        elif action < 0.85:
            part = result[at : at + rng.choice((1, 4, 9, 100))]
            where = rng.randrange(len(result))
            result[where:where] = part
        elif action < 0.95:
            del result[at:]
        else:
            result[at : at + 8] = struct.pack("<d", rng.choice((float("nan"), float("inf"), -1e308, 0.0)))
    return bytes(result)


def spoiled_npz(data: bytes, rng: random.Random) -> bytes:
    """An ``.npz`` file spoiled as bytes, or with one of its arrays missing, of another shape or type, or not finite."""
    if rng.random() < 0.4:
        return spoiled_bytes(data, rng)
    with np.load(BytesIO(data)) as stored:
        arrays = dict(stored)
    name = rng.choice(sorted(arrays))
    array = arrays.pop(name)
    action = rng.randrange(7)
    if action == 0:
        arrays[name + "x"] = array
    elif action == 1:
        arrays[name] = array[..., :-1] if array.ndim else np.zeros(2)
    elif action == 2:
        arrays[name] = np.full_like(array, rng.choice((np.nan, np.inf, 1e308)))
    elif action == 3:
        kinds = ("U8", "S4") if array.dtype.kind == "U" else ("U8", "c16", "i8", "f4")  # words make no numbers
        arrays[name] = array.astype(rng.choice(kinds))
    elif action == 4:
        arrays[name] = array.T[None] if rng.random() < 0.5 else array.ravel()
    elif action == 5:
        arrays[name] = np.zeros((0,) * array.ndim)
    buffer = BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


# ------------------------------------------------------------------------------------------------------------- bags

_MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")
_CHUNK, _METADATA = 0x06, 0x0C
_CHUNK_HEAD = struct.Struct("<QQQII")  # start, end, uncompressed size, CRC, length of the compression's name


def spoiled_bag(data: bytes, rng: random.Random) -> bytes:
    """An MCAP file spoiled at one of its levels: bytes, records, messages within a chunk, what was run."""
    level = rng.random()
    if level < 0.2:
        return spoiled_bytes(data, rng)
    records = _records(data[len(_MAGIC) : -len(_MAGIC)])
    if level < 0.4:
        records = _spoiled_records(records, rng)
    elif level < 0.75:
        _spoil_one(records, _CHUNK, lambda body: _spoiled_chunk(body, rng), rng)
    else:
        _spoil_one(records, _METADATA, lambda body: _spoiled_run(body, rng), rng)
    return _MAGIC + b"".join(_HEAD.pack(opcode, length) + body for opcode, length, body in records) + _MAGIC


def _nodes(content: Any) -> list[Any]:
    children = list(content.values()) if isinstance(content, dict) else content if isinstance(content, list) else []
    return [content, *(node for child in children for node in _nodes(child))]


def _records(data: bytes) -> list[tuple[int, int, bytes]]:
    """(opcode, length as it is to be written, body) of each record."""
    found, at = [], 0
    while at < len(data):
        opcode, length = _HEAD.unpack_from(data, at)
        found.append((opcode, length, data[at + _HEAD.size : at + _HEAD.size + length]))
        at += _HEAD.size + length
    return found


def _spoiled_records(records: Sequence[tuple[int, int, bytes]], rng: random.Random) -> list[tuple[int, int, bytes]]:
    result = list(records)
    for _ in range(rng.randint(1, 3)):
        if not result:
            break
        i = rng.randrange(len(result))
        opcode, length, body = result[i]
        action = rng.randrange(5)
        if action == 0:
            body = spoiled_bytes(body, rng)
            result[i] = (opcode, len(body), body)
        elif action == 1:
            result[i] = (opcode, rng.choice(EDGES), body)
        elif action == 2:
            result[i] = (rng.randrange(256), length, body)
        elif action == 3:
            del result[i]
        else:
            result.insert(rng.randrange(len(result)), result[i])
    return result


def _spoil_one(
    records: list[tuple[int, int, bytes]], opcode: int, spoil: Callable[[bytes], bytes], rng: random.Random
) -> None:
    i = rng.choice([i for i, record in enumerate(records) if record[0] == opcode])
    body = spoil(records[i][2])
    records[i] = (opcode, len(body), body)


def _spoiled_chunk(body: bytes, rng: random.Random) -> bytes:
    """A chunk whose content is spoiled and which is otherwise in order."""
    start, end, size, _, name_length = _CHUNK_HEAD.unpack_from(body)
    at = _CHUNK_HEAD.size + name_length
    name = body[_CHUNK_HEAD.size : at]
    content = zstandard.decompress(body[at + 8 :], size)
    if rng.random() < 0.5:
        content = spoiled_bytes(content, rng)
    else:
        content = b"".join(_HEAD.pack(o, n) + b for o, n, b in _spoiled_records(_records(content), rng))
    packed = zstandard.compress(content)
    size = len(content) if rng.random() < 0.9 else rng.choice(EDGES)
    head = _CHUNK_HEAD.pack(start, end, size, 0, name_length)
    return head + name + struct.pack("<Q", len(packed)) + packed


def _spoiled_run(body: bytes, rng: random.Random) -> bytes:
    """The metadata record that says what was run, with its JSON spoiled."""
    at = body.index(b"{")
    text = body[at:].decode()
    spoiled = spoiled_text(text, rng) if rng.random() < 0.3 else json.dumps(spoiled_tree(json.loads(text), rng))
    value = spoiled.encode("utf-8", "surrogatepass")
    pairs = _string(b"run") + _string(value)
    return _string(b"acftc") + struct.pack("<I", len(pairs)) + pairs


def _string(value: bytes) -> bytes:
    return struct.pack("<I", len(value)) + value
