#include "tileflight/live/airsim/levels.h"

#include <gmock/gmock.h>

#include <future>
#include <thread>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/airsim/method_table.h"
#include "tileflight/live/rpc/method_table.h"
#include "tileflight/live/simulator/test_world.h"

namespace tileflight::airsim::levels_test {
namespace {

using simulator::Simulator;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr const char* kFlying = R"({"SimMode": "Multirotor", "ClockSpeed": 20})";

/// A world that consists of one box of this name.
std::unique_ptr<Simulator> open_box(const std::string& name) {
  if (name == "broken") throw InputError("broken.json", "cannot be read");
  simulator::SimulatorOptions options;
  options.settings = kFlying;
  const geometry::Box3 bounds(geometry::Vec3(-9, -9, -1), geometry::Vec3(9, 9, 0));
  std::vector<imaging::TexturedMesh> meshes{simulator::test_world::box(name, bounds, {1, 2, 3})};
  return std::make_unique<Simulator>(options, std::move(meshes));
}

class ServedLevels : public testing::Test {
 protected:
  std::vector<std::string> objects() const { return levels_.current()->objects().list_scene_objects(".*"); }

  std::vector<std::string> log_;
  Levels levels_{open_box("home"),
                 {{"Forest", "forest"}, {"City", "city"}, {"Ruin", "broken"}},
                 open_box,
                 [this](const std::string& line) { log_.push_back(line); }};
};

TEST_F(ServedLevels, AreLoadedByTheirNames) {
  EXPECT_THAT(objects(), ElementsAre("home"));
  EXPECT_TRUE(levels_.load("Forest"));
  EXPECT_THAT(objects(), ElementsAre("forest"));
  EXPECT_TRUE(levels_.load("City"));
  EXPECT_THAT(objects(), ElementsAre("city"));
  EXPECT_THAT(log_, testing::IsEmpty());
}

TEST_F(ServedLevels, ThatAreUnknownOrBrokenLeaveTheWorldAsItIs) {
  EXPECT_FALSE(levels_.load("forest")) << "a source is no name";
  EXPECT_FALSE(levels_.load("Ruin"));
  EXPECT_THAT(objects(), ElementsAre("home"));
  EXPECT_THAT(log_, ElementsAre("simLoadLevel('forest'): the levels are: City, Forest, Ruin",
                                HasSubstr("simLoadLevel('Ruin'): broken.json")));
  EXPECT_TRUE(levels_.current()->ping());
}

TEST_F(ServedLevels, EndTheTasksOfTheWorldBefore) {
  const std::shared_ptr<Simulator> old = levels_.current();
  old->vehicles().enable_api_control(true, "");
  auto flight = std::async(std::launch::async,
                           [&] { return old->flight().move_by_velocity(0, 0, -1, 3000, 0, simulator::YawMode{}, ""); });
  while (old->statistics().tasks_running == 0) std::this_thread::yield();
  EXPECT_TRUE(levels_.load("Forest"));
  EXPECT_FALSE(flight.get());
  EXPECT_FALSE(levels_.current()->vehicles().is_api_control_enabled("")) << "as after a reset";
}

TEST_F(ServedLevels, AreNotLoadedAfterTheEnd) {
  levels_.stop();
  EXPECT_FALSE(levels_.load("Forest"));
  EXPECT_THAT(objects(), ElementsAre("home"));
}

/// The bytes of simLoadLevel('Forest') and of simListSceneObjects('.*'), as AirSim's client sends them.
TEST_F(ServedLevels, AreWhatTheNextCallsOfClientsMeet) {
  const rpc::MethodTable table = make_method_table(levels_, [] { return rpc::ServerStatistics{}; });
  const auto ask = [&](const std::string& request) { return table.call(rpc::Request(request)).bytes; };
  const std::string list("\x94\x00\x02\xb3simListSceneObjects\x91\xa2.*", 27);
  EXPECT_EQ(ask(list), "\x94\x01\x02\xc0\x91\xa4home");
  EXPECT_EQ(ask(std::string("\x94\x00\x01\xacsimLoadLevel\x91\xa6"
                            "Forest",
                            24)),
            "\x94\x01\x01\xc0\xc3");
  EXPECT_EQ(ask(list),
            "\x94\x01\x02\xc0\x91\xa6"
            "forest");
  EXPECT_EQ(ask(std::string("\x94\x00\x01\xacsimLoadLevel\x91\xa4"
                            "Moon",
                            22)),
            "\x94\x01\x01\xc0\xc2");
}

}  // namespace
}  // namespace tileflight::airsim::levels_test
