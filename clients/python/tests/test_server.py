"""The client against a running `tileflight serve`. TILEFLIGHT_BINARY names the program."""
import contextlib
import io
import json
import math
import pathlib
import signal
import socket
import struct
import tempfile
import threading
import time
import unittest

import tileflight_airsim as airsim
import tiny_place
from running_server import RunningServer

LOOKING = {"SimMode": "ComputerVision"}
FLYING = {"SimMode": "Multirotor"}


def depth_request(camera):
    return airsim.ImageRequest(camera, airsim.ImageType.DepthPlanar, pixels_as_float=True, compress=False)


class Outdoors(unittest.TestCase):
    def test_weather_and_time_of_day_change_pictures_and_go_again(self):
        """The calls of AirSim's weather.py and time_of_day.py, with what each shows."""
        origin = {"Latitude": 47.641468, "Longitude": -122.140165, "Altitude": 122}
        with RunningServer({**LOOKING, "OriginGeopoint": origin}) as server, server.client() as client:
            def seen():
                return client.simGetImages([airsim.ImageRequest("0", 0, False, False)])[0].image_data_uint8

            client.simSetVehiclePose(airsim.Pose(airsim.Vector3r(0, 0, -2)), True)
            plain = seen()
            client.simEnableWeather(True)
            for parameter in (airsim.WeatherParameter.Rain, airsim.WeatherParameter.Roadwetness,
                              airsim.WeatherParameter.Snow, airsim.WeatherParameter.Dust, airsim.WeatherParameter.Fog):
                client.simSetWeatherParameter(parameter, 0.75)
                self.assertNotEqual(seen(), plain, parameter)
                client.simSetWeatherParameter(parameter, 0.0)
                self.assertEqual(seen(), plain, parameter)
            client.simSetWeatherParameter(airsim.WeatherParameter.Fog, 0.25)
            thin = seen()
            client.simSetWeatherParameter(airsim.WeatherParameter.Fog, 0.5)
            self.assertNotIn(seen(), (thin, plain))
            client.simEnableWeather(False)
            self.assertEqual(seen(), plain)
            client.simSetTimeOfDay(True, start_datetime="2018-02-12 15:20:00", is_start_datetime_dst=True,
                                   celestial_clock_speed=0, update_interval_secs=1, move_sun=True)
            afternoon = seen()
            self.assertNotEqual(afternoon, plain)
            client.simSetTimeOfDay(True, start_datetime="2018-02-12 02:20:00", celestial_clock_speed=0)
            self.assertLess(sum(seen()), sum(afternoon) / 2)
            client.simSetTimeOfDay(False)
            self.assertEqual(seen(), plain)


