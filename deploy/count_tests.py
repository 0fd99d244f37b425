#!/usr/bin/env python3
"""Adds up the test cases of GoogleTest (JSON) and pytest (JUnit XML) result files.

Usage: count_tests.py FAILED_STEPS FOLDER...

Prints why tests were skipped, which failed, and `N passed, N failed, N skipped` as its last line.
Exit code 1 when a case failed, a step failed or no case ran.
"""

import json
import pathlib
import sys
import xml.etree.ElementTree as ElementTree


def gtest_cases(path):
    for suite in json.loads(path.read_text())["testsuites"]:
        for case in suite["testsuite"]:
            name = f"{case['classname']}.{case['name']}"
            if case.get("failures"):
                yield name, "failed", ""
            elif case.get("result") == "SKIPPED":
                reasons = [item.get("message", "") for item in case.get("skipped", [])]
                yield name, "skipped", reasons[0] if reasons else ""
            elif case.get("status") == "RUN":
                yield name, "passed", ""


def pytest_cases(path):
    for case in ElementTree.parse(path).getroot().iter("testcase"):
        name = f"{case.get('classname')}.{case.get('name')}"
        skipped = case.find("skipped")
        if case.find("failure") is not None or case.find("error") is not None:
            yield name, "failed", ""
        elif skipped is not None:
            yield name, "skipped", skipped.get("message", "")
        else:
            yield name, "passed", ""


def main():
    failed_steps = int(sys.argv[1])
    count = {"passed": 0, "failed": 0, "skipped": 0}
    for folder in map(pathlib.Path, sys.argv[2:]):
        for path in sorted(folder.iterdir()):
            cases = gtest_cases(path) if path.suffix == ".json" else pytest_cases(path)
            for name, outcome, reason in cases:
                count[outcome] += 1
                if outcome != "passed":
                    first_line = reason.strip().splitlines()[-1] if reason.strip() else ""
                    print(f"{outcome}: {folder.parent.name}: {name} {first_line}")
    # a program that crashed before it could write its result file counts as one failure
    if failed_steps and count["failed"] == 0:
        count["failed"] = failed_steps
    print(f"{count['passed']} passed, {count['failed']} failed, {count['skipped']} skipped")
    return 1 if count["failed"] or not count["passed"] else 0


if __name__ == "__main__":
    sys.exit(main())
