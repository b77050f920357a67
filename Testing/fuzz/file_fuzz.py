"""NRRD, NIfTI and MetaImage files: written, spoiled and read again without any image library."""

from __future__ import annotations

import gzip
import random
import re
import struct
import zlib
from pathlib import Path

import numpy as np

SIZE = (5, 4, 3)
_SIGNS = {
    "left-posterior-superior": (1, 1, 1), "lps": (1, 1, 1),
    "right-anterior-superior": (-1, -1, 1), "ras": (-1, -1, 1),
    "left-anterior-superior": (1, -1, 1), "las": (1, -1, 1),
}  # fmt: skip
_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "um": 1e-3, "µm": 1e-3}
_NRRD_TYPES = {
    "i1": ("signed char", "int8", "int8_t"),
    "u1": ("uchar", "unsigned char", "uint8", "uint8_t"),
    "i2": ("short", "short int", "signed short", "signed short int", "int16", "int16_t"),
    "u2": ("ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"),
    "i4": ("int", "signed int", "int32", "int32_t"),
    "u4": ("uint", "unsigned int", "uint32", "uint32_t"),
    "i8": ("longlong", "long long", "long long int", "signed long long", "int64", "int64_t"),
    "u8": ("ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"),
    "f4": ("float",),
    "f8": ("double",),
}
_META_TYPES = {
    "MET_CHAR": "i1", "MET_UCHAR": "u1", "MET_SHORT": "i2", "MET_USHORT": "u2", "MET_INT": "i4",
    "MET_UINT": "u4", "MET_LONG_LONG": "i8", "MET_ULONG_LONG": "u8", "MET_FLOAT": "f4",
    "MET_DOUBLE": "f8",
}  # fmt: skip
_NIFTI_TYPES = {2: "u1", 4: "i2", 8: "i4", 16: "f4", 64: "f8", 256: "i1", 512: "u2", 768: "u4",
                1024: "i8", 1280: "u8"}  # fmt: skip


def _voxels() -> np.ndarray:
    k, j, i = np.meshgrid(*(np.arange(n) for n in SIZE[::-1]), indexing="ij")
    return (100 * k + 10 * j + i - 1000).astype("<i2")


def _axes(number: int) -> np.ndarray:
    turned, _ = np.linalg.qr(np.random.default_rng(number).normal(size=(3, 3)))
    return turned * np.array([0.7, 0.45, 1.25])


def _row(values) -> str:
    return ",".join(f"{value:.9g}" for value in values)


def _nrrd(
    number: int, encoding: str, data_file: str | None = None, space: str = "RAS"
) -> tuple[bytes, bytes]:
    axes = _axes(number)
    fields = [
        "NRRD0005", "type: short", "dimension: 3", f"space: {space}",
        f"sizes: {SIZE[0]} {SIZE[1]} {SIZE[2]}",
        "space directions: " + " ".join(f"({_row(axes[:, n])})" for n in range(3)),
        "kinds: domain domain domain", "endian: little", f"encoding: {encoding}",
        "space origin: (-30.25,12.5,400)",
    ]  # fmt: skip
    if data_file:
        fields.append(f"data file: {data_file}")
    raw = _voxels().tobytes()
    body = {
        "raw": raw,
        "gzip": gzip.compress(raw, mtime=0),
    }[encoding]
    return "\n".join(fields).encode() + b"\n\n", body


def _meta(number: int, *, packed: bool, data_file: str = "LOCAL") -> tuple[bytes, bytes]:
    axes = _axes(number)
    pitch = np.linalg.norm(axes, axis=0)
    body = _voxels().tobytes()
    fields = ["ObjectType = Image", "NDims = 3"]
    fields += ["BinaryData = True", "BinaryDataByteOrderMSB = False"]
    if packed:
        body = zlib.compress(body)
        fields += ["CompressedData = True", f"CompressedDataSize = {len(body)}"]
    fields += [
        "TransformMatrix = " + " ".join(f"{v:.12g}" for v in (axes / pitch).T.ravel()),
        "Offset = -30.25 12.5 400", "CenterOfRotation = 0 0 0", "AnatomicalOrientation = RAI",
        "ElementSpacing = " + " ".join(f"{v:.12g}" for v in pitch),
        "DimSize = " + " ".join(map(str, SIZE)), "ElementType = MET_SHORT",
        f"ElementDataFile = {data_file}",
    ]  # fmt: skip
    return "\n".join(fields).encode() + b"\n", body


