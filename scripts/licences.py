"""Copies the licence texts of every crate that is part of the program; see `scripts/package`.

Usage: licences.py FOLDER. Writes FOLDER/<crate>-<version>/, and FOLDER/crates.tsv with the terms of each.
"""

import json
import pathlib
import re
import shutil
import subprocess
import sys

TEXT = re.compile(r"(un)?licen[cs]e|copying|copyright|notice", re.IGNORECASE)


def host():
    """The platform that rustc builds for."""
    version = subprocess.run(["rustc", "-vV"], check=True, capture_output=True, text=True).stdout
    return re.search(r"^host: (\S+)$", version, re.MULTILINE).group(1)


def metadata():
    command = ["cargo", "metadata", "--locked", "--format-version", "1", "--filter-platform", host()]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def linked(graph):
    """The packages reached from the program and its Python module without those that only its tests or build scripts use."""
    nodes = {node["id"]: node for node in graph["resolve"]["nodes"]}
    own = {package["id"] for package in graph["packages"] if package["name"] in ("areograph", "areograph-python")}
    waiting, reached = list(own), set()
    while waiting:
        package = waiting.pop()
        if package in reached:
            continue
        reached.add(package)
        for dependency in nodes[package]["deps"]:
            if any(kind["kind"] is None for kind in dependency["dep_kinds"]):
                waiting.append(dependency["pkg"])
    return reached - own


def main(folder):
    graph = metadata()
    reached = linked(graph)
    packages = sorted((p for p in graph["packages"] if p["id"] in reached), key=lambda p: (p["name"], p["version"]))
    rows = ["crate\tversion\tlicence\trepository\n"]
    for package in packages:
        name = f"{package['name']}-{package['version']}"
        source = pathlib.Path(package["manifest_path"]).parent
        texts = [file for file in sorted(source.iterdir()) if file.is_file() and TEXT.match(file.name)]
        if texts:
            (folder / name).mkdir(parents=True)
        for file in texts:
            shutil.copyfile(file, folder / name / file.name)
        terms = package["license"] or package["license_file"]
        rows.append(f"{package['name']}\t{package['version']}\t{terms}\t{package['repository'] or ''}\n")
    (folder / "crates.tsv").write_text("".join(rows), encoding="utf-8")


main(pathlib.Path(sys.argv[1]))
