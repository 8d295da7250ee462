#include "tileflight/world/scene/encounters.h"

#include <gmock/gmock.h>

#include <cmath>
#include <random>

#include "tileflight/world/scene/scene.h"

namespace tileflight::scene::encounters_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using testing::ElementsAre;
using testing::IsEmpty;

/// Along x at 10 m/s from (0, 0, 0), its wheels at height 0.
ActorPlan car(const std::string& name, double north = 0.0) {
  ActorPlan plan;
  plan.name = name;
  plan.route.follows_ground = false;
  for (const double east : {0.0, 100.0, 200.0}) plan.route.points.push_back({{east, north}, 0.0, 10.0});
  return plan;
}

SE3 at(const Vec3& p) { return {Eigen::Quaterniond::Identity(), p}; }

geometry::Trajectory frames_of(const std::vector<Vec3>& places) {
  geometry::Trajectory frames;
  for (const Vec3& place : places) frames.poses.push_back({0.5 * static_cast<double>(frames.size()), at(place)});
  return frames;
}

TEST(Encounters, AreOfTheTimeAtWhichTheCameraIsThere) {
  const Traffic traffic({car("first"), car("beside", 30.0)}, {});
  // The car's middle is at x = 5 k at frame k.
  const Encounters hovers =
      find_encounters(traffic, frames_of({{10, 0, 0.7}, {10, 0, 0.7}, {10, 0, 0.7}, {10, 0, 0.7}}), {});
  EXPECT_THAT(hovers.inside, ElementsAre(2)) << "the car drives over it";
  EXPECT_THAT(hovers.through, ElementsAre(1, 2));
  EXPECT_THAT(hovers.inside_of, ElementsAre("first"));
  const Encounters above = find_encounters(traffic, frames_of({{10, 0, 2.7}, {10, 0, 2.7}, {10, 0, 2.7}}), {});
  EXPECT_THAT(above.inside, IsEmpty());
  EXPECT_THAT(above.through, IsEmpty());
  const Encounters behind = find_encounters(traffic, frames_of({{-4, 0, 0.7}, {1, 0, 0.7}, {6, 0, 0.7}}), {});
  EXPECT_THAT(behind.through, IsEmpty()) << "it follows the car through where the car has been";
}

TEST(Encounters, BetweenTwoFramesAreFound) {
  const Traffic traffic({car("first")}, {});
  // From one side of the car to the other within a frame, the camera also by a bow over it.
  const geometry::Trajectory frames = frames_of({{2.5, -5, 0.7}, {2.5, 5, 0.7}});
  const Encounters straight = find_encounters(traffic, frames, {});
  EXPECT_THAT(straight.inside, IsEmpty());
  EXPECT_THAT(straight.through, ElementsAre(0));
  EXPECT_THAT(straight.through_what, ElementsAre("first"));
  const auto bow = [](double time_s) { return at({2.5, -5 + 20 * time_s, 0.7 + 40 * time_s * (0.5 - time_s)}); };
  EXPECT_THAT(find_encounters(traffic, frames, bow).through, IsEmpty());
}

TEST(ActorSurfaces, AreThoseOfASceneAtThatTime) {
  std::vector<ActorPlan> plans{car("car"), car("van", 1.0), car("ball", -2.0)};
  plans[1].model = Model::kVan;
  plans[1].scale = 1.3;
  plans[2].model = Model::kSphere;
  plans[2].scale = 2.0;
  const auto traffic = std::make_shared<const Traffic>(plans, GroundHeight());
  ActorSurfaces surfaces(traffic);
  imaging::TexturedMesh far;
  far.mesh.vertices = {{900, 0, 900}, {901, 0, 900}, {900, 1, 900}};
  far.mesh.triangles = {{0, 1, 2}};
  const auto place =
      std::make_shared<const ScenePart>(std::vector<imaging::TexturedMesh>{far}, SceneFrame(Vec3::Zero()));
  std::mt19937 random(3);
  std::uniform_real_distribution<double> side(-4.0, 4.0), up(0.0, 3.0);
  int hits = 0;
  for (const double time_s : {0.0, 0.7, 3.1}) {
    surfaces.set_time(time_s);
    const Scene scene({place}, traffic->placed(time_s, time_s));
    const Vec3 middle = traffic->state(0, time_s).T_local_actor.translation;
    for (int i = 0; i < 500; ++i) {
      const Vec3 from = middle + Vec3(side(random), side(random), up(random)),
                 to = middle + Vec3(side(random), side(random), up(random));
      const double length_m = (to - from).norm();
      const auto expected = scene.intersect({from, (to - from) / length_m}, length_m);
      const auto found = surfaces.first_hit(from, to);
      ASSERT_EQ(found.has_value(), expected.has_value());
      if (!found) continue;
      ++hits;
      EXPECT_NEAR(found->distance_m, expected->distance_m, 1e-4);
      EXPECT_EQ(found->actor, scene.placed_of_mesh(expected->mesh));
      EXPECT_NEAR(std::abs(found->normal.dot(scene.normal(*expected).normalized())), 1.0, 1e-4);
    }
  }
  EXPECT_GT(hits, 500);
}

}  // namespace
}  // namespace tileflight::scene::encounters_test
