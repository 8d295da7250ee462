#include "tileflight/live/airsim/session.h"

#include <gmock/gmock.h>

#include <chrono>
#include <fstream>
#include <thread>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/live/airsim/method_table.h"
#include "tileflight/live/autopilot/ports.h"
#include "tileflight/live/autopilot/test_ardupilot_client.h"
#include "tileflight/live/autopilot/test_px4_client.h"
#include "tileflight/live/rpc/test_client.h"
#include "tileflight/live/simulator/test_world.h"

/// Sessions that are recorded, and repeated in a new world.
namespace tileflight::airsim::session_test {
namespace {

using simulator::Simulator;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr const char* kTwoDrones = R"({"ClockSpeed": 20, "Vehicles": {
  "A": {"VehicleType": "SimpleFlight", "AllowAPIAlways": true},
  "B": {"VehicleType": "SimpleFlight", "AllowAPIAlways": true, "Y": 4}}})";

std::string message(std::uint32_t id, const std::string& method, const auto&... arguments) {
  return rpc::request_bytes(id, method, arguments...);
}

/// What has been answered, and a world of a session: recorded, or repeated.
struct World {
  explicit World(const std::string& settings, const std::filesystem::path& file)
      : recorder(std::make_unique<SessionRecorder>(file, SessionHeader{"test", "meshes", settings, "", 7}, nullptr)),
        levels(open(settings, false, 7, recorder->journal(), 0.0, ports), {{"Next", "next"}},
               [this, settings](const std::string&) {
                 recorder->begin_level(8);
                 return open(settings, false, 8, recorder->journal(), 0.0, ports);
               }) {}

  static std::unique_ptr<Simulator> open(const std::string& settings, bool repeats, std::uint64_t start_ns,
                                         const simulator::AutopilotJournal& journal, double lift_m = 0.0,
                                         const std::shared_ptr<autopilot::SharedPorts>& ports = nullptr) {
    simulator::SimulatorOptions options;
    options.settings = settings;
    options.repeats_session = repeats;
    options.clock_start_ns = start_ns;
    options.journal = journal;
    options.autopilot_ports = ports;
    auto meshes = simulator::test_world::meshes();
    for (auto& vertex : meshes[1].mesh.vertices) vertex.y() += lift_m;
    return std::make_unique<Simulator>(options, std::move(meshes));
  }

  /// The answer's bytes.
  std::string ask(std::uint64_t client, const std::string& bytes) {
    return recorder->call(levels, methods, client, rpc::Request(bytes)).bytes;
  }
  /// Ends the session.
  void stop() {
    recorder->finish(levels);
    levels.stop();
  }

  std::unique_ptr<SessionRecorder> recorder;
  std::shared_ptr<autopilot::SharedPorts> ports = std::make_shared<autopilot::SharedPorts>();
  Levels levels;
  rpc::MethodTable methods = make_method_table(levels, [] { return rpc::ServerStatistics{}; });
};

/// Repeats a session in a world whose northern wall is moved by `lift_m`.
ReplayResult repeat(const std::filesystem::path& file, double lift_m = 0.0) {
  SessionSummary session = summarize_session(file);
  const std::string settings = session.header.settings;
  Levels levels(World::open(settings, true, session.header.start_ns, {}, lift_m), {{"Next", "next"}},
                [&](const std::string&) {
                  const std::uint64_t start_ns = session.level_starts_ns.front();
                  session.level_starts_ns.pop_front();
                  return World::open(settings, true, start_ns, {}, lift_m);
                });
  const auto methods = make_method_table(levels, [] { return rpc::ServerStatistics{}; });
  return replay_session(file, session.records, levels, methods);
}