def _nifti(number: int, order: str) -> bytes:
    axes = _axes(number) * np.array([[-1], [-1], [1]])
    head = bytearray(352)
    struct.pack_into(order + "i", head, 0, 348)
    struct.pack_into(order + "8h", head, 40, 3, *SIZE, 1, 1, 1, 1)
    struct.pack_into(order + "2h", head, 70, 4, 16)
    struct.pack_into(order + "8f", head, 76, 1, *np.linalg.norm(axes, axis=0), 0, 0, 0, 0)
    struct.pack_into(order + "3f", head, 108, 352, 1.0, 0.0)
    head[123] = 2
    struct.pack_into(order + "2h", head, 252, 0, 1)
    affine = np.c_[axes, [30.25, -12.5, 400]]
    struct.pack_into(order + "12f", head, 280, *affine.ravel())
    head[344:348] = b"n+1\0"
    return bytes(head) + _voxels().astype(order + "i2").tobytes()


def file_seeds() -> dict[str, dict[str, bytes]]:
    """Name of the seed to its files; the first is the one that is opened."""
    head, body = _nrrd(24, "raw", "image.raw")
    meta_head, meta_body = _meta(27, packed=False, data_file="image.raw")
    return {
        "nrrd-raw": {"image.nrrd": b"".join(_nrrd(21, "raw"))},
        "nrrd-gzip": {"image.nrrd": b"".join(_nrrd(22, "gzip"))},
        "nrrd-space": {"image.nrrd": b"".join(_nrrd(23, "raw", space="left-posterior-superior"))},
        "nhdr": {"image.nhdr": head, "image.raw": body},
        "mha": {"image.mha": b"".join(_meta(25, packed=False))},
        "mha-packed": {"image.mha": b"".join(_meta(26, packed=True))},
        "mhd": {"image.mhd": meta_head, "image.raw": meta_body},
        "nii": {"image.nii": _nifti(28, "<")},
        "nii-big": {"image.nii": _nifti(29, ">")},
        "nii-gz": {"image.nii.gz": gzip.compress(_nifti(30, "<"), mtime=0)},
    }


# spoiling ---------------------------------------------------------------------------------

_WORDS = [
    "nan", "inf", "-1", "0", "1e30", "1e-30", "2", "4", "short", "ushort", "float", "double",
    "MET_FLOAT", "MET_USHORT", "big", "True", "False", "none", "left-anterior-superior",
    "scanner-xyz", "gzip", "hex", "bzip2", "raw", "../image.raw", "LIST", "image%d.raw 1 3 1",
    "(1,0,0)", "", "99999999999", "1_0", "1,5", "cell", '"cm" "cm" "cm"', '"mm" "mm" "cm"',
]  # fmt: skip
_LINES = [
    b"space units: \"cm\" \"cm\" \"cm\"", b"line skip: 1", b"byte skip: 2", b"byte skip: -1",
    b"spacings: 1 1 1", b"centers: cell cell cell", b"measurement frame: (0,1,0) (1,0,0) (0,0,1)",
    b"DistanceUnits = cm", b"HeaderSize = 2", b"HeaderSize = -1", b"ElementNumberOfChannels = 2",
    b"BinaryData = False", b"ElementByteOrderMSB = True", b"Orientation = 1 0 0 0 1 0 0 0 1",
    b"Position = 0 0 0", b"key:=value", b"# comment", b"block size: 2", b"old min: 0", b"",
    b"ElementToIntensityFunctionSlope = 2", b"ElementMin = 0", b"labels: \"a\" \"b\" \"c\"",
]  # fmt: skip