class Looking(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server = RunningServer(LOOKING).__enter__()
        cls.client = cls.server.client()

    @classmethod
    def tearDownClass(cls):
        cls.client.close()
        cls.server.__exit__()

    def test_the_server_is_there(self):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            self.client.confirmConnection()
        self.assertEqual(printed.getvalue(),
                         "Connected!\nClient Ver:1 (Min Req: 1), Server Ver:1 (Min Req: 1)\n\n")
        self.assertEqual((self.client.getServerVersion(), self.client.getMinRequiredClientVersion()), (1, 1))
        self.assertEqual(self.client.listVehicles(), self.server.listening["vehicles"])

    def test_the_pose_that_is_set_is_the_pose_of_the_next_picture(self):
        for north, east, down, yaw in ((0, 0, -2, 0), (5.5, -3.25, -10, 1.0), (-20, 15, -1, -2.5)):
            pose = airsim.Pose(airsim.Vector3r(north, east, down), airsim.to_quaternion(0, 0, yaw))
            self.client.simSetVehiclePose(pose, True)
            got = self.client.simGetVehiclePose()
            self.assertLess(got.position.distance_to(pose.position), 1e-4)
            image = self.client.simGetImages([airsim.ImageRequest("0", 0)])[0]
            info = self.client.simGetCameraInfo("0")
            self.assertLess(image.camera_position.distance_to(info.pose.position), 1e-4)
            self.assertAlmostEqual(airsim.to_eularian_angles(image.camera_orientation)[2], yaw, places=4)

    def test_pictures_have_the_forms_that_scripts_expect(self):
        requests = [airsim.ImageRequest("0", airsim.ImageType.Scene, False, False),
                    airsim.ImageRequest("0", airsim.ImageType.Scene), depth_request("0"),
                    airsim.ImageRequest("0", airsim.ImageType.Segmentation, False, False)]
        raw, png, depth, segmentation = self.client.simGetImages(requests)
        self.assertEqual((raw.width, raw.height, len(raw.image_data_uint8)), (256, 144, 3 * 256 * 144))
        self.assertEqual(png.image_data_uint8[:8], b"\x89PNG\r\n\x1a\n")
        self.assertEqual(png.image_data_uint8[24:26], b"\x08\x06")  # 8 bits, RGBA
        self.assertEqual((len(depth.image_data_float), depth.image_data_uint8), (256 * 144, b""))
        self.assertEqual(len(segmentation.image_data_uint8), 3 * 256 * 144)
        self.assertEqual(self.client.simGetImage("0", 0)[:4], b"\x89PNG")

    def test_depth_straight_ahead_is_the_distance_to_the_box(self):
        self.client.simSetVehiclePose(airsim.Pose(airsim.Vector3r(0, 0, -2)), True)
        image = self.client.simGetImages([depth_request("front_center")])[0]
        middle = image.image_data_float[(image.height // 2) * image.width + image.width // 2]
        expected = tiny_place.BOX_NORTH_M - image.camera_position.x_val
        self.assertAlmostEqual(middle, expected, places=3)
        below = self.client.simGetImages([depth_request("bottom_center")])[0]
        height = below.image_data_float[(below.height // 2) * below.width + below.width // 2]
        self.assertAlmostEqual(height, 2.0, delta=0.5)  # the origin is the body's underside

    def test_moving_towards_the_box_brings_it_nearer(self):
        middles = []
        for north in (0, 5):
            self.client.simSetVehiclePose(airsim.Pose(airsim.Vector3r(north, 0, -2)), True)
            image = self.client.simGetImages([depth_request("0")])[0]
            middles.append(image.image_data_float[72 * 256 + 128])
        self.assertAlmostEqual(middles[0] - middles[1], 5.0, places=3)

    def test_the_box_is_red_and_raw_pixels_are_blue_green_red(self):
        self.client.simSetVehiclePose(airsim.Pose(airsim.Vector3r(0, 0, -2)), True)
        image = self.client.simGetImages([airsim.ImageRequest("0", 0, False, False)])[0]
        blue, green, red = image.image_data_uint8[3 * (72 * 256 + 128):][:3]
        self.assertGreater(red, 2 * blue)
        self.assertGreater(red, 2 * green)

    def test_sensors_are_there_without_flying(self):
        self.assertIsInstance(self.client.tfGeodeticPose().altitude, float)

    def test_detections_are_boxes_of_what_pictures_show(self):
        self.client.simSetVehiclePose(airsim.Pose(airsim.Vector3r(0, 0, -2)), True)
        for camera in ("0", "bottom_center"):
            self.client.simAddDetectionFilterMeshName(camera, airsim.ImageType.Scene, "*")
        self.client.simSetDetectionFilterRadius("0", airsim.ImageType.Scene, 200 * 100)
        seen = self.client.simGetDetections("0", airsim.ImageType.Scene)
        self.assertTrue(seen)
        self.assertLessEqual({one.name for one in seen}, set(self.client.simListSceneObjects()))
        for one in seen:
            self.assertLess(one.box2D.min.x_val, one.box2D.max.x_val)
            self.assertLessEqual(one.box2D.max.x_val, 256)
            self.assertLess(one.box3D.min.z_val, one.box3D.max.z_val)
        self.client.simClearDetectionMeshNames("0", airsim.ImageType.Scene)
        self.assertEqual(self.client.simGetDetections("0", airsim.ImageType.Scene), [])

    def test_a_voxel_grid_is_that_of_the_box(self):
        center = airsim.Vector3r(tiny_place.BOX_NORTH_M + tiny_place.BOX_M / 2, 0, -6)
        grid = self.client.tfCreateVoxelGrid(center, airsim.Vector3r(8, 8, 8), 1.0)
        self.assertEqual(grid.dims, [8, 8, 8])
        self.assertEqual(len(grid.occupied), 512)
        self.assertEqual(sum(grid.occupied), grid.occupied_count)
        self.assertGreater(grid.occupied_count, 0)
        self.assertTrue(self.client.simCreateVoxelGrid(center, 8, 8, 8, 1.0, "box.binvox"))
        self.assertTrue((self.server.files / "box.binvox").read_bytes().startswith(b"#binvox 1\ndim 8 8 8\n"))
        self.assertIs(self.client.simCreateVoxelGrid(center, 8, 8, 8, 1.0, "../outside.binvox"), False)

    def test_errors_are_strings_and_the_connection_stays(self):
        with self.assertRaisesRegex(airsim.RPCError, "^rpclib: function 'simGetImages' .called with 3 arg.s.. threw"):
            self.client.simGetImages([airsim.ImageRequest("no such camera", 0)])
        with self.assertRaisesRegex(airsim.RPCError, "^rpclib: client error C0002: Function 'simGetVehiclePose' was "
                                                     "called with an invalid number of arguments. Expected: 1, got: 3"):
            self.client.client.call("simGetVehiclePose", 1, 2, 3)
        with self.assertRaisesRegex(airsim.RPCError, "^rpclib: server could not find function 'fly'"):
            self.client.client.call("fly")
        with self.assertRaisesRegex(airsim.RPCError, "argument 1: position: x_val: expected a number, got a string"):
            self.client.client.call("simSetVehiclePose", {"position": {"x_val": "far"}}, True, "")
        with self.assertRaisesRegex(airsim.RPCError, "Vehicle API for 'Nobody' is not available"):
            self.client.simGetVehiclePose("Nobody")
        self.assertTrue(self.client.ping())

    def test_clients_of_another_version_leave_arguments_out(self):
        images = self.client.client.call("simGetImages", [{"camera_name": "0", "image_type": 0, "annotation_name": ""}], "")
        self.assertEqual(images[0]["width"], 256)
        self.assertEqual(self.client.client.call("simGetImage", "0", 0, "", "")[:4], b"\x89PNG")
        self.assertEqual(self.client.client.call("simGetCameraInfo", "0", "")["fov"], 90.0)

    def test_statistics_tell_of_rendering_and_serving(self):
        self.client.simGetImages([airsim.ImageRequest("0", 0)])
        statistics = self.client.tfStatistics()
        self.assertGreater(statistics.simulator.images, 0)
        self.assertGreater(statistics.server.methods["simGetImages"]["calls"], 0)


class ByHand(unittest.TestCase):
    """Bytes by hand: texts as raw, as clients with use_bin_type=False pack them; answers as they unpack them."""

    @classmethod
    def setUpClass(cls):
        cls.server = RunningServer(LOOKING).__enter__()

    @classmethod
    def tearDownClass(cls):
        cls.server.__exit__()

    def ask(self, request):
        with socket.create_connection(("127.0.0.1", self.server.port), timeout=20) as one:
            one.sendall(request)
            answer = b""
            while not self.whole(answer):
                data = one.recv(65536)
                self.assertTrue(data, "the server has closed the connection")
                answer += data
            return answer

    def whole(self, answer):
        import msgpack
        unpacker = msgpack.Unpacker(raw=True, max_buffer_size=2**31 - 1)
        unpacker.feed(answer)
        return any(True for _ in unpacker)


class AsTheOldClientSpeaks(ByHand):
    def test_ping(self):
        self.assertEqual(self.ask(b"\x94\x00\x00\xa4ping\x90"), b"\x94\x01\x00\xc0\xc3")

    def test_a_client_that_sends_no_more_gets_its_answers(self):
        with socket.create_connection(("127.0.0.1", self.server.port), timeout=20) as one:
            one.sendall(b"\x94\x00\x00\xa4ping\x90" + b"\x94\x00\x05\xb0getServerVersion\x90")
            one.shutdown(socket.SHUT_WR)
            answers = b""
            while data := one.recv(65536):
                answers += data
        self.assertEqual(sorted((answers[:5], answers[5:])), [b"\x94\x01\x00\xc0\xc3", b"\x94\x01\x05\xc0\x01"])

    def test_version(self):
        self.assertEqual(self.ask(b"\x94\x00\x05\xb0getServerVersion\x90"), b"\x94\x01\x05\xc0\x01")

    def test_pose_is_a_map_of_float32(self):
        request = (b"\x94\x00\x01\xb1simSetVehiclePose\x93\x82\xa8position\x83\xa5x_val\x0a\xa5y_val\xcb" +
                   struct.pack(">d", 2.5) + b"\xa5z_val\xfd\xaborientation\x84\xa5w_val\x01\xa5x_val\x00\xa5y_val\x00"
                   b"\xa5z_val\x00\xc3\xa0")
        self.assertEqual(self.ask(request), b"\x94\x01\x01\xc0\xc0")
        answer = self.ask(b"\x94\x00\x07\xb1simGetVehiclePose\x91\xa0")

        def real(value):
            return b"\xca" + struct.pack(">f", value)

        self.assertEqual(answer, b"\x94\x01\x07\xc0\x82\xa8position\x83\xa5x_val" + real(10) + b"\xa5y_val" + real(2.5) +
                         b"\xa5z_val" + real(-3) + b"\xaborientation\x84\xa5w_val" + real(1) + b"\xa5x_val" + real(0) +
                         b"\xa5y_val" + real(0) + b"\xa5z_val" + real(0))

    def test_pictures_are_bin_and_errors_raw16(self):
        request = (b"\x94\x00\x02\xacsimGetImages\x93\x91\x84\xabcamera_name\xa10\xaaimage_type\x00\xafpixels_as_float\xc2"
                   b"\xa8compress\xc2\xa0\xc2")
        answer = self.ask(request)
        self.assertTrue(answer.startswith(b"\x94\x01\x02\xc0\x91\x8c\xb0image_data_uint8\xc6" +
                                          struct.pack(">I", 3 * 256 * 144)), answer[:60])
        self.assertIn(b"\xb0image_data_float\x90\xafcamera_position\x83", answer)
        refused = self.ask(b"\x94\x00\x03\xa3fly\x90")
        text = b"rpclib: server could not find function 'fly' with argument count 0."
        self.assertEqual(refused, b"\x94\x01\x03\xda" + struct.pack(">H", len(text)) + text + b"\xc0")


class AsTheScriptsSpeak(ByHand):
    """Calls that the scripts of AirSim and Cosys-AirSim send, byte for byte, and that they expect to succeed."""

    def nil_of(self, request):
        self.assertEqual(self.ask(b"\x94\x00\x01" + request), b"\x94\x01\x01\xc0\xc0")

    def bool_of(self, request):
        answer = self.ask(b"\x94\x00\x01" + request)
        self.assertEqual(answer[:4], b"\x94\x01\x01\xc0")
        return {b"\xc2": False, b"\xc3": True}[answer[4:]]

    def test_segmentation_finds_all_objects(self):
        self.assertTrue(self.bool_of(b"\xbasimSetSegmentationObjectID\x93\xa5[\\w]*\x00\xc3"))

    def test_weather_light_and_lines_are_answered(self):
        self.nil_of(b"\xb0simEnableWeather\x91\xc3")
        self.nil_of(b"\xb6simSetWeatherParameter\x92\x07\xcb" + struct.pack(">d", 0.5))
        self.nil_of(b"\xafsimSetTimeOfDay\x96\xc3\xa0\xc2\x01\x3c\xc3")
        self.nil_of(b"\xafsimSetTraceLine\x93\x94\x01\x00\x00\x01\x05\xa0")
        self.assertFalse(self.bool_of(b"\xb4simSetLightIntensity\x92\xa4Lamp\x64"))
        self.assertEqual(self.ask(b"\x94\x00\x01\xafsimSwapTextures\x94\xa3tag\x00\x00\x00"), b"\x94\x01\x01\xc0\x90")

    def test_a_voxel_grid_into_a_bad_path_is_false(self):
        center = b"\x83\xa5x_val\x00\xa5y_val\x00\xa5z_val\x00"
        self.assertFalse(self.bool_of(b"\xb2simCreateVoxelGrid\x96" + center + b"\x04\x04\x04\x01\xa7/no/way"))

    def test_poses_of_objects_with_and_without_a_frame(self):
        plain = self.ask(b"\x94\x00\x01\xb0simGetObjectPose\x91\xa5place")
        self.assertTrue(plain.startswith(b"\x94\x01\x01\xc0\x82\xa8position\x83\xa5x_val\xca"), plain)
        self.assertNotIn(b"\x7f\xc0\x00\x00", plain)  # not NaN: the tile place.glb is there
        self.assertEqual(self.ask(b"\x94\x00\x01\xb0simGetObjectPose\x92\xa5place\xc3"), plain)

    def test_lists_of_instance_segmentation(self):
        names = self.ask(b"\x94\x00\x01\xda\x00\x22simListInstanceSegmentationObjects\x90")
        self.assertEqual(names, b"\x94\x01\x01\xc0\x91\xa5place")

    def test_lighting(self):
        request = (b"\x94\x00\x02\xacsimGetImages\x92\x91\x85\xabcamera_name\xa10\xaaimage_type\x0a\xafpixels_as_float"
                   b"\xc2\xa8compress\xc2\xafannotation_name\xa0\xa0")
        self.assertTrue(self.ask(request).startswith(b"\x94\x01\x02\xc0\x91\x8c\xb0image_data_uint8\xc6"))


class Flying(unittest.TestCase):
    def test_arming_as_airsim_does(self):
        with RunningServer(FLYING) as server, server.client() as client:
            self.assertIs(client.armDisarm(True), False)  # no API control yet
            client.enableApiControl(True)
            self.assertTrue(client.takeoffAsync().get())  # armed from the start
            client.reset()
            client.enableApiControl(True)
            self.assertTrue(client.takeoffAsync().get())

    def test_without_settings_their_text_is_that_of_the_defaults(self):
        with RunningServer() as server, server.client() as client:
            settings = json.loads(client.getSettingsString())
            self.assertEqual((settings["SettingsVersion"], settings["SimMode"]), (1.2, "Multirotor"))
            self.assertEqual(list(settings["Vehicles"]), client.listVehicles())

    def test_a_warning_is_told_once(self):
        with RunningServer(FLYING) as server:
            with server.client() as client:
                for _ in range(3):
                    client.simSetWeatherParameter(airsim.WeatherParameter.RoadLeaf, 0.5)
            _, _, err = server.stop()
            self.assertEqual(err.count("warning: simSetWeatherParameter has no effect"), 1, err)

    def test_a_flight(self):
        with RunningServer(FLYING) as server, server.client() as client:
            client.enableApiControl(True)
            self.assertTrue(client.isApiControlEnabled())
            self.assertTrue(client.armDisarm(True))
            self.assertTrue(client.takeoffAsync().get())
            self.assertTrue(client.moveToPositionAsync(8, 3, -6, 4, timeout_sec=60).get())
            state = client.getMultirotorState()
            self.assertEqual(state.landed_state, airsim.LandedState.Flying)
            self.assertLess(state.kinematics_estimated.position.distance_to(airsim.Vector3r(8, 3, -6)), 1.0)
            self.assertTrue(client.rotateToYawAsync(90, 30, 3).get())
            yaw = airsim.to_eularian_angles(client.simGetVehiclePose().orientation)[2]
            self.assertAlmostEqual(math.degrees(yaw), 90, delta=5)
            self.assertAlmostEqual(client.getImuData().linear_acceleration.z_val, -9.8, delta=1.0)
            client.reset()
            self.assertFalse(client.isApiControlEnabled())

    def test_a_task_is_cancelled_over_the_connection_that_waits_for_it(self):
        with RunningServer({**FLYING, "StepOnDemand": False}) as server, server.client() as client:
            client.enableApiControl(True)
            client.armDisarm(True)
            flight = client.moveByVelocityAsync(0, 0, -1, 3000)
            states = [client.getMultirotorState().timestamp for _ in range(3)]
            self.assertFalse(flight.done())
            self.assertEqual(states, sorted(states))
            client.cancelLastTask()
            self.assertIs(flight.get(), False)

    def test_a_new_task_ends_the_one_before(self):
        with RunningServer({**FLYING, "StepOnDemand": False}) as server, server.client() as one, server.client() as two:
            one.enableApiControl(True)
            one.armDisarm(True)
            first = one.moveByVelocityAsync(0, 0, -1, 3000)
            while not one.tfStatistics().simulator.tasks_running:
                time.sleep(0.01)
            self.assertTrue(two.moveByVelocityAsync(0, 0, -1, 0.1).get())
            self.assertIs(first.get(), False)


class Serving(unittest.TestCase):
    def test_loads_the_levels_that_it_was_told_of(self):
        with tempfile.TemporaryDirectory() as folder:
            other = tiny_place.write(pathlib.Path(folder) / "other", name="other.glb")
            with RunningServer(FLYING, "--level", f"Other={other}", "--level", "Broken=nowhere.json") as server:
                with server.client() as client:
                    self.assertEqual(client.simListSceneObjects(), ["place"])
                    client.enableApiControl(True)
                    self.assertTrue(client.takeoffAsync().get())
                    for unknown in ("other", "Broken", str(other), ""):
                        self.assertIs(client.simLoadLevel(unknown), False)
                    self.assertEqual(client.simListSceneObjects(), ["place"])
                    self.assertIs(client.simLoadLevel("Other"), True)
                    self.assertEqual(client.simListSceneObjects(), ["other"])
                    self.assertFalse(client.isApiControlEnabled())
                    self.assertEqual(client.getMultirotorState().landed_state, airsim.LandedState.Landed)
                code, _, err = server.stop()
                self.assertEqual(code, 0)
                self.assertIn("simLoadLevel('other'): the levels are: Broken, Other", err)

    def test_a_level_is_a_name_and_a_source(self):
        for wrong in ("Other", "=place", "Other="):
            with self.assertRaisesRegex(RuntimeError, "--level '" + wrong + "': must be NAME=SOURCE"):
                RunningServer(FLYING, "--level", wrong).__enter__()

    def test_ends_at_a_signal_while_a_task_is_running(self):
        for number in (signal.SIGTERM, signal.SIGINT):
            with RunningServer({**FLYING, "StepOnDemand": False}) as server:
                client = server.client()
                client.enableApiControl(True)
                client.armDisarm(True)
                flight = client.moveByVelocityAsync(0, 0, -1, 3000)
                client.ping()
                code, out, err = server.stop(number)
                self.assertEqual((code, out, err), (0, "", ""))
                self.assertIsNotNone(flight.error)
                client.close()

    def test_a_token_comes_first(self):
        with RunningServer(LOOKING, token="let me in") as server:
            with server.client() as client:
                self.assertTrue(client.ping())
            with airsim.VehicleClient(port=server.port) as client, self.assertRaisesRegex(airsim.RPCError, "token"):
                client.ping()
            with self.assertRaises(airsim.RPCError):
                airsim.VehicleClient(port=server.port, token="let me out")

    def test_garbage_closes_its_connection_and_is_told_of(self):
        with RunningServer(LOOKING) as server, server.client() as client:
            with socket.create_connection(("127.0.0.1", server.port), timeout=20) as one:
                one.sendall(b"GET / HTTP/1.1\r\n\r\n")
                self.assertEqual(one.recv(100), b"")
            self.assertTrue(client.ping())
            code, _, err = server.stop()
            self.assertEqual(code, 0)
            self.assertRegex(err, "^tileflight: 127.0.0.1:[0-9]+: closed: a message is an array of 4 values[^\n]*\n$")

    def test_other_machines_only_when_asked_and_with_a_warning(self):
        with RunningServer(LOOKING, "--bind", "0.0.0.0") as server:
            _, _, err = server.stop()
            self.assertIn("warning: 0.0.0.0 can be reached from other machines", err)

    def test_many_threads_of_one_client(self):
        with RunningServer(LOOKING) as server, server.client() as client:
            right = []

            def ask():
                for _ in range(50):
                    right.append(client.ping() and client.simGetImages([airsim.ImageRequest("0", 0)])[0].width == 256)

            threads = [threading.Thread(target=ask) for _ in range(4)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            self.assertEqual((len(right), all(right)), (200, True))


if __name__ == "__main__":
    unittest.main()
