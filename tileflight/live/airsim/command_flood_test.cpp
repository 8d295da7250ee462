#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <thread>

#include "tests/temporary_folder.h"
#include "tileflight/live/airsim/method_table.h"
#include "tileflight/live/airsim/session.h"
#include "tileflight/live/autopilot/test_ardupilot_client.h"
#include "tileflight/live/rpc/server.h"
#include "tileflight/live/rpc/test_client.h"
#include "tileflight/live/simulator/test_world.h"

/// Clients that send commands as fast as they can, without waiting for what comes of them.
namespace tileflight::airsim::command_flood_test {
namespace {

constexpr std::uint32_t kCommands = 10'000;  // of each client
using Yaw = std::map<std::string, float>;
using Vector = std::map<std::string, float>;

/// A server in a thread of its own.
class RunningServer {
 public:
  RunningServer(Levels& levels, SessionRecorder* recorder)
      : server_(
            make_method_table(levels, [this] { return server_.statistics(); }), {}, {},
            recorder == nullptr
                ? rpc::Server::Caller()
                : [&levels, recorder](
                      const rpc::MethodTable& methods, std::uint64_t client,
                      const rpc::Request& request) { return recorder->call(levels, methods, client, request); }),
        network_([this] { server_.run(); }) {}
  ~RunningServer() {
    server_.stop();
    network_.join();
  }
  RunningServer(const RunningServer&) = delete;
  RunningServer& operator=(const RunningServer&) = delete;

  rpc::Server& server() { return server_; }

 private:
  rpc::Server server_;
  std::thread network_;
};

/// The i-th command of a flood: flights that cut each other short, poses and numbers that are none.
std::string command(std::uint32_t i) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::string drone = "Drone";
  switch (i % 5) {
    case 0:
      return rpc::request_bytes(i, "moveByVelocity", 1.0F, 0.0F, -0.1F, 5.0F, 0, Yaw{{"yaw_or_rate", 0.0F}}, drone);
    case 1:
      return rpc::request_bytes(i, "moveByVelocity", nan, nan, nan, nan, 0, Yaw{{"yaw_or_rate", nan}}, drone);
    case 2:
      return rpc::request_bytes(i, "cancelLastTask", drone);
    case 3:
      return rpc::request_bytes(i, "simSetWind", Vector{{"x_val", nan}, {"y_val", 1e30F}, {"z_val", 0.0F}});
    default:
      return rpc::request_bytes(i, "getMultirotorState", drone);
  }
}

/// All are answered.
void flood(std::uint16_t port) {
  rpc::TestClient client(port, 60.0);
  std::thread reader([&] {
    for (std::uint32_t i = 0; i < kCommands; ++i) ASSERT_TRUE(client.receive().has_value()) << i;
  });
  for (std::uint32_t i = 0; i < kCommands; ++i) ASSERT_TRUE(client.send(command(i)));
  reader.join();
}

/// While clients flood the server, an autopilot flies on, and time with it.
void fly_through_a_flood(SessionRecorder* recorder) {
  simulator::SimulatorOptions options;
  options.settings = R"({"Vehicles": {"Drone": {"VehicleType": "SimpleFlight", "AllowAPIAlways": true},
    "Copter": {"VehicleType": "ArduCopter", "ControlPort": 0, "Y": 9}}})";
  if (recorder != nullptr) options.journal = recorder->journal();
  Levels levels(std::make_shared<simulator::Simulator>(options, simulator::test_world::meshes()));
  RunningServer running(levels, recorder);
  std::atomic<bool> flooding{true};
  std::uint32_t frames = 0;
  autopilot::test_support::Observation seen;
  std::thread copter([&] {
    const autopilot::test_support::UdpClient client(
        static_cast<std::uint16_t>(levels.current()->autopilots().at(0).port));
    while (flooding || frames < 400) {
      const std::string line =
          client.ask(autopilot::test_support::servo_datagram(400, frames++, {1800, 1800, 1800, 1800}));
      ASSERT_FALSE(line.empty());
      seen = autopilot::test_support::parse_state(line);
    }
  });
  std::thread other([&] { flood(running.server().port()); });
  flood(running.server().port());
  other.join();
  flooding = false;
  copter.join();
  EXPECT_NEAR(seen.time_s, frames / 400.0, 1e-9);
  EXPECT_NEAR(levels.current()->statistics().sim_seconds, seen.time_s, 0.0035);
  EXPECT_TRUE(levels.current()->vehicles().get_vehicle_pose("Drone").position.x_val < 1e6F);  // a number
  const rpc::ServerStatistics told = running.server().statistics();
  EXPECT_EQ(told.answers, 2U * kCommands);
  EXPECT_EQ(told.connections_cut, 0U);
  EXPECT_EQ(told.methods.at("simSetWind").errors, told.methods.at("simSetWind").calls);
  if (recorder != nullptr) recorder->finish(levels);
  levels.stop();
}

TEST(CommandFlood, TimeGoesOnAndEachIsAnswered) { fly_through_a_flood(nullptr); }

TEST(CommandFlood, AlsoWhileItIsRecorded) {
  const tests::TemporaryFolder folder;
  SessionRecorder recorder(folder / "session", {}, nullptr);
  fly_through_a_flood(&recorder);
  SessionReader session(folder / "session");
  std::uint64_t calls = 0;
  while (const auto record = session.next()) calls += std::holds_alternative<RecordedCall>(*record) ? 1 : 0;
  EXPECT_EQ(calls, 2U * kCommands);
}

}  // namespace
}  // namespace tileflight::airsim::command_flood_test
