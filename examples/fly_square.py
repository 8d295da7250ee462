#!/usr/bin/env python3
"""A ground station that flies a square with a real ArduCopter or PX4 over `tileflight serve`, and logs what was truly flown.

    examples/fly_square.py {ardupilot,px4} [--link tcp:127.0.0.1:5760] [--port 41451] [--side 40] [--height 25] [--by-vision] --out DIR

Takes off, flies the corners north, east, south and west of the start, lands, and waits until the motors have stopped. DIR gets
flight.csv (simulated time, true position north, east, down from the start, the autopilot's mode) and frames/ (two pictures a
simulated second of the camera below). --by-vision: of PX4 without a receiver, whose vision says nothing before it has moved: the
ground station's sticks take it up in altitude mode and sway it until its filter has a position. --port 0: there is no server, as
where a flight file's `autopilot: {command: …}` starts all this; then the autopilot's own position counts, and there are no pictures. Needs pymavlink, which both autopilots' sources bring, and msgpack. Exit code 1: it did not
take off, missed a corner, or did not land.
"""
import argparse
import math
import pathlib
import sys
import time

from pymavlink import mavutil

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "clients/python"))
import tileflight_airsim as airsim  # noqa: E402

mavlink = mavutil.mavlink
LINKS = {"ardupilot": "tcp:127.0.0.1:5760", "px4": "udpin:127.0.0.1:14540"}
PATIENCE_S = 600  # of the wall clock, for each part of the flight
POSITION_ONLY = 0b110111111000  # type_mask of SET_POSITION_TARGET_LOCAL_NED: all but x, y, z is ignored


