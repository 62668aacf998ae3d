"""Reads OMG IDL as far as the channels of the display use it, and decodes CDR by it."""
import re
import struct

NUMBERS = {
    "double": "d", "float": "f", "octet": "B", "uint8": "B", "boolean": "?", "long": "i", "int32": "i",
    "unsigned long": "I", "uint32": "I", "long long": "q", "unsigned long long": "Q",
}


def parse(text):
    """Structs and enums by their names, each struct as a list of (type, name)."""
    types = {}
    for kind, name, body in re.findall(r"(struct|enum)\s+(\w+)\s*\{([^}]*)\}", text):
        if kind == "enum":
            types[name] = None
            continue
        fields = [part.strip() for part in body.split(";") if part.strip()]
        types[name] = [tuple(re.sub(r"@\w+\s+", "", one).rsplit(None, 1)) for one in fields]
    return types


class Reader:
    def __init__(self, cdr):
        assert cdr[0:2] == b"\0\1", "little-endian plain CDR"
        self.bytes, self.at = cdr[4:], 0

    def number(self, code):
        size = struct.calcsize(code)
        self.at = (self.at + size - 1) // size * size
        value = struct.unpack_from("<" + code, self.bytes, self.at)[0]
        self.at += size
        return value

    def read(self, types, kind):
        if kind in NUMBERS:
            return self.number(NUMBERS[kind])
        if kind == "string":
            size = self.number("I")
            text = self.bytes[self.at:self.at + size]
            assert len(text) == size and text.endswith(b"\0"), "a string ends with zero"
            self.at += size
            return text[:-1].decode()
        if kind.startswith("sequence<"):
            return [self.read(types, kind[9:-1]) for _ in range(self.number("I"))]
        if types[kind] is None:
            return self.number("I")
        return {name: self.read(types, type_) for type_, name in types[kind]}


def decode(types, name, cdr):
    reader = Reader(cdr)
    value = reader.read(types, name.split("::")[-1])
    assert len(reader.bytes) - reader.at < 4, f"{name}: {len(reader.bytes) - reader.at} bytes are left"
    return value
