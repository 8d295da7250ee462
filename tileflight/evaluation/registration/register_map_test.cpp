#include "tileflight/evaluation/registration/register_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>

#include "tileflight/core/alignment/umeyama.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/registration/located_poses.h"
#include "tileflight/evaluation/registration/test_flights.h"

namespace tileflight::registration::register_map_test {
namespace {

using namespace test_flights;
using testing::HasSubstr;
using testing::ThrowsMessage;

std::vector<alignment::PositionFix> receiver(const geometry::Trajectory& local, const Vec3& bias) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  std::vector<alignment::PositionFix> fixes;
  for (const auto& pose : local.poses)
    fixes.push_back(
        {pose.time_s,
         pose.T_local_camera.translation + bias + 0.2 * Vec3(normal(random), normal(random), normal(random)), 0.6,
         0.9});
  return fixes;
}

RegistrationOptions options() {
  RegistrationOptions options;
  options.trajectory.estimate_time_offset = false;
  return options;
}

RegistrationServices rays_only() {
  RegistrationServices services;
  services.cast_ray = cast_ray;
  return services;
}

/// Images located at the true camera positions within a centimetre, if the guess is close.
LocatedPictures found_near(const Flight& flight, const Sim3& T, std::size_t pictures) {
  LocatedPictures result;
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal;
  for (std::size_t k = 0; k < pictures; ++k) {
    const std::size_t pose = k * flight.map.size() / pictures;
    ++result.tried;
    const SE3 truth = flight.local.poses[pose].T_local_camera;
    const SE3 guess = T * flight.map.poses[pose].T_local_camera;
    constexpr double kCapture_m = 2.0, kCapture_rad = 0.1;
    if ((guess.translation - truth.translation).norm() > kCapture_m) continue;
    if (guess.rotation.angularDistance(truth.rotation) > kCapture_rad) continue;
    SE3 found = truth;
    found.translation += 0.01 * Vec3(normal(random), normal(random), normal(random));
    LocatedPose located{flight.map.poses[pose].T_local_camera, found};
    located.information.diagonal() << 1e4, 1e4, 1e4, 1e6, 1e6, 1e6;
    result.found.push_back({pose, located, 0.9});
  }
  return result;
}

std::string all_warnings(const RegistrationResult& registration) {
  std::string text;
  for (const Warning& warning : registration.warnings) text += warning.message + "\n";
  return text;
}

TEST(RegisterMap, PositionsOfACurvedPathLeadToTheSurface) {
  const Flight flight = simulate_map(curved_path());
  const RegistrationResult r =
      register_map(flight.points, {.path = flight.map, .positions = receiver(flight.local, Vec3(0.6, -0.5, 0.9))},
                   the_place().surface, rays_only(), options());
  EXPECT_LT(rms_distance_m(flight.points, r.T_local_map, T_local_map()), 0.05);
  EXPECT_EQ(r.method, "surface");
  EXPECT_EQ(r.start, "positions");
  EXPECT_LT(r.sigma_m, 0.1);
  EXPECT_EQ(all_warnings(r), "");
}

/// From an issue: receiver positions of a straight path leave the rotation about it undetermined.
TEST(RegisterMap, AStraightPathIsTurnedTheRightWay) {
  for (const unsigned seed : {1U, 2U}) {
    const Flight flight = simulate_map(straight_path(), 50, 0.005, seed);
    const RegistrationResult r =
        register_map(flight.points, {.path = flight.map, .positions = receiver(flight.local, Vec3(-0.5, 0.3, 0.8))},
                     the_place().surface, rays_only(), options());
    EXPECT_LT(rms_distance_m(flight.points, r.T_local_map, T_local_map()), 0.1) << seed;
    EXPECT_GT(r.starts_tried, 1U);
  }
}

TEST(RegisterMap, GravityClosesWhatAStraightPathLeavesOpen) {
  const Flight flight = simulate_map(straight_path(), 50, 0.005, 1U);
  const RegistrationResult r =
      register_map(flight.points,
                   {.path = flight.map,
                    .positions = receiver(flight.local, Vec3(-0.5, 0.3, 0.8)),
                    .up = UpDirection{T_local_map().rotation.conjugate() * Vec3::UnitZ(), 0.01}},
                   the_place().surface, rays_only(), options());
  EXPECT_LT(rms_distance_m(flight.points, r.T_local_map, T_local_map()), 0.1);
  EXPECT_EQ(r.start, "positions and gravity");
  EXPECT_EQ(r.starts_tried, 1U);
}

TEST(RegisterMap, GravityInOtherAxesSpoilsNothingAndIsSaid) {
  // As from an inertial unit with wrong axes; the flight is straight, so no other evidence determines the rotation.
  const Flight flight = simulate_map(straight_path(), 50, 0.005, 1U);
  const RegistrationResult r =
      register_map(flight.points,
                   {.path = flight.map,
                    .positions = receiver(flight.local, Vec3(-0.5, 0.3, 0.8)),
                    .up = UpDirection{T_local_map().rotation.conjugate() * Vec3(0.6, -0.8, 0.0), 0.01}},
                   the_place().surface, rays_only(), options());
  EXPECT_LT(rms_distance_m(flight.points, r.T_local_map, T_local_map()), 0.1);
  EXPECT_EQ(r.start, "positions");
  EXPECT_THAT(all_warnings(r), HasSubstr("the map's up direction is 90 degrees away from the inertial unit's gravity"));
}

TEST(RegisterMap, PicturesAreBelievedMoreThanShapes) {
  const Flight flight = simulate_map(curved_path());
  RegistrationServices services = rays_only();
  services.locate_pictures = [&](const Sim3& T, std::size_t n, PictureDetail) { return found_near(flight, T, n); };
  const RegistrationResult r =
      register_map(flight.points, {.path = flight.map, .positions = receiver(flight.local, Vec3::Zero())},
                   the_place().surface, services, options());
  EXPECT_EQ(r.method, "pictures");
  ASSERT_TRUE(r.pictures);
  EXPECT_EQ(r.pictures->inliers, 20U);
  EXPECT_LT(rms_distance_m(flight.points, r.T_local_map, T_local_map()), 0.03);
  EXPECT_EQ(all_warnings(r), "");
}

TEST(RegisterMap, APathThatBreaksIsSaid) {
  Flight flight = simulate_map(curved_path());
  Flight broken = flight;
  for (std::size_t k = 14; k < broken.map.size(); ++k)  // odometry jumps by three metres
    broken.map.poses[k].T_local_camera.translation += T_local_map().inverse().rotation * Vec3(3.0, 0, 0) / 8.0;
  RegistrationServices services = rays_only();
  services.locate_pictures = [&](const Sim3& T, std::size_t n, PictureDetail) {
    LocatedPictures located;
    for (std::size_t k = 0; k < n; ++k) {
      const std::size_t pose = k * flight.map.size() / n;
      LocatedPose found{broken.map.poses[pose].T_local_camera, flight.local.poses[pose].T_local_camera};
      found.information.diagonal() << 1e4, 1e4, 1e4, 1e6, 1e6, 1e6;
      located.found.push_back({pose, found, 0.9});
      ++located.tried;
    }
    (void)T;
    return located;
  };
  const RegistrationResult r =
      register_map(broken.points, {.path = broken.map, .positions = receiver(flight.local, Vec3::Zero())},
                   the_place().surface, services, options());
  EXPECT_THAT(all_warnings(r), HasSubstr("the path is distorted"));
}

/// Located images of the curved path, one at each pose, and `scale` times as large as that; the map's path lies aside
/// by `bend_m` times the square of the share of the path.
LocatedPictures located_on_bent_path(const Flight& flight, double bend_m, double scale) {
  LocatedPictures located{.tried = flight.map.size()};
  for (std::size_t k = 0; k < flight.map.size(); ++k) {
    const double share = static_cast<double>(k) / static_cast<double>(flight.map.size() - 1);
    LocatedPose pose{flight.map.poses[k].T_local_camera, flight.local.poses[k].T_local_camera};
    pose.T_map_camera.translation +=
        T_local_map().inverse().rotation * Vec3(0.0, 0.0, bend_m * share * share) / T_local_map().scale;
    pose.T_local_camera.translation *= scale;
    pose.information.diagonal() << 1e4, 1e4, 1e4, 1e6, 1e6, 1e6;
    located.found.push_back({k, pose, 0.9});
  }
  return located;
}

/// RMS error of that path after the best similarity, as a share of its length.
double path_error_share(const LocatedPictures& located) {
  std::vector<Vec3> in_map, found;
  double length_m = 0.0, squares = 0.0;
  for (const LocatedPicture& picture : located.found) {
    in_map.push_back(picture.found.T_map_camera.translation);
    found.push_back(picture.found.T_local_camera.translation);
    if (found.size() > 1) length_m += (found.back() - found[found.size() - 2]).norm();
  }
  const Sim3 T = alignment::umeyama(in_map, found).T_target_source;
  for (std::size_t k = 0; k < found.size(); ++k) squares += (T * in_map[k] - found[k]).squaredNorm();
  return std::sqrt(squares / static_cast<double>(found.size())) / length_m;
}

/// The severity of the warning about a path that bends by a share of its length; nullopt: none.
std::optional<Severity> warning_about_bent_path(double share, double scale = 1.0) {
  const Flight flight = simulate_map(curved_path(), 20);
  const double bend_m = share / path_error_share(located_on_bent_path(flight, 1.0, scale));
  const LocatedPictures located = located_on_bent_path(flight, bend_m, scale);
  RegistrationServices services;
  services.locate_pictures = [&](const Sim3&, std::size_t, PictureDetail) { return located; };
  Sim3 start = T_local_map();
  start.scale *= scale;
  start.translation *= scale;
  const RegistrationResult r =
      register_map(flight.points, {.path = flight.map, .starts = {start}}, the_place().surface, services, options());
  for (const Warning& warning : r.warnings)
    if (warning.message.find("the path is distorted") != std::string::npos) return warning.severity;
  return std::nullopt;
}

TEST(RegisterMap, APathIsWrongFromOnePercentOfItsLengthOn) {
  for (const double scale : {1.0, 0.05}) {  // of 100 m and of 5 m
    EXPECT_EQ(warning_about_bent_path(0.0045, scale), std::nullopt) << scale;
    EXPECT_EQ(warning_about_bent_path(0.0075, scale), Severity::kNote) << scale;
    EXPECT_EQ(warning_about_bent_path(0.0105, scale), Severity::kWarning) << scale;
    EXPECT_EQ(warning_about_bent_path(0.02, scale), Severity::kError) << scale;
  }
}

TEST(RegisterMap, APathThatBendsALittleIsCarriedWhole) {
  // The last are off by 0.1 m and more: too little for a warning about the path, but a transform that ignores them
  // would not be the best one of all poses, and state too small a sigma.
  const Flight flight = simulate_map(curved_path());
  Flight bent = flight;
  for (std::size_t k = 17; k < bent.map.size(); ++k) {
    const double off_m = 0.1 + 0.03 * static_cast<double>(k - 17);
    bent.map.poses[k].T_local_camera.translation +=
        T_local_map().inverse().rotation * Vec3(0.0, off_m, 0.0) / T_local_map().scale;
  }
  RegistrationServices services = rays_only();
  services.locate_pictures = [&](const Sim3& T, std::size_t n, PictureDetail) { return found_near(bent, T, n); };
  const RegistrationResult r =
      register_map(flight.points, {.path = bent.map, .positions = receiver(flight.local, Vec3::Zero())},
                   the_place().surface, services, options());
  ASSERT_TRUE(r.pictures);
  EXPECT_LT(r.pictures->inliers, r.pictures->located);
  EXPECT_EQ(r.method, "pictures");
  EXPECT_LT(r.pictures->worst_m, 0.2);  // spread over the whole path
  std::vector<LocatedPose> all;
  for (std::size_t k = 0; k < bent.map.size(); ++k)
    all.push_back({bent.map.poses[k].T_local_camera, bent.local.poses[k].T_local_camera});
  const double error_m = rms_distance_m(flight.points, r.T_local_map, similarity_of(all));
  EXPECT_LT(error_m, 0.25 * rms_distance_m(flight.points, T_local_map(), similarity_of(all)));
  EXPECT_GT(r.sigma_m, 0.5 * error_m);
}

TEST(RegisterMap, NeighboursThatAreFoundFarOffDoNotCount) {
  // Two of twenty, side by side, located 2.5 m away (a similar roof): on a path of about 100 m that is more than a
  // bend.
  const Flight flight = simulate_map(curved_path());
  RegistrationServices services = rays_only();
  services.locate_pictures = [&](const Sim3& T, std::size_t n, PictureDetail detail) {
    LocatedPictures located = found_near(flight, T, n);
    for (std::size_t k = 12; detail == PictureDetail::kFine && k < 14 && k < located.found.size(); ++k)
      located.found[k].found.T_local_camera.translation.x() += 2.5;
    return located;
  };
  const RegistrationResult r =
      register_map(flight.points, {.path = flight.map, .positions = receiver(flight.local, Vec3::Zero())},
                   the_place().surface, services, options());
  EXPECT_EQ(r.method, "pictures");
  EXPECT_EQ(r.pictures->inliers, 18U);
  EXPECT_LT(rms_distance_m(flight.points, r.T_local_map, T_local_map()), 0.03);
  EXPECT_THAT(all_warnings(r), HasSubstr("path"));
}

TEST(RegisterMap, WhereNothingFitsItIsSaid) {
  const Flight flight = simulate_map(curved_path());
  std::vector<alignment::PositionFix> elsewhere = receiver(flight.local, Vec3(40.0, 35.0, 0.0));
  const RegistrationResult r = register_map(flight.points, {.path = flight.map, .positions = elsewhere},
                                            the_place().surface, rays_only(), options());
  EXPECT_FALSE(r.warnings.empty());
}

/// A map scaled down to a decimetre lies on the ground wherever it is put, and so do its cameras' rays.
TEST(RegisterMap, AMapThatShrankToASpotIsNotBelievedAgainstTelemetry) {
  const Flight flight = simulate_map(curved_path(), 150, 0.15);  // odometry that went wrong: nothing fits well
  RegistrationServices services = rays_only();
  services.locate_pictures = [](const Sim3&, std::size_t n, PictureDetail) { return LocatedPictures{n, {}}; };
  services.find_places_by_shape = [&] {
    std::vector<Sim3> spots;
    for (const double x : {-50.0, -10.0, 30.0}) {
      Sim3 spot = T_local_map();
      spot.scale *= 1e-3;
      spot.translation.setZero();
      const Vec3 middle = spot * flight.points.positions[flight.points.size() / 2];
      spot.translation = Vec3(x, 45.0, surface_m(x, 45.0)) - middle;
      spots.push_back(spot);
    }
    return spots;
  };
  const RegistrationResult r =
      register_map(flight.points, {.path = flight.map, .positions = receiver(flight.local, Vec3::Zero())},
                   the_place().surface, services, options());
  EXPECT_NEAR(r.T_local_map.scale, T_local_map().scale, 0.2 * T_local_map().scale);
  EXPECT_EQ(r.start, "positions");
}

TEST(RegisterMap, HeightsOfAnotherDatumAreSaid) {
  const Flight flight = simulate_map(curved_path());
  RegistrationServices services = rays_only();
  services.find_places_by_shape = [] { return std::vector<Sim3>{T_local_map()}; };
  const RegistrationResult r =
      register_map(flight.points, {.path = flight.map, .positions = receiver(flight.local, Vec3(0.0, 0.0, 30.0))},
                   the_place().surface, services, options());
  EXPECT_LT(rms_distance_m(flight.points, r.T_local_map, T_local_map()), 0.05);
  EXPECT_THAT(all_warnings(r), HasSubstr("vertical datum"));
}

/// Two identical places: the same buildings again, thirty metres east.
TEST(RegisterMap, TwoPlacesThatFitAreAmbiguous) {
  const auto twice = [](double x, double y) {
    const double east = x > 0.0 ? x - 30.0 : x + 30.0;
    double z = 2.0 * std::sin(0.3 * y);
    if (std::abs(east) < 5.0 && std::abs(y) < 4.0) z += 8.0;
    if (std::abs(east - 9.0) < 3.0 && std::abs(y - 9.0) < 2.0) z += 4.0;
    return z;
  };
  const geometry::TriangleMesh mesh = tests::height_field(120, -60.0, 120.0, twice);
  const geometry::TriangleIndex index(mesh);
  ObservedPoints points;
  std::mt19937_64 random(6);
  std::uniform_real_distribution<double> unit(-15.0, 15.0);
  for (int k = 0; k < 3000; ++k) {
    const Vec3 p(-30.0 + unit(random), unit(random), 0.0);
    points.positions.push_back(T_local_map().inverse() * Vec3(p.x(), p.y(), twice(p.x(), p.y())));
  }
  RegistrationServices services;
  Sim3 other = T_local_map();
  other.translation.x() += 60.0;
  services.find_places_by_shape = [&] { return std::vector<Sim3>{T_local_map(), other}; };
  const RegistrationResult r = register_map(points, {}, {index, mesh, {}}, services, options());
  EXPECT_THAT(all_warnings(r), HasSubstr("ambiguous"));
}

/// A flight over level ground, which does not constrain horizontal motion.
Flight over_level_ground() {
  Flight flight = simulate_map(curved_path());
  std::mt19937_64 random(8);
  std::uniform_real_distribution<double> unit(-8.0, 8.0);
  for (std::size_t k = 0; k < flight.points.size(); ++k) {
    const Vec3 eye = T_local_map() * flight.points.viewpoints[k];
    flight.points.positions[k] = T_local_map().inverse() * Vec3(eye.x() + unit(random), eye.y() + unit(random), 0.0);
  }
  return flight;
}

/// Registers over level ground with paving of that period; `coarse_m`: error of coarse localization, on the side of the
/// guess.
std::string warnings_over_paving(double period_m, double coarse_m) {
  const geometry::TriangleMesh mesh = tests::height_field(40, -60.0, 120.0, [](double, double) { return 0.0; });
  const geometry::TriangleIndex index(mesh);
  const Flight flight = over_level_ground();
  RegistrationServices services;
  services.locate_pictures = [&](const Sim3& T, std::size_t pictures, PictureDetail detail) {
    LocatedPictures located = found_near(flight, T, pictures);
    for (LocatedPicture& picture : located.found) {
      SE3& found = picture.found.T_local_camera;
      const Vec3 off = (T * picture.found.T_map_camera.translation - found.translation).cwiseProduct(Vec3(1, 1, 0));
      found.translation += period_m * (off / period_m).array().round().matrix();
      if (detail == PictureDetail::kCoarse && off.norm() > 0.1) found.translation += coarse_m * off.normalized();
    }
    return located;
  };
  return all_warnings(register_map(flight.points,
                                   {.path = flight.map, .positions = receiver(flight.local, Vec3::Zero())},
                                   {index, mesh, {}}, services, options()));
}

TEST(RegisterMap, PavingThatRepeatsIsSaid) {
  EXPECT_THAT(warnings_over_paving(1.2, 0.0), HasSubstr("textures repeat"));
}

TEST(RegisterMap, SmallPicturesThatEndALittleAsideAreNoRepetition) {
  EXPECT_EQ(warnings_over_paving(1000.0, 0.08), "");
}

/// Places are searched by appearance first, and by shape only if that is not convincing.
TEST(RegisterMap, PlacesThatLookRightComeFirst) {
  const Flight flight = simulate_map(curved_path());
  RegistrationServices services = rays_only();
  services.locate_pictures = [&](const Sim3& T, std::size_t n, PictureDetail) { return found_near(flight, T, n); };
  Sim3 elsewhere = T_local_map();
  elsewhere.translation.z() += 500.0;
  int asked = 0;
  services.find_places_by_shape = [&] {
    ++asked;
    return std::vector<Sim3>{T_local_map()};
  };
  services.find_places_by_appearance = [&] { return std::vector<Sim3>{elsewhere, T_local_map()}; };
  const RegistrationResult r =
      register_map(flight.points, {.path = flight.map}, the_place().surface, services, options());
  EXPECT_EQ(asked, 0);
  EXPECT_EQ(r.start, "places");
  EXPECT_LT(rms_distance_m(flight.points, r.T_local_map, T_local_map()), 0.03);

  services.find_places_by_appearance = [&] { return std::vector<Sim3>{elsewhere}; };
  const RegistrationResult by_shape =
      register_map(flight.points, {.path = flight.map}, the_place().surface, services, options());
  EXPECT_EQ(asked, 1);
  EXPECT_LT(rms_distance_m(flight.points, by_shape.T_local_map, T_local_map()), 0.03);
}

TEST(RegisterMap, NothingToBeginWithIsAnError) {
  const Flight flight = simulate_map(curved_path(), 10);
  EXPECT_THAT([&] { register_map(flight.points, {}, the_place().surface, {}, options()); },
              ThrowsMessage<InputError>(HasSubstr("the map's position is unknown")));
  EXPECT_THAT([&] { register_map({}, {}, the_place().surface, {}, options()); },
              ThrowsMessage<InputError>(HasSubstr("map: has no points")));
}

}  // namespace
}  // namespace tileflight::registration::register_map_test