/// A client that flies a vehicle and looks around, by the wall clock.
void fly(World& world, std::uint64_t client, const std::string& vehicle, float east_m) {
  using Yaw = std::map<std::string, float>;
  const std::vector<std::map<std::string, msgpack::type::variant>> pictures{
      {{"camera_name", "front_center"}, {"image_type", 0}, {"pixels_as_float", false}, {"compress", false}},
      {{"camera_name", "front_center"}, {"image_type", 2}, {"pixels_as_float", true}, {"compress", false}}};
  std::thread pilot([&] {
    world.ask(client, message(1, "takeoff", 20.0F, vehicle));
    world.ask(client, message(2, "moveToPosition", 4.0F, east_m, -6.0F, 4.0F, 60.0F, 0, Yaw{{"yaw_or_rate", 0.0F}},
                              -1.0F, 1.0F, vehicle));
  });
  for (std::uint32_t i = 0; i < 30; ++i) {
    world.ask(client, message(3, "simGetImages", pictures, vehicle, false));
    world.ask(client, message(4, "getImuData", "", vehicle));
    world.ask(client, message(5, "getMultirotorState", vehicle));
    std::this_thread::sleep_for(std::chrono::milliseconds(3 * client));
  }
  pilot.join();
}

TEST(Sessions, OfTwoClientsWithAVehicleEachGiveTheSameBytes) {
  const tests::TemporaryFolder folder;
  World world(kTwoDrones, folder / "session");
  std::thread second([&] { fly(world, 2, "B", 8.0F); });
  fly(world, 1, "A", -3.0F);
  second.join();
  world.stop();
  const ReplayResult result = repeat(folder / "session");
  EXPECT_EQ(result.calls, 2U * (2 + 3 * 30));
  EXPECT_EQ(result.answers_compared, result.calls);
  EXPECT_EQ(result.differences, 0U) << result.first_difference->what << " at step " << result.first_difference->tick;
  EXPECT_GT(result.simulated_s, 2.0);
  // Another place: the pictures differ from the first one on.
  const ReplayResult other = repeat(folder / "session", 1.0);
  EXPECT_GT(other.differences, 30U);
  EXPECT_EQ(other.first_difference->what, "simGetImages");
}

TEST(Sessions, KeepPausesStepsAndWind) {
  const tests::TemporaryFolder folder;
  World world(kTwoDrones, folder / "session");
  std::thread flight([&] { world.ask(1, message(1, "takeoff", 20.0F, "A")); });
  for (int i = 0; i < 5; ++i) {
    world.ask(2, message(2, "simPause", true));
    world.ask(2, message(3, "simGetGroundTruthKinematics", "A"));
    world.ask(2, message(4, "simContinueForFrames", 20U));
    world.ask(2, message(5, "simIsPaused"));
    world.ask(2, message(6, "simGetGroundTruthKinematics", "A"));
    world.ask(2, message(7, "simSetWind", std::map<std::string, float>{{"x_val", 2.0F + static_cast<float>(i)}}));
    world.ask(2, message(8, "noSuchMethod", 1, 2));
    world.ask(2, message(9, "simPause", false));
  }
  flight.join();
  world.ask(2, message(10, "reset"));
  world.ask(2, message(11, "simGetGroundTruthKinematics", "A"));
  world.stop();
  const ReplayResult result = repeat(folder / "session");
  EXPECT_EQ(result.calls, 43U);
  EXPECT_EQ(result.differences, 0U) << result.first_difference->what << " at step " << result.first_difference->tick;
}

TEST(Sessions, GoOnInAnotherLevel) {
  const tests::TemporaryFolder folder;
  World world(kTwoDrones, folder / "session");
  std::thread flight([&] { world.ask(1, message(1, "takeoff", 20.0F, "A")); });  // cut short by the level
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  world.ask(2, message(2, "simLoadLevel", "Next"));
  flight.join();
  world.ask(2, message(3, "takeoff", 20.0F, "B"));
  world.ask(2, message(4, "getMultirotorState", "B"));
  world.ask(2, message(5, "simLoadLevel", "Nowhere"));
  world.stop();
  const ReplayResult result = repeat(folder / "session");
  EXPECT_EQ(result.calls, 5U);
  EXPECT_EQ(result.differences, 0U) << result.first_difference->what << " at step " << result.first_difference->tick;
}

