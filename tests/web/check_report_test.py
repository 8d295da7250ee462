"""The check of the report fails where it should: planted faults in a small page. Usage: check_report_test.py [CHROMIUM]"""
import pathlib
import sys
import tempfile

import check_report

GOOD = ("<!DOCTYPE html><html><head><title>t</title><style>p {{ color: red }}</style></head><body><h1>a</h1>"
        '<h2 id="b">b</h2><a href="#b">to b</a>{}</body></html>')

FAULTS = {
    "unclosed element": "<p>",
    "script": "<script>1</script>",
    "loads a picture": '<img src="http://example.org/a.png" alt="a"/>',
    "loads from a protocol of its own": '<a href="//example.org">a</a>',
    "picture without text": '<img src="data:image/png;base64,AAAA"/>',
    "table without caption": "<table><tr><td>1</td></tr></table>",
    "id twice": '<p id="b">b</p>',
    "link to nowhere": '<a href="#c">c</a>',
    "heading that skips a level": "<h4>d</h4>",
    "second first heading": "<h1>e</h1>",
    "drawing without label": '<svg role="img"></svg>',
}


def refuses(check, *arguments):
    try:
        check(*arguments)
    except (SystemExit, Exception):
        return True
    return False


def expect(condition, what):
    if not condition:
        sys.exit(f"check_report_test: {what}")


def main(chromium=None):
    with tempfile.TemporaryDirectory() as folder:
        page = pathlib.Path(folder) / "page.html"
        page.write_text(GOOD.format(""))
        check_report.check_markup(page)
        for name, fault in FAULTS.items():
            page.write_text(GOOD.format(fault))
            expect(refuses(check_report.check_markup, page), f"a page with this fault passed: {name}")
        blank = (60, 60, 3, [bytes([255]) * 180] * 60)
        expect(refuses(check_report.check_picture, "blank", blank), "a blank picture passed")
        if not chromium or chromium.endswith("NOTFOUND"):
            print("check_report_test: no chromium here; only the markup's faults were planted")
            sys.exit(77)
        page.write_text(GOOD.format("<script>console.error('planted')</script>"))
        picture = pathlib.Path(folder) / "picture.png"
        expect(refuses(check_report.screenshot, chromium, page, picture, (400, 300), False), "a message in the console passed")
        page.write_text(GOOD.format('<div style="width: 900px">wide</div>'))
        expect(refuses(check_report.check_width, chromium, page, 360), "a page wider than its window passed")
    print("check_report_test: every planted fault was found")


if __name__ == "__main__":
    main(*sys.argv[1:])
