"""Makes docs/images/image-formation.jpg: each effect of the simulated camera off (left) and on (right), over the built-in stadium.

Usage: make_image_formation.py TILEFLIGHT TILESET OUT.jpg
TILESET is the stadium's `world` (`tileflight scene stadium DIR` writes DIR/world). Needs the ffmpeg command.
"""
import pathlib
import subprocess
import sys
import tempfile

CAMERA = """cam0:
  camera_model: pinhole
  intrinsics: [420.0, 420.0, 399.5, 249.5]
  distortion_model: equidistant
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  resolution: [800, 500]
"""
# Fast and turning, so that blur and shear can be seen.
FLIGHT = """camera: camera.yaml
fps: 10
speed_m_s: 14
acceleration_m_s2: 12
yaw_rate_deg_s: 70
max_frames: 22
waypoints:
  - {position: [-50, -72, 22], yaw_deg: 10, pitch_deg: -24}
  - {position: [-22, -42, 18], yaw_deg: 60, pitch_deg: -26}
  - {position: [10, -20, 20], yaw_deg: 20, pitch_deg: -22}
"""
FRAME = 14
CELL = (260, 170)  # pixels of each half

# name, degrade, `render` options, middle of the crop as shares of the picture, size of the crop as a share of CELL
EFFECTS = [
    ("16 samples a pixel", "", ["--samples", "16"], (0.62, 0.40), 0.5),
    ("haze, visibility 150 m", "haze_visibility: 150", [], (0.5, 0.42), 2.2),
    ("chromatic aberration 0.8 %", "chromatic_red: 0.004\nchromatic_blue: -0.004", [], (0.12, 0.35), 0.5),
    ("motion blur, 1/30 s", "exposure_time: 0.033\nexposure_samples: 15", [], (0.4, 0.6), 0.9),
    ("rolling shutter, 80 ms", "line_delay: 0.00016", [], (0.5, 0.45), 2.2),
    ("vignetting 0.6", "vignetting: 0.6", [], (0.5, 0.5), 2.9),
    ("automatic exposure, target 0.1", "auto_exposure: {target: 0.1}", [], (0.5, 0.5), 2.2),
    ("noise, 400 electrons at white", "white_electrons: 400\nread_noise_electrons: 8", [], (0.4, 0.6), 0.7),
    ("response, gamma 1.6", "gamma: 1.6", [], (0.5, 0.5), 2.2),
    ("sharpening 2", "sharpening: 2\nsharpening_radius: 1.2", [], (0.62, 0.40), 0.5),
    ("H.264 at 0.8 Mbit/s", "video_bitrate: 0.8", [], (0.4, 0.6), 0.7),
    ("all of an action camera",
     "chromatic_red: 0.001\nexposure_time: 0.008\nexposure_samples: 5\nline_delay: 0.00003\nvignetting: 0.4\n"
     "white_electrons: 4000\nread_noise_electrons: 10\nsharpening: 1\nvideo_bitrate: 3", [], (0.5, 0.5), 2.2),
]


def run(command):
    result = subprocess.run(command, capture_output=True, text=True)
    if result.returncode != 0:
        sys.exit(f"{command[0]}: {result.stderr.strip()}")


def render(tileflight, tileset, folder, name, degrade, options):
    out = folder / name
    (folder / f"{name}.yaml").write_text(degrade + "\n", encoding="utf-8")
    more = ["--degrade", str(folder / f"{name}.yaml")] if degrade else []
    run([tileflight, "render", tileset, "--flight", str(folder / "flight.yaml"), "--center", "35.310344,-80.740007,190", "--size", "500,500,150",
         "--out", str(out), "--png", "--quiet", *more, *options])
    return out / "images" / f"{FRAME:06d}.png"


def halves(index, effect):
    """The filter that cuts both pictures (inputs 0 and index), puts them side by side and names them."""
    name, _, _, (x, y), size = effect
    width, height = round(CELL[0] * size), round(CELL[1] * size)
    cut = (f"crop={width}:{height}:(iw-{width})*{x}:(ih-{height})*{y},"
           f"scale={CELL[0]}:{CELL[1]}:flags={'neighbor' if size < 1 else 'area'}")
    text = name.replace(":", r"\:").replace("%", r"\\%")
    label = f"pad=iw:ih+22:0:0:white,drawtext=font=DejaVu Sans:text='{text}':x=4:y=h-17:fontsize=14:fontcolor=black"
    return f"[0]{cut}[a{index}];[{index}]{cut}[b{index}];[a{index}][b{index}]hstack,{label},pad=iw+8:ih+6:4:3:white[c{index}]"


def main(tileflight, tileset, sheet):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "camera.yaml").write_text(CAMERA, encoding="utf-8")
        (folder / "flight.yaml").write_text(FLIGHT, encoding="utf-8")
        pictures = [render(tileflight, tileset, folder, "off", "", [])]
        for index, (_, degrade, options, _, _) in enumerate(EFFECTS, 1):
            pictures.append(render(tileflight, tileset, folder, f"on{index}", degrade, options))
        cells = [halves(index, effect) for index, effect in enumerate(EFFECTS, 1)]
        columns = 2
        layout = "|".join(f"{column}_{row}" for column, row in (
            ("0" if i % columns == 0 else "w0", "+".join(f"h{j}" for j in range(0, i - columns + 1, columns)) or "0")
            for i in range(len(EFFECTS))))
        stack = "".join(f"[c{i}]" for i in range(1, len(EFFECTS) + 1)) + f"xstack=inputs={len(EFFECTS)}:layout={layout}[sheet]"
        inputs = [word for picture in pictures for word in ("-i", str(picture))]
        run(["ffmpeg", "-v", "error", "-y", *inputs, "-filter_complex", ";".join([*cells, stack]), "-map", "[sheet]", "-frames:v", "1",
             "-q:v", "8", sheet])


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