TEST(Sessions, RepeatWhatAutopilotsDid) {
  const tests::TemporaryFolder folder;
  World world(R"({"StepOnDemand": true, "Vehicles": {
    "Copter": {"VehicleType": "ArduCopter", "ControlPort": 0},
    "PX4": {"VehicleType": "PX4Multirotor", "Y": 5, "UseSerial": false, "UseTcp": true, "TcpPort": 0,
            "Sensors": {"Down": {"SensorType": 5, "Enabled": true, "Pitch": -90, "MaxDistance": 50}}}}})",
              folder / "session");
  const auto ports = world.levels.current()->autopilots();
  ASSERT_EQ(ports.size(), 2U);
  const auto port = [&](std::size_t i) { return static_cast<std::uint16_t>(ports[i].port); };
  std::atomic<bool> flying{true};
  std::thread px4_thread([&] {
    autopilot::test_support::ScriptedPx4 px4(port(1), {{0, 0, -3}, {4, 0, -3}});
    px4.fly(6.0);
    flying = false;
  });
  std::thread client([&] {
    while (flying) {
      world.ask(1, message(1, "getImuData", "", "PX4"));
      world.ask(1, message(2, "simGetVehiclePose", "Copter"));
      world.ask(1, message(3, "simGetImage", "bottom_center", 0, "Copter", false));
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  });
  const autopilot::test_support::UdpClient copter(port(0));
  for (std::uint32_t frame = 0; flying; ++frame)
    copter.ask(autopilot::test_support::servo_datagram(400, frame, {1750, 1750, 1750, 1750}));
  px4_thread.join();
  client.join();
  world.stop();
  const ReplayResult result = repeat(folder / "session");
  EXPECT_GT(result.calls, 30U);
  EXPECT_GT(result.autopilot_events, 4000U);
  EXPECT_GT(result.answers_compared, result.calls + 1400U);
  EXPECT_EQ(result.differences, 0U) << result.first_difference->what << " at step " << result.first_difference->tick;
}

/// The level's vehicle waits at the same port, and autopilots fly it from its start.
TEST(Sessions, HandPortsOfAutopilotsToTheNextLevel) {
  const tests::TemporaryFolder folder;
  World world(R"({"Vehicles": {"Copter": {"VehicleType": "ArduCopter", "ControlPort": 0}, "PX4": {"Y": 5,
    "VehicleType": "PX4Multirotor", "UseSerial": false, "UseTcp": true, "TcpPort": 0}}})",
              folder / "session");
  const auto before = world.levels.current()->autopilots();
  const autopilot::test_support::UdpClient copter(static_cast<std::uint16_t>(before[0].port));
  const auto climb = [&](std::uint32_t frames) {
    std::string line;
    for (std::uint32_t frame = 0; frame < frames; ++frame)
      line = copter.ask(autopilot::test_support::servo_datagram(400, frame, {1800, 1800, 1800, 1800}));
    return autopilot::test_support::parse_state(line);
  };
  EXPECT_LT(climb(400).position_m.z(), -0.3);
  const std::string yes = world.ask(1, message(1, "simLoadLevel", "Next"));
  EXPECT_TRUE(rpc::decode_response(yes).result().as<bool>());
  const auto after = world.levels.current()->autopilots();
  EXPECT_EQ(after[0].port, before[0].port);
  EXPECT_EQ(after[1].port, before[1].port);
  EXPECT_NEAR(climb(1).position_m.z(), 0.0, 1e-3);
  EXPECT_LT(climb(400).position_m.z(), -0.3);
  std::thread other([&] {
    autopilot::test_support::ScriptedPx4 px4(static_cast<std::uint16_t>(after[1].port), {{0, 0, -3}});
    px4.fly(1.0);
    EXPECT_NEAR(px4.time_s(), 1.0, 0.01);
  });
  climb(500);
  other.join();
  world.ask(1, message(2, "simGetVehiclePose", "Copter"));
  world.stop();
  const ReplayResult result = repeat(folder / "session");
  EXPECT_EQ(result.differences, 0U) << result.first_difference->what << " at step " << result.first_difference->tick;
  EXPECT_EQ(result.calls, 2U);
}

