"""Ways to spoil a DICOM series: values of attributes, bytes of headers, pixel streams, files."""

from __future__ import annotations

import random
import struct

from dicom_seeds import Seed, deflate

# Tag, value representation and name of what geometry, grey values and series depend on.
GEOMETRY = [(0x00200032, "DS"), (0x00200037, "DS"), (0x00280030, "DS"), (0x00200052, "UI")]
GREY = [(0x00281053, "DS"), (0x00281052, "DS"), (0x00280120, "US"), (0x00281054, "LO")]
PIXELS = [
    (0x00280002, "US"), (0x00280004, "CS"), (0x00280008, "IS"), (0x00280010, "US"),
    (0x00280011, "US"), (0x00280100, "US"), (0x00280101, "US"), (0x00280102, "US"),
    (0x00280103, "US"),
]  # fmt: skip
IDENTITY = [
    (0x00080008, "CS"), (0x00080016, "UI"), (0x00080018, "UI"), (0x00080060, "CS"),
    (0x0020000E, "UI"), (0x00180050, "DS"), (0x00100020, "LO"), (0x00020010, "UI"),
]  # fmt: skip
_PIXEL_DATA = 0x7FE00010
_LONG = {"OB", "OW", "SQ", "UN", "UT", "OF", "OD", "OL", "UC", "UR"}

_TEXTS = [
    "", " ", "nan", "NaN", "inf", "-inf", "1e400", "-1e308", "1e30", "0", "-0", "1_0", "0x10",
    "1,5", "abc", "\\", "\\\\", "1\\2\\3\\4\\5\\6\\7", "9" * 400, "\0\0", "1e-320", "１", "ÿþ",
]  # fmt: skip
_WORDS = [0, 1, 2, 3, 7, 8, 12, 15, 16, 17, 32, 64, 255, 256, 4096, 32767, 32768, 65535]


