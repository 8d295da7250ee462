"""Clients that mean harm, at `play --foxglove` and `serve --foxglove`: garbage, a frame that claims a gigabyte, clients that
never read, a hundred at once. The program lives, serves others, says one line for each that it closes or refuses, and its
memory stays bounded.

Usage: check_hostile.py TILEFLIGHT WORK_FOLDER
"""
import json
import pathlib
import sys
import time

import programs

MAX_CLIENTS = 64
#: Beyond what the program takes anyway: 64 idle clients, each with some buffers, and a queue of the never-reading.
MORE_MEMORY_MB = 120
SETTINGS = {"SimMode": "ComputerVision", "StepOnDemand": True,
            "CameraDefaults": {"CaptureSettings": [{"ImageType": 0, "Width": 640, "Height": 480}]},
            "Vehicles": {"eye": {"VehicleType": "ComputerVision"}}}


def is_closed(client):
    """Reads until the server says goodbye (a close frame with a reason) or ends the connection; a reset is an end, too."""
    try:
        read = b""
        while b"\x88\x02" not in read:
            more = client.recv(1 << 16)
            if not more:
                break
            read = read[-1:] + more
    except ConnectionError:
        pass
    return True


def ask_for_everything(client, channels=100):
    wanted = [{"id": n, "channelId": n} for n in range(1, channels)]
    client.sendall(programs.frame(json.dumps({"op": "subscribe", "subscriptions": wanted}).encode()))


def faulty_clients(port):
    """Each is closed; returns how many there were."""
    attacks = [
        programs.frame(b"not json"),
        programs.frame(b"\xff\xfe\xfd"),
        programs.frame(b'{"op":"subscribe","subscriptions":[{"id":-1}]}'),
        programs.frame(b"binary", first=0x82),
        programs.frame(b" " * 1000, size=1 << 30),
        programs.frame(b" " * 1000, size=1 << 63),
        programs.frame(b"[" * (1 << 21)),
    ]
    for attack in attacks:
        client, accepted = programs.connect(port)
        assert accepted
        try:
            client.sendall(attack)
        except ConnectionError:
            pass  # it is closed already
        assert is_closed(client)
        client.close()
    for noise in (b"\x00" * 4000 + b"\r\n\r\n", b"GET / HTTP/1.1\r\nHost: x\r\n\r\n", b"SSH-2.0-x\r\n\r\n"):
        client, _ = programs.connect(port, None)
        client.sendall(noise)
        assert is_closed(client)
        client.close()
    return len(attacks) + 3


def crowd(port):
    """A hundred clients or more that subscribe to everything and never read; returns them, and how many were refused."""
    clients, accepted = [], []
    while len(clients) < 100 or len(accepted) < MAX_CLIENTS:  # the places of those before are free soon
        assert len(clients) < 1000, len(accepted)
        clients.append(programs.connect(port, receive_buffer=4096))
        accepted = [client for client, is_accepted in clients if is_accepted]
    assert len(accepted) == MAX_CLIENTS, len(accepted)
    for client in accepted:
        ask_for_everything(client)
    return clients, len(clients) - len(accepted)


def attack(program, port, busy_s):
    """Returns the number of lines that it must have said."""
    before = program.memory_mb()
    lines = faulty_clients(port)
    clients, refused = crowd(port)
    highest = 0.0
    end = time.monotonic() + busy_s
    while time.monotonic() < end:
        highest = max(highest, program.memory_mb())
        time.sleep(0.05)
    for client, _ in clients:
        client.close()
    lines += MAX_CLIENTS  # they go without a goodbye
    print(f"memory: {before:.0f} MB before, {highest:.0f} MB with {MAX_CLIENTS} clients that never read")
    assert highest < before + MORE_MEMORY_MB, (before, highest)
    return lines + refused


def one_more_is_served(port):
    for _ in range(200):
        client, accepted = programs.connect(port)
        if accepted:
            answer = b""
            while b"serverInfo" not in answer:
                more = client.recv(4096)
                assert more, answer
                answer += more
            return client.close()
        time.sleep(0.05)  # those who left are noticed soon
    raise AssertionError("nobody is let in any more")


def check(program, port, busy_s):
    lines = attack(program, port, busy_s)
    one_more_is_served(port)
    assert program.process.poll() is None, "it lives"
    code, err = program.stop()
    said = [line for line in err if "foxglove client" in line]
    # Those tried again by one_more_is_served() while the crowd was still leaving are refused with a line each, too.
    assert code == 0 and lines <= len(said) and len(said) == len(err), (code, lines, len(said), err[-3:])


def main():
    tileflight, work = sys.argv[1], pathlib.Path(sys.argv[2])
    work.mkdir(parents=True, exist_ok=True)
    flight, tileset = programs.render_flight(tileflight, work)
    with programs.Program(tileflight, "play", flight, "--foxglove", "--port", 0, "--loop", "--rate", 10) as player:
        check(player, player.said["port"], busy_s=3)
    (work / "settings.json").write_text(json.dumps(SETTINGS))
    with programs.Program(tileflight, "serve", tileset, "--settings", work / "settings.json", "--port", 0, "--foxglove",
                          "--foxglove-port", 0, "--foxglove-rate", 60) as server:
        check(server, server.said["foxglove_port"], busy_s=3)


main()
