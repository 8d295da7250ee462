#include "tileflight/evaluation/scoring/points_on_actors.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <random>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/evaluation/scoring/warnings.h"

namespace tileflight::scoring::points_on_actors_test {
namespace {

namespace fs = std::filesystem;
using geometry::Vec3;
using metrics::PlacedBox;
using nlohmann::json;
using testing::HasSubstr;
using testing::IsEmpty;
using tests::refusal_of;

constexpr int kFrames = 8;
constexpr double kStep_s = 0.1;

/// A dataset with five actors on straight ways, which turn, and one that stands; and a map of its surroundings in
/// another frame, whose points were chosen in every second frame.
class Crossing : public testing::Test {
 protected:
  Crossing() {
    dataset::DatasetWriter writer(folder_ / "dataset", {.camera = imaging::make_pinhole(16, 12, 90.0)},
                                  {.replace = true, .png = true});
    for (int i = 0; i < kFrames; ++i) writer.add_frame(i, kStep_s * i, 0.0, imaging::RgbImage(16, 12));
    writer.finish();
    fs::create_directories(folder_ / "dataset/boxes");
    for (int i = 0; i < kFrames; ++i) write_boxes(i);
    map_ = {.map = folder_ / "odometry", .dataset = folder_ / "dataset"};
    geometry::Trajectory keyframes;
    for (int k = 0; 2 * k < kFrames; ++k) keyframes.poses.push_back({2 * k * kStep_s, geometry::SE3()});
    fs::create_directories(map_.map);
    geometry::write_tum(map_.map / "keyframes.txt", keyframes);
    T_local_map_ = {3.0, Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), Vec3(10, -20, 5)};
    std::mt19937 random(11);
    std::uniform_real_distribution<double> place(-9.0, 9.0), height(-0.5, 3.0);
    for (int i = 0; i < 4000; ++i) {
      local_.emplace_back(place(random), place(random), height(random));
      cloud_.positions.push_back(T_local_map_.inverse() * local_.back());
      cloud_.scalars["keyframe"].push_back(static_cast<float>(i % (kFrames / 2)));
    }
  }

  static std::vector<PlacedBox> boxes_at(int frame) {
    std::vector<PlacedBox> boxes;
    for (int actor = 0; actor < 6; ++actor) {
      const double s = actor == 0 ? 0.0 : frame;
      const Eigen::Quaterniond turned(Eigen::AngleAxisd(0.7 * actor + 0.1 * s, Vec3::UnitZ()));
      boxes.push_back({{turned, Vec3(3.0 * actor - 8 + 0.9 * s, 2.0 * actor - 6 - 0.4 * s, 0.8)},
                       Vec3(2.0 + 0.3 * actor, 1.5, 1.6)});
    }
    return boxes;
  }

  fs::path boxes_file(int frame) const {
    return folder_ / "dataset/boxes" / ("00000" + std::to_string(frame) + ".json");
  }
  void write_boxes(int frame) const {
    json list = json::array();
    for (const PlacedBox& box : boxes_at(frame)) {
      const Eigen::Quaterniond& q = box.T_local_box.rotation;
      const Vec3 &c = box.T_local_box.translation, &s = box.size_m;
      list.push_back({{"actor", "a" + std::to_string(list.size())},
                      {"category", "car"},
                      {"center", {c.x(), c.y(), c.z()}},
                      {"size", {s.x(), s.y(), s.z()}},
                      {"rotation", {q.x(), q.y(), q.z(), q.w()}}});
    }
    base::write_file(boxes_file(frame), json{{"frame", frame}, {"time_s", kStep_s * frame}, {"boxes", list}}.dump());
  }

  bool is_on_any(const Vec3& p, int frame) const {
    bool on = false;
    for (const PlacedBox& box : boxes_at(frame)) on = on || metrics::is_on(box, p);
    return on;
  }

  PointsOnActors find() const {
    const auto found = find_points_on_actors(map_, cloud_, T_local_map_);
    EXPECT_TRUE(found.has_value());
    return found.value_or(PointsOnActors{});
  }