class Mutator:
    """Spoils a seed in one or a few ways, all drawn from one generator.

    Parameters
    ----------
    rng : random.Random
    """

    def __init__(self, rng: random.Random) -> None:
        self.rng = rng
        self.did: list[str] = []

    def __call__(self, seed: Seed) -> dict[str, bytes]:
        """Names and contents of the files of a spoiled series."""
        files = [bytearray(file) for file in seed.files]
        rng = self.rng
        # Most often one slice, sometimes all alike, sometimes two.
        draw = rng.random()
        chosen = range(len(files)) if draw < 0.25 else rng.sample(
            range(len(files)), min(2 if draw < 0.35 else 1, len(files))
        )  # fmt: skip
        ways = [
            (10, self._value), (4, self._element), (4, self._bytes), (3, self._length),
            (2, self._insert), (2, self._cut), (5, self._stream), (1, self._nest),
            (1, self._truncate),
        ]  # fmt: skip
        for _ in range(1 if rng.random() < 0.8 else 2):
            way = rng.choices([way for _, way in ways], [weight for weight, _ in ways])[0]
            self.did.append(way.__name__[1:])
            state = rng.getstate()
            for index in chosen:
                rng.setstate(state)
                files[index] = bytearray(way(files[index], seed))
        packed = [deflate(bytes(f)) if seed.deflated and len(f) > 144 else bytes(f) for f in files]
        if seed.deflated and rng.random() < 0.3:
            self.did.append("deflated bytes")
            index = rng.randrange(len(packed))
            packed[index] = bytes(self._bytes(bytearray(packed[index]), seed))
        named = {f"{index:03d}.dcm": file for index, file in enumerate(packed)}
        if rng.random() < 0.06:
            self._files(named)
        return named

    # attributes ---------------------------------------------------------------------------

    def _places(self, file: bytearray, tag: int, vr: str, seed: Seed) -> list[tuple[int, int, int]]:
        """Where a tag stands: of its value, of its length field, and the length."""
        meta = tag >> 16 == 2
        order, explicit = ("<", True) if meta else (seed.order, seed.explicit)
        mark = struct.pack(order + "HH", tag >> 16, tag & 0xFFFF)
        mark += vr.encode() if explicit else b""
        found, at = [], file.find(mark)
        while at >= 0:
            field, kind = (at + 6, "H") if explicit else (at + 4, "L")
            if explicit and vr in _LONG:
                field, kind = at + 8, "L"
            width = struct.calcsize(kind)
            if field + width <= len(file):
                (length,) = struct.unpack_from(order + kind, file, field)
                if field + width + length <= len(file):
                    found.append((field + width, field, length))
            at = file.find(mark, at + 1)
        return found

    def _put(self, file: bytearray, place: tuple[int, int, int], value: bytes, seed: Seed) -> bytes:
        """The file with another value; one in a sequence keeps its length."""
        start, field, length = place
        width = start - field
        nested = b"\xfe\xff\x00\xe0" in file[:start] or b"\xff\xfe\xe0\x00" in file[:start]
        if nested:
            value = value[:length].ljust(length, b" ")
        value += b" " * (len(value) % 2)
        if width == 2 and len(value) > 65534:
            value = value[:65534]
        order = seed.order if start > 300 else "<"
        packed = struct.pack(order + ("H" if width == 2 else "L"), len(value))
        return bytes(file[:field]) + packed + value + bytes(file[start + length :])

    def _value(self, file: bytearray, seed: Seed) -> bytes:
        rng = self.rng
        pool = rng.choices([GEOMETRY, GREY, PIXELS, IDENTITY], [6, 2, 3, 2])[0]
        tag, vr = rng.choice(pool)
        places = self._places(file, tag, vr, seed)
        self.did.append(f"{tag:08x}")
        if not places:
            return self._bytes(file, seed)
        place = rng.choice(places)
        old = bytes(file[place[0] : place[0] + place[2]])
        if vr == "US":
            word = rng.choice(_WORDS) if rng.random() < 0.6 else self._near(old, seed)
            value = struct.pack(seed.order + "H", word % 65536)
            value *= rng.choice([0, 1, 1, 1, 1, 1, 2])
        elif vr == "DS":
            value = self._decimals(old.decode("latin-1")).encode("latin-1", "replace")
        else:
            text = old.decode("latin-1").strip(" \0")
            tail = rng.choice(["", ".1", ".2", ".1.99", ".4.90", ".5", ".4.57"])
            changed = "1.2.840.10008.1.2" + tail
            value = rng.choice(
                [b"", text[:-1].encode("latin-1"), (text + "9").encode("latin-1"), b"X" * 30,
                 changed.encode(), b"ORIGINAL\\PRIMARY\\LOCALIZER", b"MR", b"PALETTE COLOR"]
            )  # fmt: skip
        return self._put(file, place, value, seed)

    def _near(self, old: bytes, seed: Seed) -> int:
        (word,) = struct.unpack_from(seed.order + "H", old.ljust(2, b"\0"))
        return word + self.rng.choice([-1, 1, 2, word, -8])

    def _decimals(self, text: str) -> str:
        """Another list of decimals."""
        rng = self.rng
        parts = text.strip(" \0").split("\\")
        index = rng.randrange(len(parts))
        way = rng.randrange(9)
        try:
            number = float(parts[index])
        except ValueError:
            number = 1.0
        if way == 0:
            parts[index] = rng.choice(_TEXTS)
        elif way == 1:
            other = rng.randrange(len(parts))
            parts[index], parts[other] = parts[other], parts[index]
        elif way == 2:
            factor = rng.choice([-1, 0, 0.5, 0.999, 1.0001, 1.01, 2, 10, 1e6])
            parts = [self._short(float(p) * factor) if _is_number(p) else p for p in parts]
        elif way == 3:
            step = rng.choice([1e-6, 1e-4, 3e-3, 0.02, 0.5, 1.25, -40])
            parts[index] = self._short(number + step)
        elif way == 4:
            parts[index] = self._short(-number)
        elif way == 5:
            parts.insert(index, parts[index])
        elif way == 6:
            del parts[index]
        elif way == 7:
            parts[index] = self._short(number + rng.gauss(0, 1))
        else:
            return rng.choice(_TEXTS)
        return "\\".join(parts)

    @staticmethod
    def _short(number: float) -> str:
        return f"{number:.10g}"[:16]

    def _element(self, file: bytearray, seed: Seed) -> bytes:
        """Delete an element, double it, or write one with another value behind it."""
        rng = self.rng
        tag, vr = rng.choice(GEOMETRY + GREY + PIXELS + IDENTITY)
        places = self._places(file, tag, vr, seed)
        if not places:
            return self._cut(file, seed)
        start, field, length = rng.choice(places)
        head = field - (4 if not seed.explicit and tag >> 16 != 2 else 6)
        whole, end = bytes(file[head : start + length]), start + length
        if rng.random() < 0.5:
            return bytes(file[:head]) + bytes(file[end:])
        if vr == "DS" and length > 3:
            changed = bytearray(whole)
            changed[-2] = rng.choice(b"0123456789")
            whole = bytes(changed)
        return bytes(file[:end]) + whole + bytes(file[end:])

    # bytes --------------------------------------------------------------------------------

    def _pixels_at(self, file: bytearray, seed: Seed) -> int:
        mark = struct.pack(seed.order + "HH", _PIXEL_DATA >> 16, _PIXEL_DATA & 0xFFFF)
        at = file.rfind(mark)
        return at if at >= 0 else len(file)

    def _bytes(self, file: bytearray, seed: Seed) -> bytes:
        """Flip a few bytes of the header."""
        rng = self.rng
        end = max(self._pixels_at(file, seed) + 12, 200)
        for _ in range(rng.choice([1, 1, 1, 2, 4, 16])):
            at = rng.randrange(128, min(end, len(file))) if len(file) > 140 else 0
            file[at] = rng.choice([rng.randrange(256), file[at] ^ (1 << rng.randrange(8)), 0, 255])
        return bytes(file)

    def _length(self, file: bytearray, seed: Seed) -> bytes:
        """Another length of an element, or of the pixels."""
        rng = self.rng
        known = GEOMETRY + GREY + PIXELS + IDENTITY
        pixels = [(_PIXEL_DATA, "OW"), (_PIXEL_DATA, "OW"), (_PIXEL_DATA, "OB")]
        tag, vr = rng.choice(known + pixels)
        places = self._places(file, tag, vr, seed)
        if not places:
            return self._bytes(file, seed)
        start, field, length = rng.choice(places)
        width = start - field
        top = (1 << (8 * width)) - 1
        number = rng.choice([0, 1, 2, length + 1, length + 2, length - 2, length * 2, top, top - 1,
                             top // 2, rng.randrange(top)])  # fmt: skip
        order = seed.order if start > 300 else "<"
        file[field:start] = (number % (top + 1)).to_bytes(
            width, "little" if order == "<" else "big"
        )
        return bytes(file)

    def _insert(self, file: bytearray, seed: Seed) -> bytes:
        rng = self.rng
        at = rng.randrange(132, max(self._pixels_at(file, seed), 134))
        return bytes(file[:at]) + rng.randbytes(rng.choice([1, 2, 8, 64])) + bytes(file[at:])

    def _cut(self, file: bytearray, seed: Seed) -> bytes:
        rng = self.rng
        at = rng.randrange(128, max(self._pixels_at(file, seed), 130))
        return bytes(file[:at]) + bytes(file[at + rng.choice([1, 2, 8, 24]) :])

    def _truncate(self, file: bytearray, seed: Seed) -> bytes:
        rng = self.rng
        if rng.random() < 0.5:
            return bytes(file[: rng.randrange(len(file))])
        return bytes(file[: len(file) - rng.choice([1, 2, 8, 9, 16])])

    def _nest(self, file: bytearray, seed: Seed) -> bytes:
        """A private element before all others: sequences in sequences, or a huge or endless one."""
        rng = self.rng
        start = 144 + int.from_bytes(file[140:144], "little")
        tag = struct.pack(seed.order + "HH", 0x0009, 0x1010)
        item = struct.pack(seed.order + "HHL", 0xFFFE, 0xE000, 0xFFFFFFFF)
        vr = b"SQ\0\0" if seed.explicit else b""
        endless = struct.pack(seed.order + "L", 0xFFFFFFFF)
        way = rng.randrange(3)
        if way == 0:
            added = (tag + vr + endless + item) * rng.choice([10, 300, 2500])
        elif way == 1:
            other = b"OB\0\0" if seed.explicit else b""
            huge = struct.pack(seed.order + "L", rng.choice([0xFFFFFFFE, 1 << 31, 1 << 20]))
            added = tag + other + huge
        else:
            empty = struct.pack(seed.order + "HHL", 0xFFFE, 0xE000, 0)
            added = tag + vr + endless + empty * rng.choice([10, 20_000])
        return bytes(file[:start]) + added + bytes(file[start:])

    def _stream(self, file: bytearray, seed: Seed) -> bytes:
        """Flip bytes of the pixels: their item headers, codestream headers or anything behind."""
        rng = self.rng
        start = self._pixels_at(file, seed)
        if start >= len(file):
            return self._bytes(file, seed)
        near = min(start + rng.choice([40, 120, len(file)]), len(file))
        for _ in range(rng.choice([1, 1, 1, 2, 8])):
            at = rng.randrange(start, near)
            file[at] = rng.choice([rng.randrange(256), file[at] ^ (1 << rng.randrange(8)), 0, 255])
        if rng.random() < 0.15:
            del file[rng.randrange(start, len(file)) :]
        return bytes(file)

    # files --------------------------------------------------------------------------------

    def _files(self, files: dict[str, bytes]) -> None:
        rng = self.rng
        name = rng.choice(sorted(files))
        way = rng.choice(["lost", "doubled", "empty", "stranger"])
        self.did.append(way)
        if way == "lost":
            del files[name]
        elif way == "doubled":
            files["copy.dcm"] = files[name]
        elif way == "empty":
            files[name] = b""
        else:
            files["notes.txt"] = rng.randbytes(300)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