def spoil(files: dict[str, bytes], rng: random.Random, did: list[str]) -> dict[str, bytes]:
    """The files of a seed with a spoiled header, or spoiled data."""
    spoiled = dict(files)
    name = rng.choice(list(files)) if rng.random() < 0.15 else next(iter(files))
    content = spoiled[name]
    packed = name.endswith(".gz") and rng.random() < 0.75
    if packed:
        content = gzip.decompress(content)
    for _ in range(rng.choice([1, 1, 1, 2])):
        if ".nii" in name:
            spoil_it = _spoil_nifti if rng.random() < 0.8 else _flip
            content = spoil_it(content, rng, did)
        elif not name.endswith(".raw") and rng.random() < 0.75:
            content = _spoil_text(content, rng, did)
        else:
            content = _flip(content, rng, did)
    spoiled[name] = gzip.compress(content, mtime=0) if packed else content
    if len(files) > 1 and rng.random() < 0.03:
        did.append("lost")
        del spoiled[list(files)[1]]
    return spoiled


def _spoil_text(content: bytes, rng: random.Random, did: list[str]) -> bytes:
    """Change a line of a text header."""
    end = content.find(b"\n\n") if content.startswith(b"NRRD") else content.find(b"ElementDataFile")
    lines = content[: end if end > 0 else 200].split(b"\n")
    rest = content[end if end > 0 else 200 :]
    index = rng.randrange(len(lines))
    ways = ["drop", "double", "move", "number", "number", "number", "word", "add", "case"]
    way = rng.choice(ways)
    did.append(way)
    if way == "drop":
        del lines[index]
    elif way == "double":
        lines.insert(index, lines[index])
    elif way == "move":
        lines.insert(rng.randrange(len(lines)), lines.pop(index))
    elif way == "add":
        lines.insert(max(index, 1), rng.choice(_LINES))
    elif way == "case":
        lines[index] = lines[index].swapcase()
    else:
        pattern = rb"[-+0-9.e]+" if way == "number" else rb"[^ :=(),]+"
        spots = list(re.finditer(pattern, lines[index]))
        if spots:
            spot = rng.choice(spots)
            new = rng.choice(_WORDS).encode()
            if way == "number" and rng.random() < 0.7:
                try:
                    factor = rng.choice([-1, 0, 0.5, 1.0001, 2, 1e6])
                    new = f"{float(spot.group()) * factor:.9g}".encode()
                except ValueError:
                    new = b"7"
            lines[index] = lines[index][: spot.start()] + new + lines[index][spot.end() :]
    return b"\n".join(lines) + rest


def _spoil_nifti(content: bytes, rng: random.Random, did: list[str]) -> bytes:
    """Write another number into a field of the header."""
    did.append("field")
    data = bytearray(content)
    order = "<" if data[0] == 92 else ">"
    if len(data) < 352:
        return bytes(data)
    at, kind = rng.choice(
        [(40 + 2 * rng.randrange(5), "h"), (70, "h"), (72, "h"), (76 + 4 * rng.randrange(4), "f"),
         (108, "f"), (112, "f"), (116, "f"), (123, "B"), (252, "h"), (254, "h"),
         (256 + 4 * rng.randrange(6), "f"), (280 + 4 * rng.randrange(12), "f"), (344, "B"),
         (0, "i")]
    )  # fmt: skip
    if kind == "f":
        number = rng.choice([0, 1, -1, 2, 0.5, 352, 360, 1e30, float("nan"), float("inf"), 0.01])
    else:
        number = rng.choice([0, 1, 2, 3, 4, 5, 8, 16, 32, 64, 127])
    struct.pack_into(order + kind, data, at, number)
    return bytes(data)


def _flip(content: bytes, rng: random.Random, did: list[str]) -> bytes:
    did.append("bytes")
    data = bytearray(content)
    for _ in range(rng.choice([1, 1, 2, 8])):
        data[rng.randrange(len(data))] = rng.randrange(256)
    draw = rng.random()
    if draw < 0.15:
        del data[rng.randrange(len(data)) :]
    elif draw < 0.25:
        at = rng.randrange(len(data))
        data[at:at] = rng.randbytes(4)
    return bytes(data) or b"\0"


