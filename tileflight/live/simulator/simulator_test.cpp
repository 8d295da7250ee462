#include "tileflight/live/simulator/simulator.h"

#include <gmock/gmock.h>

#include <chrono>
#include <functional>
#include <random>
#include <thread>

#include "tileflight/live/simulator/settings.h"
#include "tileflight/live/simulator/test_world.h"

namespace tileflight::simulator::simulator_test {
namespace {

using namespace test_world;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// One of many calls, partly with invalid numbers.
void call_something(Simulator& world, std::mt19937& random) {
  const auto number = [&] { return std::uniform_real_distribution<float>(-30.0F, 30.0F)(random); };
  const YawMode keep{true, 0.0F};
  const std::vector<std::function<void()>> calls{
      [&] {
        world.cameras().get_images({{"0", 0, false, true}, {"3", 5, false, false}}, "", false);
      },
      [&] {
        world.cameras().get_images({{"1", static_cast<int>(random() % 12), true, false}}, "", false);
      },
      [&] { world.vehicles().set_vehicle_pose(pose(number(), number(), -20 + number()), random() % 2 == 0, ""); },
      [&] { world.vehicles().get_multirotor_state(""); },
      [&] { world.flight().takeoff(number(), ""); },
      [&] { world.flight().move_to_position(number(), number(), -15, number(), 5, 0, keep, -1, 1, ""); },
      [&] { world.flight().move_by_velocity(number(), number(), 0, 1, 0, keep, ""); },
      [&] { world.flight().cancel_last_task(""); },
      [&] { world.reset(); },
      [&] { world.vehicles().enable_api_control(true, ""); },
      [&] { world.vehicles().arm_disarm(true, ""); },
      [&] { world.sensors().get_imu_data("", ""); },
      [&] { world.sensors().get_gps_data("", ""); },
      [&] { world.cameras().set_camera_fov("0", 60 + number(), "", false); },
      [&] { world.labels().set_segmentation_object_id(".*wall", static_cast<int>(random() % 300), true); },
      [&] { world.cameras().coverage("0", "", false); },
      [&] { world.statistics(); },
      [&] {
        world.place().voxel_grid({0, 0, 0}, {20, 20, 20}, 2.0F + number());
      },
      [&] { world.vehicles().get_collision_info(""); },
      [&] { world.clock().continue_for_frames(random() % 50); },
      [&] { world.clock().pause(false); },
  };
  try {
    calls[random() % calls.size()]();
  } catch (const std::runtime_error& refused) {
    EXPECT_STRNE(refused.what(), "");
    EXPECT_EQ(std::string(refused.what()).find('\n'), std::string::npos);
  }
}

TEST(Simulator, ManyClientsAtOnceDoNotStopEachOther) {
  const auto world = simulator(R"({"SimMode": "Multirotor", "ClockSpeed": 10})");
  std::vector<std::thread> clients;
  for (unsigned client = 0; client < 6; ++client) {
    clients.emplace_back([&world, client] {
      std::mt19937 random(client);
      for (int i = 0; i < 60; ++i) call_something(*world, random);
    });
  }
  std::thread releases([&world] {  // a pause by one client must not block the others forever
    for (int i = 0; i < 20; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      world->clock().pause(false);
    }
    world->stop();
  });
  for (std::thread& client : clients) client.join();
  releases.join();
  EXPECT_EQ(world->statistics().tasks_running, 0);
  EXPECT_TRUE(world->ping());
}

TEST(Simulator, ARecordingOfTheSettingsBeginsWithTheServer) {
  const auto closed = [] { simulator(R"({"Recording": {"Enabled": true}})"); };
  EXPECT_THAT([&] { closed(); }, ThrowsMessage<std::runtime_error>(HasSubstr("there is nowhere to record to")))
      << "there is nowhere to write";
}

TEST(Simulator, AVehicleThatDoesNotFlyDoesNotStartInTheGround) {
  const auto down_of = [](const std::string& z) {
    return simulator(R"({"SimMode": "ComputerVision", "Vehicles": {"Eye": {"Z": )" + z + "}}}")
        ->vehicles()
        .get_vehicle_pose("")
        .position.z_val;
  };
  const float start = simulator(kComputerVision)->vehicles().get_vehicle_pose("").position.z_val;
  EXPECT_NEAR(start, -0.355, 1e-3) << "as high as one that flies";
  EXPECT_NEAR(down_of("0.3") + 0.3, -0.355, 1e-3) << "not below the ground";
  EXPECT_NEAR(down_of("-5"), 0.0, 1e-6) << "in the air it stays where the settings put it";
  const auto world = simulator(kComputerVision);
  world->vehicles().set_vehicle_pose(pose(3, 4, -9), true, "");
  world->reset();
  EXPECT_NEAR(world->vehicles().get_vehicle_pose("").position.z_val, -0.355, 1e-3);
}

TEST(Simulator, TellsItsSettings) {
  EXPECT_EQ(simulator(kMultirotor)->get_settings_string(), kMultirotor) << "as they were given";
  for (const char* nothing : {"", " \n"})
    EXPECT_EQ(simulator(nothing)->get_settings_string(), default_settings_text()) << "those that hold";
}

TEST(Simulator, VehiclesCanBeAdded) {
  const auto world = simulator(kMultirotor);
  EXPECT_TRUE(world->vehicles().add_vehicle("Second", "SimpleFlight", pose(6, 3, 0), ""));
  EXPECT_FALSE(world->vehicles().add_vehicle("Second", "SimpleFlight", pose(6, 3, 0), "")) << "the name is taken";
  EXPECT_FALSE(world->vehicles().add_vehicle("Eye", "ComputerVision", pose(6, 3, 0), "")) << "of the other mode";
  EXPECT_THAT(world->vehicles().list_vehicles(), testing::ElementsAre("SimpleFlight", "Second"));
  EXPECT_NEAR(world->objects().get_object_pose("Second").position.x_val, 6.0, 1e-5);
  world->vehicles().enable_api_control(true, "Second");
  world->vehicles().arm_disarm(true, "Second");
  EXPECT_TRUE(world->flight().takeoff(20, "Second"));
  EXPECT_NEAR(world->vehicles().get_vehicle_pose("Second").position.z_val, -2.35, 0.15);
}

}  // namespace
}  // namespace tileflight::simulator::simulator_test
