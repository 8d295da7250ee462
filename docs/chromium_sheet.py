"""What the makers of picture sheets share: programs that are run, and a sheet that Chromium draws."""
import base64
import json
import pathlib
import re
import subprocess
import sys

# `draw` fills the sheet once all pictures are loaded; its JPEG becomes the page's text.
PAGE = """<!DOCTYPE html><meta charset="utf-8"><body><script>
const data = DATA;
const load = (png) => new Promise((done) => { const image = new Image(); image.onload = () => done(image); image.src = "data:image/png;base64," + png; });
function makeSheet(width, height) {
  const sheet = document.createElement("canvas");
  [sheet.width, sheet.height] = [width, height];
  const draw = sheet.getContext("2d");
  draw.fillStyle = "white"; draw.fillRect(0, 0, width, height);
  draw.fillStyle = "black"; draw.font = "14px 'DejaVu Sans', sans-serif"; draw.imageSmoothingQuality = "high";
  return [sheet, draw];
}
Promise.all(data.pictures.map(load)).then((images) => { SCRIPT });
</script></body>"""


def run(command):
    result = subprocess.run(command, capture_output=True, text=True)
    if result.returncode != 0:
        sys.exit(f"{command[0]}: {result.stderr.strip()}")
    return result.stdout


def write_sheet(sheet, pictures, data, script, folder):
    """Writes the JPEG `sheet`. `pictures`: PNG files, which `script` has as `images`, and what else it needs as `data`; it leaves the sheet as the
    page's text. `folder`: for the page."""
    data = {"pictures": [base64.b64encode(picture.read_bytes()).decode() for picture in pictures], **data}
    page = pathlib.Path(folder) / "sheet.html"
    page.write_text(PAGE.replace("SCRIPT", script, 1).replace("DATA", json.dumps(data), 1), encoding="utf-8")
    text = run(["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=60000", "--dump-dom", page.as_uri()])
    found = re.search(r"data:image/jpeg;base64,([A-Za-z0-9+/=]+)", text)
    if not found:
        sys.exit("chromium: drew no sheet")
    pathlib.Path(sheet).write_bytes(base64.b64decode(found[1]))