# reading ----------------------------------------------------------------------------------


def own_reading(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Affine (4 x 4, LPS mm) and values (K, J, I) by the formats' own words."""
    name = path.name
    if ".nii" in name:
        return _read_nifti(path)
    return _read_nrrd(path) if name.endswith(("nrrd", "nhdr")) else _read_meta(path)


def _read_nrrd(path: Path) -> tuple[np.ndarray, np.ndarray]:
    content = path.read_bytes()
    found = re.search(rb"\r?\n\r?\n", content)
    head = content[: found.start()] if found else content
    body = content[found.end() :] if found else b""
    fields = {}
    for line in head.decode("utf-8", "replace").splitlines()[1:]:
        name, colon, value = line.partition(": ")
        if colon and not line.startswith("#"):
            fields[name.strip().lower()] = value.strip()
    size = [int(n) for n in fields["sizes"].split()]
    vectors = [
        [float(x) for x in text.split(",")]
        for text in re.findall(r"\(([^()]*)\)", fields["space directions"])
    ]
    origin = [float(x) for x in fields["space origin"].strip(" ()").split(",")]
    unit = _MM[re.findall(r'"([^"]*)"', fields.get("space units", '"mm"'))[0].lower()]
    sign = np.array(_SIGNS[fields["space"].lower()], float)
    affine = np.eye(4)
    affine[:3, :3] = sign[:, None] * np.array(vectors).T * unit
    affine[:3, 3] = sign * np.array(origin) * unit
    if "data file" in fields or "datafile" in fields:
        body = (path.parent / fields.get("data file", fields.get("datafile", ""))).read_bytes()
    kind = next(k for k, names in _NRRD_TYPES.items() if fields["type"].lower() in names)
    order = ">" if fields.get("endian", "little").lower() == "big" else "<"
    for _ in range(int(fields.get("line skip", fields.get("lineskip", "0")))):
        body = body.split(b"\n", 1)[1]
    encoding = fields["encoding"].lower()
    skip = int(fields.get("byte skip", fields.get("byteskip", "0")))
    count = size[0] * size[1] * size[2]
    if encoding in ("gzip", "gz"):
        body = gzip.decompress(body)
    if encoding in ("ascii", "text", "txt"):
        values = np.array([float(x) for x in body.decode("latin-1").split()[:count]], kind)
    else:
        length = count * np.dtype(kind).itemsize
        body = body[len(body) - length :] if skip == -1 else body[skip:]
        values = np.frombuffer(body[:length], order + kind)
    return affine, values.reshape(size[::-1])


def _read_meta(path: Path) -> tuple[np.ndarray, np.ndarray]:
    content = path.read_bytes()
    fields, at = {}, 0
    while "elementdatafile" not in fields:
        end = content.index(b"\n", at)
        name, equals, value = content[at:end].decode("latin-1").partition("=")
        at = end + 1
        if equals:
            fields[name.strip().lower()] = value.strip()
    size = [int(float(n)) for n in fields["dimsize"].split()]
    names = ("transformmatrix", "rotation", "orientation")
    matrix = next(fields[name] for name in names if name in fields)
    offset = next(fields[name] for name in ("offset", "position", "origin") if name in fields)
    unit = _MM[fields.get("distanceunits", "mm").lower()]
    axes = np.array([float(x) for x in matrix.split()]).reshape(3, 3).T
    affine = np.eye(4)
    affine[:3, :3] = axes * np.array([float(x) for x in fields["elementspacing"].split()]) * unit
    affine[:3, 3] = np.array([float(x) for x in offset.split()]) * unit
    local = fields["elementdatafile"].lower() == "local"
    body = content[at:] if local else (path.parent / fields["elementdatafile"]).read_bytes()
    big = [fields.get(name, "") for name in ("binarydatabyteordermsb", "elementbyteordermsb")]
    order = ">" if any(text[:1].lower() in ("t", "1", "y") for text in big) else "<"
    kind = _META_TYPES[fields["elementtype"]]
    count = size[0] * size[1] * size[2]
    length = count * np.dtype(kind).itemsize
    skip = int(fields.get("headersize", "0"))
    if fields.get("binarydata", "False")[:1].lower() in ("f", "0", "n"):
        values = np.array([float(x) for x in body.decode("latin-1").split()[:count]], kind)
        return affine, values.reshape(size[::-1])
    if fields.get("compresseddata", "False")[:1].lower() in ("t", "1", "y"):
        body = zlib.decompressobj(47).decompress(body)
    body = body[len(body) - length :] if skip == -1 else body[skip:]
    return affine, np.frombuffer(body[:length], order + kind).reshape(size[::-1])


def _read_nifti(path: Path) -> tuple[np.ndarray, np.ndarray]:
    content = path.read_bytes()
    if content[:2] == b"\x1f\x8b":
        content = gzip.decompress(content)
    order = "<" if struct.unpack_from("<i", content)[0] == 348 else ">"
    dim = struct.unpack_from(order + "8h", content, 40)
    kind = _NIFTI_TYPES[struct.unpack_from(order + "h", content, 70)[0]]
    pixdim = struct.unpack_from(order + "8f", content, 76)
    start, slope, intercept = struct.unpack_from(order + "3f", content, 108)
    unit = {1: 1000.0, 2: 1.0, 3: 1e-3}[content[123] & 7]
    qform, sform = struct.unpack_from(order + "2h", content, 252)
    ras = np.eye(4)
    if sform > 0:
        ras[:3] = np.array(struct.unpack_from(order + "12f", content, 280)).reshape(3, 4)
    else:
        assert qform > 0
        b, c, d, *offset = struct.unpack_from(order + "6f", content, 256)
        quaternion = np.array([np.sqrt(max(0.0, 1 - b * b - c * c - d * d)), b, c, d])
        ras[:3, :3] = _turn(quaternion) * np.array(pixdim[1:4])
        ras[:3, 2] *= -1 if pixdim[0] < 0 else 1
        ras[:3, 3] = offset
    ras[:3] *= unit
    ras[:2] *= -1
    count = dim[1] * dim[2] * dim[3]
    values = np.frombuffer(content[int(start) :], order + kind, count=count).astype(float)
    if slope != 0 and np.isfinite([slope, intercept]).all():
        values = values * slope + intercept
    return ras, values.reshape(dim[3], dim[2], dim[1])


def _turn(q: np.ndarray) -> np.ndarray:
    """Rotation matrix of a unit quaternion by conjugation of the axes."""

    def times(p, r):
        w = p[0] * r[0] - p[1:] @ r[1:]
        return np.r_[w, p[0] * r[1:] + r[0] * p[1:] + np.cross(p[1:], r[1:])]

    back = q * np.array([1, -1, -1, -1])
    return np.array([times(times(q, np.r_[0.0, axis]), back)[1:] for axis in np.eye(3)]).T


def why_wrong(volume, path: Path) -> str | None:
    """Why a volume that was read is not what its file says, None if it is."""
    if not np.isfinite(volume.ijk_to_lps).all() or not np.isfinite(volume.voxels).all():
        return "numbers that are not finite"
    try:
        affine, values = own_reading(path)
    except Exception as error:
        return f"a file that an independent reading refuses: {type(error).__name__}: {error}"
    if values.shape != volume.voxels.shape:
        return f"shape {volume.voxels.shape} for {values.shape}"
    ends = np.stack(np.meshgrid(*[(0, n - 1) for n in values.shape[::-1]], indexing="ij"), -1)
    ends = ends.reshape(-1, 3)
    apart = np.abs(ends @ affine[:3, :3].T + affine[:3, 3] - volume.lps_from_ijk(ends)).max()
    if not apart <= 1e-3 * max(1.0, np.abs(affine).max() * 1e-4):
        return f"corners {apart:.3g} mm off"
    if not np.allclose(volume.voxels, values, rtol=1e-6, atol=1e-4):
        return "other values than the file's"
    return None
