"""A window of an archive on a server that is far away, compared with the archive on this computer.

bench_remote.py AREOGRAPH ARCHIVE FOLDER [RANDOM_SEED]: serves ARCHIVE with range requests behind a round trip of 50 ms and 20 MB/s for all
connections together, builds the stand-ins in FOLDER without these limits, and then searches windows of 0.5 degrees, each with an empty
FOLDER/.fetch. Prints for each window the time of the whole command, the bytes and requests that the server answered, and whether the
rows are those of the local archive. Fails beyond 1.5 s or 5 MB within 75 degrees of the equator, or if any rows differ.
"""

import http.server
import json
import pathlib
import random
import shutil
import subprocess
import sys
import threading
import time

ROUND_TRIP_S = 0.05
BYTES_PER_S = 20e6
PIECE_BYTES = 1 << 14
WINDOWS = 12
# Tracks converge towards the poles: windows beyond are measured, but not judged.
JUDGED_TO_DEG = 75
POLAR_DEG = (78.0, -82.0, 86.0)
WIDTH_DEG = 0.5
TIME_MAX_S = 1.5
BYTES_MAX = 5_000_000


class Line:
    """A line shared by all connections, and what went over it."""

    def __init__(self):
        self.lock = threading.Lock()
        self.is_far = False
        self.free_at = 0.0
        self.requests = self.bytes = self.open = self.open_max = 0

    def wait(self):
        if self.is_far:
            time.sleep(ROUND_TRIP_S)

    def send(self, count):
        with self.lock:
            self.bytes += count
            self.free_at = max(self.free_at, time.perf_counter()) + count / BYTES_PER_S
            free_at = self.free_at
        if self.is_far:
            time.sleep(max(0.0, free_at - time.perf_counter()))


LINE = Line()


class Server(http.server.ThreadingHTTPServer):
    daemon_threads = True

    def process_request_thread(self, *arguments):
        LINE.wait()  # the connection
        with LINE.lock:
            LINE.open += 1
            LINE.open_max = max(LINE.open_max, LINE.open)
        try:
            super().process_request_thread(*arguments)
        finally:
            with LINE.lock:
                LINE.open -= 1


class Handler(http.server.SimpleHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    # The head and the body of an answer would otherwise wait for each other.
    disable_nagle_algorithm = True

    def log_message(self, *_):
        pass

    def do_GET(self):
        LINE.wait()
        LINE.requests += 1
        path = pathlib.Path(self.translate_path(self.path))
        stated = self.headers.get("Range")
        if not path.is_file() or not stated:
            return super().do_GET()
        first, last = stated.removeprefix("bytes=").split("-")
        size = path.stat().st_size
        first = int(first)
        last = min(int(last) if last else size - 1, size - 1)
        self.send_response(206)
        self.send_header("Content-Range", f"bytes {first}-{last}/{size}")
        self.send_header("Content-Length", str(last - first + 1))
        self.end_headers()
        with path.open("rb") as file:
            file.seek(first)
            left = last - first + 1
            while left:
                piece = file.read(min(PIECE_BYTES, left))
                LINE.send(len(piece))
                self.wfile.write(piece)
                left -= len(piece)


def search(areograph, archive, box, out):
    command = [areograph, "--quiet", "pedr", "search", str(archive), box, "--out", str(out), "--json"]
    begun = time.perf_counter()
    answer = subprocess.run(command, check=True, capture_output=True).stdout
    return time.perf_counter() - begun, json.loads(answer)["rows"]


def main(areograph, archive, folder, seed="1"):
    archive, folder = pathlib.Path(archive), pathlib.Path(folder)
    server = Server(("127.0.0.1", 0), lambda *arguments: Handler(*arguments, directory=str(archive)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    url = f"http://127.0.0.1:{server.server_address[1]}/"
    begun = time.perf_counter()
    index = [areograph, "--quiet", "pedr", "index", url, "--into", str(folder), "--json"]
    told = json.loads(subprocess.run(index, check=True, capture_output=True).stdout)
    print(f"index: {told['files']} files, {told['bytes_of_files'] / 1e9:.2f} GB, stand-ins {100 * told['bytes'] / told['bytes_of_files']:.3f} %, "
          f"{time.perf_counter() - begun:.1f} s without limits of the line")
    LINE.is_far = True
    places, worst_s, worst_bytes, is_wrong = random.Random(int(seed)), 0.0, 0, False
    souths = [places.uniform(-JUDGED_TO_DEG, JUDGED_TO_DEG - WIDTH_DEG) for _ in range(WINDOWS)]
    for south in [*souths, *POLAR_DEG]:
        west = places.uniform(0, 359)
        box = f"--box={west!r},{west + WIDTH_DEG!r},{south!r},{south + WIDTH_DEG!r}"
        shutil.rmtree(folder / ".fetch" / "blocks", ignore_errors=True)
        LINE.bytes = LINE.requests = LINE.open_max = 0
        far_s, far_rows = search(areograph, folder, box, folder / "far.csv")
        counts = (LINE.bytes, LINE.requests, LINE.open_max)
        again_s, _ = search(areograph, folder, box, folder / "again.csv")
        here_s, here_rows = search(areograph, archive, box, folder / "here.csv")
        texts = [(folder / f"{name}.csv").read_bytes() for name in ("far", "again", "here")]
        is_same = texts[0] == texts[1] == texts[2] and far_rows == here_rows
        is_wrong |= not is_same
        if abs(south) <= JUDGED_TO_DEG:
            worst_s, worst_bytes = max(worst_s, far_s), max(worst_bytes, counts[0])
        print(f"south {south:6.1f}: {far_rows:6} rows in {far_s:.2f} s, {counts[0] / 1e6:.2f} MB in {counts[1]} requests over "
              f"{counts[2]} connections; again {again_s:.2f} s, local {here_s:.2f} s; {'same bytes' if is_same else 'DIFFERENT'}")
    print(f"worst within {JUDGED_TO_DEG} degrees of the equator: {worst_s:.2f} s, {worst_bytes / 1e6:.2f} MB; expected at most {TIME_MAX_S} s and {BYTES_MAX / 1e6:.0f} MB")
    sys.exit(is_wrong or worst_s > TIME_MAX_S or worst_bytes > BYTES_MAX)


if __name__ == "__main__":
    main(*sys.argv[1:])
