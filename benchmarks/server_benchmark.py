#!/usr/bin/env python3
"""Images per second that `tileflight serve` answers, and what the protocol itself takes.

    PYTHONPATH=clients/python benchmarks/server_benchmark.py --binary build/release/bin/tileflight \
        --source out/stadium/place/twin/tileset.json

An image is one frame: scene alone, or scene, depth and segmentation of one instant in one call. Uncompressed; the
vehicle is moved before each, so that nothing can be answered twice. Processor time is the server's, of one client, the
smallest of three times: unlike the rates it hardly depends on what else the machine does. Clients are processes that read the answers' bytes
without decoding them, which in Python takes longer than rendering.

With --fly, a camera crosses a place whose tiles follow it, in a straight line at --speed, and takes pictures all the
time; reported are the pauses between pictures and those of the clock:

    benchmarks/make_city.py 8 out/city64
    PYTHONPATH=clients/python benchmarks/server_benchmark.py --binary build/release/bin/tileflight \
        --source out/city64/tileset.json --fly 400 --speed 5 --height 60 --memory 2
"""
import argparse
import json
import os
import pathlib
import socket
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT / "clients/python"), str(ROOT / "clients/python/tests")]
import msgpack  # noqa: E402
import tileflight_airsim as airsim  # noqa: E402
import tiny_place  # noqa: E402

SIZES = {"small": (256, 144), "vga": (640, 480), "hd": (1920, 1080)}
FLOWN = (320, 240)
KINDS = {"RGB": [(0, False)], "RGB+depth+segmentation": [(0, False), (1, True), (5, False)]}


def settings_of_flight():
    capture = {"ImageType": 0, "Width": FLOWN[0], "Height": FLOWN[1], "FOV_Degrees": 90}
    camera = {"X": 0, "Y": 0, "Z": 0, "Pitch": -30, "CaptureSettings": [capture]}
    return {"SettingsVersion": 1.2, "SimMode": "ComputerVision",
            "Vehicles": {"Eye0": {"VehicleType": "ComputerVision", "Cameras": {"flown": camera}}}}


def settings():
    def captures(width, height):
        return [{"ImageType": kind, "Width": width, "Height": height, "FOV_Degrees": 90} for kind in (0, 1, 5)]

    cameras = {name: {"X": 0, "Y": 0, "Z": 0, "Pitch": -30, "CaptureSettings": captures(*size)}
               for name, size in SIZES.items()}
    vehicles = {f"Eye{i}": {"VehicleType": "ComputerVision", "Cameras": cameras} for i in range(4)}
    return {"SettingsVersion": 1.2, "SimMode": "ComputerVision", "Vehicles": vehicles}


