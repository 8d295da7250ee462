"""Adds up JUnit result files of ctest; the last line printed is `N passed, N failed, N skipped`; exit 1 unless all is well."""
import sys
import xml.etree.ElementTree as ET


def count(file):
    """(passed, failed, skipped) of one file, and the names that failed."""
    passed = skipped = 0
    failed = []
    for case in ET.parse(file).getroot().iter("testcase"):
        status = case.get("status")
        if status == "run":
            passed += 1
        elif status in ("notrun", "disabled"):
            skipped += 1
        else:
            failed.append(case.get("name"))
    return passed, failed, skipped


def main(files):
    passed = skipped = 0
    failed = []
    for file in files:
        try:
            p, f, s = count(file)
        except (OSError, ET.ParseError) as error:
            p, f, s = 0, [f"{file}: {error}"], 0
        passed, skipped = passed + p, skipped + s
        failed += f
    for name in failed:
        print(f"failed: {name}")
    print(f"{passed} passed, {len(failed)} failed, {skipped} skipped")
    return 1 if failed or passed == 0 else 0


sys.exit(main(sys.argv[1:]))
