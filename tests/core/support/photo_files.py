"""Photo files put together byte by byte for the tests: EXIF blocks, PNG kinds and TIFFs that no encoder here writes."""

import struct
import zlib

import cv2
import numpy as np

ASCII, SHORT, LONG, RATIONAL = 2, 3, 4, 5


def picture(height=48, width=64):
    """RGB blocks whose corners differ: red top-left, green top-right, blue bottom-left, grey bottom-right."""
    image = np.zeros((height, width, 3), np.uint8)
    image[: height // 2, : width // 2] = (220, 30, 30)
    image[: height // 2, width // 2 :] = (30, 220, 30)
    image[height // 2 :, : width // 2] = (30, 30, 220)
    image[height // 2 :, width // 2 :] = (120, 120, 120)
    return image


def exif(main=None, sub=None, order="<"):
    """An EXIF block; `main` and `sub` map tag -> (type, value), a rational's value being (top, bottom), a text's a str."""
    main = dict(main or {})
    if sub:
        main[0x8769] = (LONG, 0)
    start = 8
    sub_at = start + 2 + 12 * len(main) + 4
    tail_at = sub_at + (2 + 12 * len(sub) + 4 if sub else 0)
    if sub:
        main[0x8769] = (LONG, sub_at)
    tail = b""
    out = {"<": b"II*\0", ">": b"MM\0*"}[order] + struct.pack(order + "I", start)
    for tags in (main, sub) if sub else (main,):
        out += struct.pack(order + "H", len(tags))
        for tag, (kind, value) in sorted(tags.items()):
            text = value.encode() + b"\0" if kind == ASCII else b""
            out += struct.pack(order + "HHI", tag, kind, len(text) or 1)
            if len(text) > 4:
                out += struct.pack(order + "I", tail_at + len(tail))
                tail += text
            elif text:
                out += text.ljust(4, b"\0")
            elif kind == RATIONAL:
                out += struct.pack(order + "I", tail_at + len(tail))
                tail += struct.pack(order + "II", *value)
            else:
                out += struct.pack(order + "HH", value, 0) if kind == SHORT else struct.pack(order + "I", value)
        out += struct.pack(order + "I", 0)
    return out + tail


def encoded(suffix, image, block=b""):
    """RGB `image` as .jpg, .png, .webp bytes with an EXIF block put in by hand."""
    options = {".jpg": [cv2.IMWRITE_JPEG_QUALITY, 98], ".png": [], ".webp": [cv2.IMWRITE_WEBP_QUALITY, 101]}[suffix]
    data = cv2.imencode(suffix, np.ascontiguousarray(image[..., ::-1]), options)[1].tobytes()
    if not block:
        return data
    if suffix == ".jpg":
        body = b"Exif\0\0" + block
        return data[:2] + b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body + data[2:]
    if suffix == ".png":
        return data[:33] + png_chunk(b"eXIf", block) + data[33:]
    height, width = image.shape[:2]
    extended = struct.pack("<I", 0x08) + (width - 1).to_bytes(3, "little") + (height - 1).to_bytes(3, "little")
    body = riff_chunk(b"VP8X", extended) + data[12:] + riff_chunk(b"EXIF", block)
    return b"RIFF" + struct.pack("<I", len(body) + 4) + b"WEBP" + body


def riff_chunk(name, data):
    return name + struct.pack("<I", len(data)) + data + b"\0" * (len(data) & 1)


def png_chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def tiff(image, orientation=1, alpha=False):
    """An uncompressed little-endian TIFF of (H, W, C) values, uint8, uint16 or float32."""
    height, width, channels = image.shape
    data = np.ascontiguousarray(image).tobytes()
    tags = {
        256: (LONG, 1, width),
        257: (LONG, 1, height),
        258: (SHORT, channels, 8 * image.dtype.itemsize),
        259: (SHORT, 1, 1),
        262: (SHORT, 1, 2 if channels >= 3 else 1),
        273: (LONG, 1, 0),
        274: (SHORT, 1, orientation),
        277: (SHORT, 1, channels),
        278: (LONG, 1, height),
        279: (LONG, 1, len(data)),
        339: (SHORT, channels, 3 if image.dtype.kind == "f" else 1),
    }
    if alpha:
        tags[338] = (SHORT, 1, 2)
    tail_at = 8 + 2 + 12 * len(tags) + 4
    tail = b""
    body = struct.pack("<H", len(tags))
    pixels_at = tail_at + sum(2 * count for _, count, _ in tags.values() if count > 2)
    for tag, (kind, count, value) in sorted(tags.items()):
        body += struct.pack("<HHI", tag, kind, count)
        if tag == 273:
            body += struct.pack("<I", pixels_at)
        elif count > 2:
            body += struct.pack("<I", tail_at + len(tail))
            tail += struct.pack(f"<{count}H", *[value] * count)
        else:
            body += struct.pack("<HH", value, 0) if kind == SHORT else struct.pack("<I", value)
    return b"II*\0" + struct.pack("<I", 8) + body + struct.pack("<I", 0) + tail + data


class TiffFile:
    """A TIFF put together directory by directory, little-endian; `data` is the file so far."""

    def __init__(self):
        self.data = bytearray(b"II*\0" + bytes(4))

    def put(self, raw):
        """Bytes that directories point at; where they lie."""
        at = len(self.data)
        self.data += raw
        return at

    def directory(self, tags):
        """A directory of {tag: (type, values)}; where it lies. The first one is the file's; the chain ends with each."""
        tail_at = len(self.data) + 2 + 12 * len(tags) + 4
        body, tail = struct.pack("<H", len(tags)), b""
        for tag, (kind, values) in sorted(tags.items()):
            raw = struct.pack(f"<{len(values)}{'H' if kind == SHORT else 'I'}", *values)
            body += struct.pack("<HHI", tag, kind, len(values))
            body += raw.ljust(4, b"\0") if len(raw) <= 4 else struct.pack("<I", tail_at + len(tail))
            tail += b"" if len(raw) <= 4 else raw
        at = self.put(body + bytes(4) + tail)
        if not any(self.data[4:8]):
            self.data[4:8] = struct.pack("<I", at)
        return at

    def follow(self, directory, by):
        """Chains one directory to the next."""
        (count,) = struct.unpack("<H", self.data[directory : directory + 2])
        place = directory + 2 + 12 * count
        self.data[place : place + 4] = struct.pack("<I", by)

    def strip(self, image, **more):
        """The tags of an uncompressed picture (H, W, C) whose values are put into the file; `more`: tag number to one value."""
        height, width, channels = image.shape
        at = self.put(np.ascontiguousarray(image).tobytes())
        tags = {256: width, 257: height, 259: 1, 262: 2 if channels == 3 else 1, 273: at, 277: channels, 278: height}
        tags |= {279: image.nbytes} | {int(tag[1:]): value for tag, value in more.items()}
        return {tag: (LONG, (value,)) for tag, value in tags.items()} | {258: (SHORT, (8 * image.dtype.itemsize,) * channels)}