class Reader:
    """Sends requests and counts the bytes of answers, each of which is as long as the first of its kind."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port))
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.buffer = bytearray(1 << 24)
        self.lengths = {}

    def call(self, method, *args):
        self.socket.sendall(msgpack.packb([0, 1, method, args]))
        if method in self.lengths:
            view, left = memoryview(self.buffer), self.lengths[method]
            while left:
                left -= self.socket.recv_into(view, min(left, len(view)))
            return None
        unpacker = msgpack.Unpacker(raw=False, max_buffer_size=2**31 - 1)
        length = 0
        while True:
            data = self.socket.recv(1 << 20)
            length += len(data)
            unpacker.feed(data)
            for answer in unpacker:
                if answer[2] is not None:
                    raise RuntimeError(answer[2])
                self.lengths[method] = length
                return answer[3]


def frame_taker(port, vehicle, camera, kind):
    """A function that moves the vehicle and takes the i-th frame; the first two are taken."""
    reader = Reader(port)
    requests = [airsim.ImageRequest(camera, t, f, False).to_msgpack() for t, f in KINDS[kind]]
    pose = airsim.Pose(airsim.Vector3r(0, 0, -20)).to_msgpack()

    def frame(i):
        pose["position"]["x_val"] = 0.1 * (i % 100)
        reader.call("simSetVehiclePose", pose, True, vehicle)
        reader.call("simGetImages", requests, vehicle, False)

    frame(0)
    frame(1)
    return frame


def take(port, vehicle, camera, kind, seconds):
    """(frames, seconds)"""
    frame = frame_taker(port, vehicle, camera, kind)
    begin, frames = time.monotonic(), 0
    while time.monotonic() < begin + seconds:
        frame(frames)
        frames += 1
    return frames, time.monotonic() - begin


def processor_ms(pid):
    """User and system time of a process since its start."""
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return 1e3 * (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def processor_time_a_call(server, port, camera, kind, calls):
    """Milliseconds of processor time that the server takes for a call of one client."""
    frame = frame_taker(port, "Eye0", camera, kind)
    begin = processor_ms(server.pid)
    for i in range(calls):
        frame(i)
    return (processor_ms(server.pid) - begin) / calls


def frames_per_second(port, clients, camera, kind, seconds):
    processes = [subprocess.Popen([sys.executable, __file__, "--client-of", str(port), "--take",
                                   json.dumps([f"Eye{i}", camera, kind, seconds])], stdout=subprocess.PIPE, text=True)
                 for i in range(clients)]
    results = [json.loads(process.communicate()[0]) for process in processes]
    return sum(frames / taken for frames, taken in results)


def overhead(port, camera="small", times=200):
    """(ms of a ping, ms of a picture, ms of these outside of the method): single client, medians of calls."""
    reader = Reader(port)
    request = [airsim.ImageRequest(camera, 0, False, False).to_msgpack()]
    pings, pictures, own = [], [], []
    with airsim.VehicleClient(port=port) as client:
        def in_the_method():
            return client.tfStatistics().server.methods["simGetImages"]["seconds"]

        def taken_ms(*call):
            begin = time.perf_counter()
            reader.call(*call)
            return 1e3 * (time.perf_counter() - begin)

        reader.call("simGetImages", request, "Eye0", False)
        for _ in range(times):
            pings.append(taken_ms("ping"))
            before = in_the_method()
            pictures.append(taken_ms("simGetImages", request, "Eye0", False))
            own.append(pictures[-1] - 1e3 * (in_the_method() - before))
    return tuple(statistics.median(values) for values in (pings, pictures, own))


def fly(port, metres, speed, height, pictures):
    """(pauses between pictures in ms, pauses of the clock in ms, statistics). The first second is not counted."""
    gaps_ms, clock_ms = [], []
    request = [airsim.ImageRequest("flown", 0, False, False)]
    with airsim.VehicleClient(port=port) as client:
        def look(way):
            client.simSetVehiclePose(airsim.Pose(airsim.Vector3r(way - metres / 2, 0, -height)), True, "Eye0")
            return client.simGetImages(request, "Eye0")[0].time_stamp

        look(0)
        begin = last = time.monotonic()
        last_clock = None
        while (now := time.monotonic()) < begin + metres / speed:
            clock = look(speed * (now - begin))
            done = time.monotonic()
            if done > begin + 1:
                gaps_ms.append(1e3 * (done - last))
                # What the clock lost against the wall's.
                clock_ms.append(1e3 * (done - last) - 1e-6 * (clock - last_clock))
            last, last_clock = done, clock
            time.sleep(max(0, 1 / pictures - (time.monotonic() - now)))
        return gaps_ms, clock_ms, client.tfStatistics().simulator


def report_flight(port, options):
    gaps, clock, statistic = fly(port, options.fly, options.speed, options.height, options.pictures)
    gaps.sort()
    print(f"{options.fly:g} m at {options.speed:g} m/s, {len(gaps)} pictures: median {statistics.median(gaps):.0f} ms from one to "
          f"the next, 99 % below {gaps[int(0.99 * len(gaps))]:.0f} ms, longest {gaps[-1]:.0f} ms; the clock lost at most "
          f"{max(clock):.0f} ms; {statistic.scenes_built} scenes, {statistic.tiles_read} tiles read, "
          f"{statistic.memory_bytes / 1e9:.2f} GB, error {statistic.error_px:.2f} pixels")


def peak_memory_gb(pid):
    for line in pathlib.Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmHWM"):
            return int(line.split()[1]) * 1024 / 1e9
    return float("nan")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--binary", default=os.environ.get("TILEFLIGHT_BINARY", "build/release/bin/tileflight"))
    parser.add_argument("--source", help="tileset (default: a small one made by hand)")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=4.0, help="of each measurement")
    parser.add_argument("--fly", type=float, metavar="METRES", help="measure pauses on a way northwards over the place")
    parser.add_argument("--speed", type=float, default=5.0, help="metres a second")
    parser.add_argument("--height", type=float, default=60.0, help="metres above the start")
    parser.add_argument("--pictures", type=float, default=20.0, help="at most, a second")
    parser.add_argument("--memory", type=float, default=2.0, help="GB, with --fly")
    parser.add_argument("--client-of", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--take", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.client_of:
        print(json.dumps(take(options.client_of, *json.loads(options.take))))
        return
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "settings.json").write_text(json.dumps(settings_of_flight() if options.fly else settings()))
        source = options.source or tiny_place.write(folder / "place")
        follow = ["--follow", "sensors", "--memory", str(options.memory)] if options.fly else []
        threads = ["--threads", str(options.threads)] if options.threads else []
        begin = time.monotonic()
        server = subprocess.Popen([options.binary, "serve", str(source), "--settings", str(folder / "settings.json"),
                                   "--port", "0", "--json", "--quiet", *threads, *follow], stdout=subprocess.PIPE, text=True)
        try:
            text = ""
            while not text.endswith("}\n"):
                text += server.stdout.readline()
            port = json.loads(text)["port"]
            if options.fly:
                print(f"started in {time.monotonic() - begin:.1f} s")
                report_flight(port, options)
                print(f"peak {peak_memory_gb(server.pid):.2f} GB")
                return
            print("| images/s | 1 client | 4 clients | processor ms a call |\n| --- | ---: | ---: | ---: |")
            for camera, (width, height) in SIZES.items():
                for kind in KINDS:
                    one, four = (frames_per_second(port, n, camera, kind, options.seconds) for n in (1, 4))
                    calls = max(5, round(5e6 / (width * height)))
                    processor = min(processor_time_a_call(server, port, camera, kind, calls) for _ in range(3))
                    print(f"| {width} x {height} {kind} | {one:.1f} | {four:.1f} | {processor:.1f} |", flush=True)
            ping_ms, taken_ms, own_ms = overhead(port)
            print(f"ping {ping_ms:.3f} ms; a picture of 256 x 144 {taken_ms:.3f} ms, of which the protocol {own_ms:.3f} ms")
        finally:
            server.terminate()
            server.wait()


if __name__ == "__main__":
    main()
