"""What the tests cost: seconds by program and the slowest tests, from the log of a run; and how many tests had what they
need from outside the project. Usage: test_costs.py LOG NOTES"""

import os
import re
import sys
from collections import defaultdict

PROGRAM = re.compile(r"^\s+Running (?:unittests )?(\S+) \(.*?/([\w-]+?)-[0-9a-f]{16}\)")
TEST = re.compile(r"^test (.+?) \.\.\. (?:.*?)(ok|FAILED|ignored)\b.*?(?:<([\d.]+)s>)?$")
SLOWEST = 25
# Longer tests belong to the long run.
SHORT_S = 20.0


def read(path):
    program, tests = "documentation", []
    with open(path, encoding="utf-8", errors="replace") as log:
        for line in log:
            if line.lstrip().startswith("Doc-tests"):
                program = "documentation"
            elif found := PROGRAM.match(line):
                name = found[2]
                program = name if found[1].startswith("tests/") else f"{name} (in its sources)"
            elif found := TEST.match(line.rstrip("\n")):
                tests.append((program, found[1], found[2], float(found[3] or 0.0)))
    return tests


def names(folder):
    return set(os.listdir(folder)) if os.path.isdir(folder) else set()


def main(log, notes):
    tests = read(log)
    seconds, count = defaultdict(float), defaultdict(int)
    for program, _, outcome, took_s in tests:
        seconds[program] += took_s
        count[program] += outcome != "ignored"
    print("\nseconds of tests by program")
    for program in sorted(seconds, key=seconds.get, reverse=True):
        print(f"{seconds[program]:9.1f}  {count[program]:5}  {program}")
    print(f"{sum(seconds.values()):9.1f}  {sum(count.values()):5}  all\n\nthe slowest tests (* over {SHORT_S:.0f} s)")
    for program, test, _, took_s in sorted(tests, key=lambda test: -test[3])[:SLOWEST]:
        print(f"{took_s:9.1f}{'*' if took_s > SHORT_S else ' '} {program} {test}")
    skipped = names(os.path.join(notes, "skipped"))
    for test in sorted(skipped):
        with open(os.path.join(notes, "skipped", test), encoding="utf-8") as why:
            print(f"skipped {test}: {why.read()}")
    for test in sorted(names(os.path.join(notes, "left"))):
        print(f"left to scripts/test --long: {test}")
    found = len(names(os.path.join(notes, "found")) - skipped)
    print(f"\ntests that need something from outside: {found} had it, {len(skipped)} skipped")


main(*sys.argv[1:])
