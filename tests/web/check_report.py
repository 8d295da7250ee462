"""Makes a report from a synthetic run and opens it in headless Chromium, in light and dark, wide and narrow.

Fails on markup that a strict parser refuses, on anything that would be loaded from elsewhere, on a message in the browser's console, on
content wider than the window, on a script that the page's policy does not name, and on a picture that is blank or that does not change with the reader's colour scheme.
Usage: check_report.py WRITE_SYNTHETIC_REPORT [CHROMIUM [KEEP_PICTURES_IN [HEIGHT]]]; exit code 77: no browser.
"""
import base64
import hashlib
import pathlib
import re
import struct
import subprocess
import sys
import tempfile
import xml.etree.ElementTree
import zlib

FLAGS = ["--headless=new", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--hide-scrollbars", "--enable-logging=stderr", "--v=0"]
# What a page could load: attributes that hold addresses.
ADDRESSES = {"src", "href", "srcset", "poster", "data", "action", "background"}


def fail(message):
    sys.exit(f"check_report: {message}")


def check_markup(page):
    """The page is written as well-formed XML: a strict parser reads all of it. Nothing in it points elsewhere."""
    root = xml.etree.ElementTree.fromstring(page.read_text(encoding="utf-8"))
    identifiers = [e.get("id") for e in root.iter() if e.get("id")]
    if len(identifiers) != len(set(identifiers)):
        fail("an id is used twice")
    check_scripts(root, page.read_text(encoding="utf-8"))
    for e in root.iter():
        for name, value in e.attrib.items():
            if name.split("}")[-1] in ADDRESSES and not is_own(page, e.tag, value):
                fail(f"<{e.tag} {name}> points elsewhere: {value[:80]}")
            if name in ("href",) and value.startswith("#") and value[1:] not in identifiers:
                fail(f"link to {value}, which is not on the page")
        if e.tag == "img" and not e.get("alt"):
            fail("a picture has no text in its place")
        if e.tag == "table" and e.find("caption") is None:
            fail("a table has no caption")
        if e.tag == "svg" and e.get("role") == "img" and not e.get("aria-label"):
            fail("a drawing has no label")
    headings = [int(e.tag[1]) for e in root.iter() if re.fullmatch("h[1-6]", e.tag)]
    if headings.count(1) != 1 or any(b > a + 1 for a, b in zip(headings, headings[1:])):
        fail(f"headings skip a level: {headings}")
    style = root.find("head/style").text
    if "url(" in style or "@import" in style:
        fail("the style sheet loads something")


def is_own(page, tag, address):
    """A part of the page, a picture or a download in it, or a link to a file beside it."""
    if re.match(r"data:image/(png|jpeg);base64,|#", address):
        return True
    beside = re.fullmatch(r"(\w+/)?[\w-]+\.(csv|svg|json|tex)", address)
    return tag == "a" and bool(re.match(r"data:(image/svg\+xml|text/csv);base64,", address) or (beside and (page.parent / address).is_file()))


def check_scripts(root, markup):
    """Data may stand in script elements; what runs is named by its hash in the page's policy."""
    policy = "".join(e.get("content", "") for e in root.iter("meta") if e.get("http-equiv") == "Content-Security-Policy")
    data = [e for e in root.iter("script") if e.get("type") == "application/octet-stream"]
    running = re.findall(r"<script>(.*?)</script>", markup, re.DOTALL)
    if len(data) + len(running) != len(list(root.iter("script"))):
        fail("the page has a script of another kind")
    for script in running:
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
        if f"'sha256-{digest}'" not in policy:
            fail("the page has a script that its policy does not name")


def run_chromium(chromium, flags, page, profile):
    command = [chromium, *FLAGS, f"--user-data-dir={profile}", *flags, page.as_uri()]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def console_messages(stderr):
    """Lines that the page itself caused, such as `[...:INFO:CONSOLE(1)] "Refused to load …"`; not what the software driver
    says of its own speed when the screenshot is read back."""
    return [line for line in stderr.splitlines() if "CONSOLE" in line and "GL Driver Message" not in line]


def read_png(path):
    """Rows of RGB(A) samples of an 8-bit PNG (ISO/IEC 15948), which is what Chromium writes."""
    data = path.read_bytes()
    width, height, depth, kind = struct.unpack(">IIBB", data[16:26])
    if depth != 8 or kind not in (2, 6):
        fail(f"{path}: unexpected kind of PNG")
    channels, stride, compressed, at = (3 if kind == 2 else 4), 0, b"", 8
    while at < len(data):
        length, name = struct.unpack(">I4s", data[at:at + 8])
        if name == b"IDAT":
            compressed += data[at + 8:at + 8 + length]
        at += 12 + length
    raw, stride, rows = zlib.decompress(compressed), width * channels, []
    previous = bytearray(stride)
    for y in range(height):
        filter_kind, row = raw[y * (stride + 1)], bytearray(raw[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
        undo_filter(filter_kind, row, previous, channels)
        rows.append(bytes(row))
        previous = row
    return width, height, channels, rows


def undo_filter(kind, row, above, channels):
    for i in range(len(row) if kind else 0):
        left = row[i - channels] if i >= channels else 0
        corner = above[i - channels] if i >= channels else 0
        up = above[i]
        if kind == 1:
            row[i] = (row[i] + left) & 255
        elif kind == 2:
            row[i] = (row[i] + up) & 255
        elif kind == 3:
            row[i] = (row[i] + (left + up) // 2) & 255
        else:
            estimate = left + up - corner
            nearest = min((abs(estimate - left), 0, left), (abs(estimate - up), 1, up), (abs(estimate - corner), 2, corner))[2]
            row[i] = (row[i] + nearest) & 255


def screenshot(chromium, page, picture, size, dark):
    flags = [f"--screenshot={picture}", f"--window-size={size[0]},{size[1]}"]
    if dark:
        flags.append("--blink-settings=preferredColorScheme=0")
    with tempfile.TemporaryDirectory() as profile:
        result = run_chromium(chromium, flags, page, profile)
    if not picture.exists():
        fail(f"no screenshot; chromium said: {result.stderr[-500:]}")
    messages = console_messages(result.stderr)
    if messages:
        fail(f"the browser's console says: {messages[0]}")
    return read_png(picture)


def check_picture(name, picture):
    """Not blank: many colours, and ink in the upper half and in the lower half."""
    width, height, channels, rows = picture
    colours = [{row[i:i + 3] for row in part for i in range(0, len(row), channels)} for part in (rows[:height // 2], rows[height // 2:])]
    for part, found in zip(("upper", "lower"), colours):
        if len(found) < 200:
            fail(f"{name}: the {part} half of the page is as good as blank ({len(found)} colours)")


def mean_brightness(picture):
    _, _, channels, rows = picture
    return sum(sum(row[1::channels]) for row in rows) / sum(len(row) // channels for row in rows)


def check_width(chromium, page, width):
    """No part of the page is wider than the window, measured by a page that holds it in a frame of that width."""
    with tempfile.TemporaryDirectory() as folder:
        probe = pathlib.Path(folder) / "probe.html"
        probe.write_text(f"""<!DOCTYPE html><title>-</title><iframe id="f" style="border:0;width:{width}px;height:900px" srcdoc=""></iframe>
<script>const frame = document.getElementById('f');
frame.onload = () => {{ document.title = 'w' + frame.contentDocument.documentElement.scrollWidth; document.body.dataset.width = document.title; }};
frame.srcdoc = new TextDecoder().decode(Uint8Array.from(atob("{encoded(page)}"), c => c.charCodeAt(0)));</script>""")
        with tempfile.TemporaryDirectory() as profile:
            result = run_chromium(chromium, ["--dump-dom", "--virtual-time-budget=10000"], probe, profile)
    found = re.search(r'data-width="w(\d+)"', result.stdout)
    if not found:
        fail(f"the width of the page could not be measured: {result.stderr[-300:]}")
    if int(found[1]) > width:
        fail(f"the page is {found[1]} pixels wide in a window of {width}")


def encoded(page):
    return base64.b64encode(page.read_bytes()).decode()


def main(writer, chromium=None, keep=None, height=None):
    height = int(height) if height else None
    with tempfile.TemporaryDirectory() as folder:
        run = pathlib.Path(folder) / "run"
        subprocess.run([writer, run], check=True)
        page = run / "report.html"
        check_markup(page)
        if not chromium or chromium.endswith("NOTFOUND"):
            print("check_report: no chromium here; only the markup was checked")
            sys.exit(77)
        pictures = pathlib.Path(keep or folder)
        pictures.mkdir(parents=True, exist_ok=True)
        light = screenshot(chromium, page, pictures / "light.png", (1280, height or 2400), False)
        dark = screenshot(chromium, page, pictures / "dark.png", (1280, height or 1400), True)
        narrow = screenshot(chromium, page, pictures / "narrow.png", (500, height or 2400), False)
        for name, picture in (("light", light), ("dark", dark), ("narrow", narrow)):
            check_picture(name, picture)
        if mean_brightness(dark) > 0.5 * mean_brightness(light):
            fail("the dark page is not dark")
        check_width(chromium, page, 360)
        check_width(chromium, page, 1280)
    print("check_report: markup, console, pictures and width are as they should be")


if __name__ == "__main__":
    main(*sys.argv[1:])