/// A file as a killed server leaves it, cut anywhere, is a session up to its last whole record.
TEST(Sessions, AreReadUpToWhereTheyBreakOff) {
  const tests::TemporaryFolder folder;
  const auto file = folder / "session";
  {
    World world(kTwoDrones, file);
    for (std::uint32_t i = 0; i < 20; ++i) world.ask(1, message(i, "getMultirotorState", "A"));
    world.stop();
  }
  const std::string whole = base::read_text(file);
  std::uint64_t last_calls = 0;
  for (std::size_t bytes = 400; bytes < whole.size(); bytes += 97) {
    const auto cut = folder / "cut";
    std::ofstream(cut, std::ios::binary).write(whole.data(), static_cast<std::streamsize>(bytes));
    const ReplayResult result = repeat(cut);
    EXPECT_EQ(result.differences, 0U);
    EXPECT_GE(result.calls, last_calls);
    last_calls = result.calls;
  }
  EXPECT_GE(last_calls, 18U);
}

TEST(Sessions, OfDamagedFilesAreRefusedInOneLine) {
  const tests::TemporaryFolder folder;
  const auto file = folder / "session";
  {
    World world(kTwoDrones, file);
    world.ask(1, message(1, "getMultirotorState", "A"));
    world.stop();
  }
  EXPECT_THAT([&] { SessionRecorder(file, {}, nullptr); }, ThrowsMessage<InputError>(HasSubstr("exists already")));
  const std::string whole = base::read_text(file);
  std::size_t refused = 0;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    std::string damaged = whole;
    damaged[i] = static_cast<char>(damaged[i] ^ 0xff);
    std::ofstream(file, std::ios::binary) << damaged;
    try {
      summarize_session(file);
    } catch (const InputError& error) {
      ++refused;
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    }
  }
  EXPECT_GT(refused, 20U);
  std::ofstream(file, std::ios::binary) << "{\"SettingsVersion\": 1.2}";
  EXPECT_THAT([&] { summarize_session(file); }, ThrowsMessage<InputError>(HasSubstr("is no session")));
}

/// Files of strangers, whole by their form.
TEST(Sessions, ThatNobodyRecordedEndInOneLine) {
  const tests::TemporaryFolder folder;
  int count = 0;
  const auto write = [&](const std::vector<SessionRecord>& records) {
    const auto file = folder / ("session" + std::to_string(++count));
    SessionWriter writer(file, {"test", "meshes", kTwoDrones, "", 7});
    for (const SessionRecord& record : records) EXPECT_TRUE(writer.add(record));
    return file;
  };
  const auto never = write({RecordedEnd{kMaxTick + 1}});
  EXPECT_THAT([&] { summarize_session(never); }, ThrowsMessage<InputError>(HasSubstr("it would take years")));
  // A call waits for its take-off when the file turns out to be of another world.
  RecordedEvent step;
  step.event.kind = simulator::AutopilotEvent::Kind::kStep;
  step.event.vehicle = "nobody";
  const auto strange = write({RecordedCall{0, 1, 0, message(1, "takeoff", 20.0, "A")}, step});
  EXPECT_THAT([&] { repeat(strange); }, ThrowsMessage<InputError>(HasSubstr("vehicle 'nobody'")));
  const auto no_call = write({RecordedCall{0, 1, 0, "nonsense"}, RecordedAnswer{0, {}, false, 1}});
  EXPECT_EQ(repeat(no_call).differences, 1U) << "nothing is the answer to what is no call";
}

}  // namespace
}  // namespace tileflight::airsim::session_test
