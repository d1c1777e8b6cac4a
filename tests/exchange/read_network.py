"""Compares a binary control network of ISIS with its text form. Arguments: the binary network, the text network.

Decodes Protocol Buffers by hand, with the field numbers of ISIS's ControlPointFileEntryV0002.proto.
"""

import re
import struct
import sys

POINT = {1: "PointId", 2: "PointType", 6: "Ignore", 7: "JigsawRejected", 16: "AprioriX", 17: "AprioriY", 18: "AprioriZ",
         19: "AprioriCovarianceMatrix", 20: "AdjustedX", 21: "AdjustedY", 22: "AdjustedZ",
         23: "AdjustedCovarianceMatrix", 9: "AprioriXYZSource", 11: "AprioriRadiusSource",
         13: "LatitudeConstrained", 14: "LongitudeConstrained", 15: "RadiusConstrained"}
MEASURE = {1: "SerialNumber", 2: "MeasureType", 3: "Sample", 4: "Line", 5: "SampleResidual", 6: "LineResidual",
           11: "JigsawRejected", 15: "SampleSigma", 16: "LineSigma"}
WORDS = {"PointType": {2: "Free", 3: "Constrained", 4: "Fixed"}, "MeasureType": {3: "RegisteredSubPixel"},
         "AprioriXYZSource": {1: "User", 2: "AverageOfMeasures"}, "AprioriRadiusSource": {1: "User", 2: "AverageOfMeasures"}}
FLAGS = {"Ignore", "JigsawRejected", "LatitudeConstrained", "LongitudeConstrained", "RadiusConstrained"}


def varint(data, at):
    value = shift = 0
    while True:
        byte = data[at]
        value |= (byte & 127) << shift
        at, shift = at + 1, shift + 7
        if byte < 128:
            return value, at


def fields(data):
    at = 0
    while at < len(data):
        key, at = varint(data, at)
        kind = key & 7
        if kind == 0:
            value, at = varint(data, at)
        elif kind == 1:
            value, at = struct.unpack_from("<d", data, at)[0], at + 8
        elif kind == 2:
            size, at = varint(data, at)
            value, at = data[at : at + size], at + size
        else:
            raise ValueError(f"wire type {kind}")
        yield key >> 3, value


def named(data, names):
    entry, inner = {}, []
    for number, value in fields(data):
        if number == 25 and names is POINT:
            inner.append(value)
            continue
        name = names[number]
        if isinstance(value, bytes):
            is_matrix = name.endswith("Matrix")
            value = list(struct.unpack(f"<{len(value) // 8}d", value)) if is_matrix else value.decode()
        elif name in FLAGS:
            value = {1: "True"}[value]
        elif name in WORDS:
            value = WORDS[name][value]
        entry[name] = value
    return entry, inner


def binary(path):
    data = open(path, "rb").read()
    label = data[:65536].rstrip(b"\0").decode()
    number = {key: int(value) for key, value in re.findall(r"(\w+) = (\d+)$", label, re.M)}
    assert number["HeaderStartByte"] == 65536 and number["Version"] == 5
    assert number["PointsStartByte"] == 65536 + number["HeaderBytes"]
    assert number["PointsStartByte"] + number["PointsBytes"] == len(data)
    header = dict(fields(data[65536 : number["PointsStartByte"]]))
    assert header[1].decode() in label and header[2] in (b"Mars", b"Moon")
    at, points = number["PointsStartByte"], []
    while at < len(data):
        size = struct.unpack_from("<I", data, at)[0]
        point, measures = named(data[at + 4 : at + 4 + size], POINT)
        points.append((point, [named(measure, MEASURE)[0] for measure in measures]))
        at += 4 + size
    assert len(points) == number["NumberOfPoints"]
    assert sum(len(measures) for _, measures in points) == number["NumberOfMeasures"]
    return points


def value_of(text):
    text = re.sub(r"\s*<\w+>$", "", text.strip())
    if text.startswith("("):
        return [float(number) for number in text[1:-1].split(",")]
    if text[0] in "\"'":
        return text[1:-1]
    try:
        return float(text)
    except ValueError:
        return text


def text(path):
    points, entry = [], None
    for line in open(path, encoding="utf-8"):
        key, _, value = (part.strip() for part in line.partition("="))
        if (key, value) == ("Object", "ControlPoint"):
            entry = {}
            points.append((entry, []))
        elif (key, value) == ("Group", "ControlMeasure"):
            entry = {}
            points[-1][1].append(entry)
        elif value and entry is not None:
            entry[key] = value_of(value)
    return points


read, written = binary(sys.argv[1]), text(sys.argv[2])
assert len(read) == len(written) > 0
for (point, measures), (expected, expected_measures) in zip(read, written):
    # Identifiers may be numbers in quotes.
    assert point == expected, (point, expected)
    assert measures == expected_measures, (measures, expected_measures)
print(len(read), "points,", sum(len(measures) for _, measures in read), "measures")
