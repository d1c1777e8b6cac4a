"""Writes config/bodies/mars_relief.png, the ground of maps of sites: shaded means of MOLA heights in cells of one degree.

Input: megt90n000cb.img of the MOLA MEGDR (MGS-M-MOLA-5-MEGDR-L3-V1.0), the topography of Mars at four cells per degree.
Its label states the layout: rows of big-endian 16-bit metres above the areoid, from 90° N southwards, each from 0° E eastwards.
The areocentric latitudes and the longitudes are of IAU 2000. The picture keeps rows and columns. Lightness is the sum of a
share of the height and of the light from the north-west. Usage: scripts/relief.py megt90n000cb.img config/bodies/mars_relief.png
"""

import math
import struct
import sys
import zlib

ROWS, COLUMNS = 720, 1440
# Cells of the file along a cell of the picture.
CELLS = 4
RADIUS_M = 3_396_190.0
# Heights that are drawn darkest and lightest: below the floor of Hellas, and the flanks of the large volcanoes.
LOWEST_M, HIGHEST_M = -8000.0, 12000.0
# Greys of lowest and highest level ground, dark enough for white outlines and light enough for black letters.
DARK, LIGHT = 105.0, 225.0
EXAGGERATION = 25.0
# Greys from level ground to the brightest slope.
CONTRAST = 130.0
# Steps of grey, for a small file.
STEP = 4


def heights_m(path):
    """Rows of mean heights of the cells of the picture."""
    with open(path, "rb") as file:
        data = file.read()
    if len(data) != 2 * ROWS * COLUMNS:
        sys.exit(f"{path}: {len(data)} bytes; expected {2 * ROWS * COLUMNS} bytes of the MEGDR at four cells per degree")
    values = struct.unpack(f">{ROWS * COLUMNS}h", data)

    def mean(row, column):
        cells = (
            values[(CELLS * row + down) * COLUMNS + CELLS * column + right]
            for down in range(CELLS)
            for right in range(CELLS)
        )
        return sum(cells) / CELLS**2

    return [[mean(row, column) for column in range(COLUMNS // CELLS)] for row in range(ROWS // CELLS)]


def greys(heights):
    """Rows of greys, lit from the north-west at 45°."""
    rows, columns = len(heights), len(heights[0])
    cell_m = math.pi * RADIUS_M / rows
    level = math.sqrt(0.5)
    for row in range(rows):
        # Cells of the polar rows are as wide as at 75°: their slopes to the east are not real.
        latitude = min(abs(90.0 - (row + 0.5) * 180.0 / rows), 75.0)
        wide_m = cell_m * math.cos(math.radians(latitude))
        above, below = heights[max(row - 1, 0)], heights[min(row + 1, rows - 1)]
        line = bytearray()
        for column in range(columns):
            own = heights[row]
            east = EXAGGERATION * (own[(column + 1) % columns] - own[column - 1]) / (2.0 * wide_m)
            south = EXAGGERATION * (below[column] - above[column]) / (2.0 * cell_m)
            light = (level + 0.5 * east + 0.5 * south) / math.sqrt(1.0 + east * east + south * south)
            share = (own[column] - LOWEST_M) / (HIGHEST_M - LOWEST_M)
            grey = DARK + (LIGHT - DARK) * min(max(share, 0.0), 1.0) + CONTRAST * (max(light, 0.0) - level)
            line.append(min(max(round(grey / STEP) * STEP, 0), 255))
        yield bytes(line)


def png(rows):
    """Greys of eight bits as PNG, each row with the filter that leaves the smallest differences."""
    rows = list(rows)
    width = len(rows[0])

    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    filtered = bytearray()
    before = bytes(width)
    for row in rows:
        left = bytes((own - row[at - 1] if at else own) & 255 for at, own in enumerate(row))
        up = bytes((own - other) & 255 for own, other in zip(row, before))
        size = lambda line: sum(min(value, 256 - value) for value in line)
        kind, line = min(((0, row), (1, left), (2, up)), key=lambda of: size(of[1]))
        filtered += bytes([kind]) + line
        before = row
    header = struct.pack(">IIBBBBB", width, len(rows), 8, 0, 0, 0, 0)
    text = b"Source\0MGS-M-MOLA-5-MEGDR-L3-V1.0, megt90n000cb.img (NASA PDS)"
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"tEXt", text)
        + chunk(b"IDAT", zlib.compress(bytes(filtered), 9))
        + chunk(b"IEND", b"")
    )


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    picture = png(greys(heights_m(sys.argv[1])))
    with open(sys.argv[2], "wb") as out:
        out.write(picture)
    print(f"{sys.argv[2]}: {len(picture)} bytes")