class Flight:
    def __init__(self, options):
        self.options = options
        self.link = mavutil.mavlink_connection(options.link or LINKS[options.autopilot], source_system=255)
        self.truth = airsim.MultirotorClient(port=options.port) if options.port else None
        self.vehicle = self.truth.listVehicles()[0] if self.truth else ""
        self.heard = {}
        self.offset = (0.0, 0.0)  # of the start in the filter's frame
        self.next_picture_s = 0.0
        self.pictures = options.out / "frames"
        self.pictures.mkdir(parents=True)
        self.log = (options.out / "flight.csv").open("w", encoding="ascii")
        self.log.write("time_s,north_m,east_m,down_m,mode\n")

    def hear(self, seconds=0.1):
        """Reads what the autopilot says, and logs where the vehicle truly is."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            message = self.link.recv_match(blocking=True, timeout=left)
            if message:
                self.heard[message.get_type()] = message
        now_s, at = self.true_position() if self.truth else self.own_position()
        self.log.write(f"{now_s:.3f},{at.x_val:.3f},{at.y_val:.3f},{at.z_val:.3f},{self.link.flightmode}\n")
        return at

    def own_position(self):
        own = self.heard.get("LOCAL_POSITION_NED")
        return (1e-3 * own.time_boot_ms, airsim.Vector3r(own.x, own.y, own.z)) if own else (0.0, airsim.Vector3r())

    def true_position(self):
        now_s = 1e-9 * self.truth.getMultirotorState(self.vehicle).timestamp
        if now_s >= self.next_picture_s:
            self.next_picture_s = now_s + 0.5
            image, = self.truth.simGetImages([airsim.ImageRequest("bottom_center", 0)], self.vehicle)
            (self.pictures / f"{round(1000 * now_s):08d}.png").write_bytes(image.image_data_uint8)
        return now_s, self.truth.simGetGroundTruthKinematics(self.vehicle).position

    def until(self, what, done, repeat=lambda: None):
        """Asks again every second until it is so."""
        print(f"{what} ...", flush=True)
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            repeat()
            for _ in range(10):
                if done(self.hear()):
                    return
        raise SystemExit(f"fly_square: {what}: not within {PATIENCE_S} s; last heard: {self.heard.get('STATUSTEXT')}")

    def command(self, number, *parameters):
        self.link.mav.command_long_send(self.link.target_system, self.link.target_component, number, 0,
                                        *(list(parameters) + [0] * 7)[:7])

    def go(self, north, east):
        self.link.mav.set_position_target_local_ned_send(
            0, self.link.target_system, self.link.target_component, mavlink.MAV_FRAME_LOCAL_NED, POSITION_ONLY,
            north + self.offset[0], east + self.offset[1], -self.options.height, 0, 0, 0, 0, 0, 0, 0, 0)

    def stick(self, forward, up):
        """Of a pilot, -1 to 1."""
        self.link.mav.manual_control_send(self.link.target_system, round(1000 * forward), 0, round(500 + 500 * up), 0, 0)

    def heartbeat(self):
        self.link.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)

    def is_ready(self, _):
        """Its filter has a position, by its own word."""
        report = self.heard.get("EKF_STATUS_REPORT") or self.heard.get("ESTIMATOR_STATUS")
        position = mavlink.ESTIMATOR_POS_HORIZ_ABS | mavlink.ESTIMATOR_POS_HORIZ_REL  # the latter without a receiver
        return (report is not None and report.flags & position and report.flags & mavlink.ESTIMATOR_VELOCITY_HORIZ
                and "LOCAL_POSITION_NED" in self.heard)

    def ask_for_streams(self):
        self.heartbeat()
        for number in (mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS, 193):  # 193: EKF_STATUS_REPORT
            self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, number, 100_000)

    def climb_blindly(self):
        """By the barometer, then to and fro until there is a position."""
        def begin():
            self.heartbeat()
            self.stick(0, 0)
            self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 2)  # custom mode, PX4_CUSTOM_MAIN_MODE_ALTCTL
            self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        self.until("climb by the barometer", lambda at: self.stick(0, 0.5) or -at.z_val > self.options.height - 5, begin)
        self.heard.pop("LOCAL_POSITION_NED", None)
        self.until("position of its filter, by vision",
                   lambda at: self.stick(0.3 if int(time.monotonic() / 3) % 2 else -0.3, 0) or self.is_ready(at), self.ask_for_streams)
        own, true = self.heard["LOCAL_POSITION_NED"], self.hear()
        self.offset = (own.x - true.x_val, own.y - true.y_val)

    def take_off(self):
        if self.options.autopilot == "ardupilot":
            def begin():
                self.heartbeat()
                self.link.set_mode("GUIDED")
                self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
                self.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, self.options.height)
        else:
            def begin():  # offboard: positions have to come before the mode and all the time
                self.heartbeat()
                self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 6)  # custom mode, PX4_CUSTOM_MAIN_MODE_OFFBOARD
                self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        self.until("take-off", lambda at: self.keep(0, 0) or -at.z_val > self.options.height - 2, begin)

    def keep(self, north, east):
        if self.options.autopilot == "px4":
            self.go(north, east)

    def fly_to(self, north, east):
        near = 0

        def is_there(at):
            nonlocal near
            self.keep(north, east)
            near = near + 1 if math.hypot(at.x_val - north, at.y_val - east) < 1.5 else 0
            return near >= 10

        self.until(f"corner {north:g} m north, {east:g} m east", is_there, lambda: (self.heartbeat(), self.go(north, east)))

    def land(self):
        def begin():
            self.heartbeat()
            if self.options.autopilot == "ardupilot":
                self.link.set_mode("LAND")
            else:
                self.command(mavlink.MAV_CMD_NAV_LAND)
        begin()
        self.until("landing", lambda _: not self.link.motors_armed(), self.heartbeat)

    def fly(self):
        print(f"waiting for a heartbeat at {self.options.link or LINKS[self.options.autopilot]} ...", flush=True)
        if not self.link.wait_heartbeat(timeout=PATIENCE_S):
            raise SystemExit("fly_square: no autopilot is heard")
        if self.options.by_vision:
            self.climb_blindly()
        else:
            self.until("position of its filter", self.is_ready, self.ask_for_streams)
        self.take_off()
        side = self.options.side
        for corner in ((side, 0), (side, side), (0, side), (0, 0)):
            self.fly_to(*corner)
        self.land()
        at = self.hear()
        self.log.close()
        print(f"landed {math.hypot(at.x_val, at.y_val):.2f} m from the start")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("autopilot", choices=list(LINKS))
    parser.add_argument("--link", help="of pymavlink (default: the autopilot's own)")
    parser.add_argument("--port", type=int, default=41451, help="of tileflight serve; 0: there is none")
    parser.add_argument("--side", type=float, default=40, help="metres")
    parser.add_argument("--height", type=float, default=25, help="metres above the start")
    parser.add_argument("--by-vision", action="store_true", help="of PX4 without a receiver")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    Flight(parser.parse_args()).fly()


if __name__ == "__main__":
    main()