  tests::TemporaryFolder folder_;
  MapInputs map_;
  geometry::Sim3 T_local_map_;
  std::vector<Vec3> local_;
  geometry::PointCloud cloud_;
};

TEST_F(Crossing, OfAMapWithKeyframesTheBoxesOfThosePicturesCount) {
  const PointsOnActors found = find();
  EXPECT_TRUE(found.by_keyframe);
  EXPECT_EQ(found.actors, 6U);
  EXPECT_GT(found.count(), 100U);
  for (std::size_t i = 0; i < local_.size(); ++i)
    EXPECT_EQ(found.is_on[i], is_on_any(local_[i], 2 * static_cast<int>(i % (kFrames / 2))));
}

TEST_F(Crossing, OfAnyOtherMapTheBoxesOfAllPicturesCount) {
  const std::size_t by_keyframe = find().count();
  cloud_.scalars.clear();
  const PointsOnActors found = find();
  EXPECT_FALSE(found.by_keyframe);
  EXPECT_EQ(found.actors, 6U);
  EXPECT_GT(found.count(), by_keyframe);
  for (std::size_t i = 0; i < local_.size(); ++i) {
    bool on = false;
    for (int frame = 0; frame < kFrames; ++frame) on = on || is_on_any(local_[i], frame);
    EXPECT_EQ(found.is_on[i], on);
  }
}

TEST_F(Crossing, WithoutBoxesNothingIsKnown) {
  fs::remove_all(folder_ / "dataset/boxes");
  EXPECT_FALSE(find_points_on_actors(map_, cloud_, T_local_map_));
  EXPECT_FALSE(find_points_on_actors({.map = map_.map}, cloud_, T_local_map_));
}

TEST_F(Crossing, BrokenFilesAreNamed) {
  const auto refusal = [&] { return refusal_of([&] { find_points_on_actors(map_, cloud_, T_local_map_); }); };
  cloud_.scalars["keyframe"][17] = 99.0f;
  EXPECT_THAT(refusal(), HasSubstr("keyframes.txt: the keyframe of point 17 is no image of"));
  cloud_.scalars["keyframe"][17] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(refusal(), HasSubstr("point 17"));
  cloud_.scalars["keyframe"][17] = 0.0f;
  for (const char* wrong :
       {R"({"boxes": [{"actor": "a", "center": [0, 0], "size": [1, 1, 1], "rotation": [0, 0, 0, 1]}]})",
        R"({"boxes": [{"actor": "a", "center": [0, 0, 0], "size": [1, -1, 1], "rotation": [0, 0, 0, 1]}]})",
        R"({"boxes": [{"actor": "a", "center": [0, 0, 0], "size": [1, 1, 1], "rotation": [0, 0, 0, 2]}]})",
        R"({"boxes": 3})", R"({})", "nonsense"}) {
    base::write_file(boxes_file(2), wrong);
    EXPECT_THAT(refusal(), HasSubstr("000002.json")) << wrong;
  }
  fs::remove(boxes_file(2));
  EXPECT_THAT(refusal(), HasSubstr("000002.json"));
}

TEST_F(Crossing, TheOthersRemainAndNoMapOfActorsAlone) {
  const PointsOnActors found = find();
  geometry::PointCloud rest = cloud_;
  const geometry::PointCloud apart = take_points_on_actors(found, map_, rest);
  EXPECT_EQ(apart.size(), found.count());
  EXPECT_EQ(rest.size() + apart.size(), cloud_.size());
  PointsOnActors all = found;
  all.is_on.assign(cloud_.size(), true);
  EXPECT_THAT(refusal_of([&] { take_points_on_actors(all, map_, rest = cloud_); }), HasSubstr("all of its points"));
}

TEST(PointsOnActors, AreAWarningWhereTheyAreMany) {
  metrics::MovingPoints moving;
  moving.with_them.points = 1000;
  moving.apart.points = 50;
  EXPECT_THAT(moving_warnings(moving, 0.05), IsEmpty());
  moving.apart.points = 51;
  const Warnings warnings = moving_warnings(moving, 0.05);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_THAT(warnings[0].message, HasSubstr("51 of the map's 1000 points are on moving objects"));
  EXPECT_FALSE(forbids_verdict(warnings[0]));
}

}  // namespace
}  // namespace tileflight::scoring::points_on_actors_test
