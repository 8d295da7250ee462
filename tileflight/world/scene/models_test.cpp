#include "tileflight/world/scene/models.h"

#include <gmock/gmock.h>

#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <tuple>

namespace tileflight::scene::models_test {
namespace {

using geometry::Box3;
using geometry::Vec3;

Box3 bounds(const imaging::TexturedMesh& mesh) {
  Box3 box;
  for (const Vec3& vertex : mesh.mesh.vertices) box.extend(vertex);
  return box;
}

/// Volume enclosed by outward-facing triangles (divergence theorem).
double volume(const imaging::TexturedMesh& mesh) {
  double sum = 0.0;
  for (const geometry::Triangle& t : mesh.mesh.triangles) {
    const Vec3 &a = mesh.mesh.vertices[t[0]], &b = mesh.mesh.vertices[t[1]], &c = mesh.mesh.vertices[t[2]];
    sum += a.dot(b.cross(c)) / 6.0;
  }
  return sum;
}

TEST(Models, ShapesMeasureAMetreAndEncloseTheirVolume) {
  for (const Model model : {Model::kBox, Model::kSphere, Model::kCylinder, Model::kCone}) {
    const Box3 box = bounds(make_model(model));
    EXPECT_LT((box.sizes() - Vec3::Ones()).norm(), 0.01);
    EXPECT_LT(box.center().norm(), 0.005);
  }
  EXPECT_NEAR(volume(make_model(Model::kBox)), 1.0, 1e-12);
  EXPECT_NEAR(volume(make_model(Model::kSphere)), std::numbers::pi / 6, 0.01) << "so its faces look outwards";
  EXPECT_NEAR(volume(make_model(Model::kCylinder)), std::numbers::pi / 4, 0.01);
  EXPECT_NEAR(volume(make_model(Model::kCone)), std::numbers::pi / 12, 0.005);
}

TEST(Models, CarsAndPeopleStandOnTheGroundAndHaveTheirSizes) {
  const auto expect_size = [](Model model, const Vec3& size, double least_volume) {
    const imaging::TexturedMesh mesh = make_model(model);
    const Box3 box = bounds(mesh);
    EXPECT_NEAR(box.min().z(), 0.0, 1e-9) << mesh.name;
    EXPECT_LT((box.sizes() - size).cwiseAbs().maxCoeff(), 0.12) << mesh.name << ": " << box.sizes().transpose();
    EXPECT_NEAR(box.center().y(), 0.0, 0.02) << mesh.name;
    EXPECT_GT(volume(mesh), least_volume) << mesh.name;
    EXPECT_LT(volume(mesh), box.volume()) << mesh.name;
    EXPECT_EQ(mesh.colors.size(), mesh.mesh.vertices.size());
    EXPECT_LT(mesh.mesh.triangles.size(), 2500U) << mesh.name;
  };
  expect_size(Model::kCar, {4.45, 2.0, 1.45}, 4.5);
  expect_size(Model::kVan, {5.4, 2.0, 2.35}, 15.0);
  expect_size(Model::kPerson, {0.65, 0.56, 1.77}, 0.05);
}

TEST(Models, SolidsAreClosed) {
  // Each edge has a neighbour that runs the other way, positions compared; panes and lamps lie on the cars as sheets.
  for (const Model model : {Model::kBox, Model::kSphere, Model::kCylinder, Model::kCone, Model::kPerson}) {
    const imaging::TexturedMesh mesh = make_model(model);
    using Point = std::tuple<long, long, long>;
    const auto key = [&](std::uint32_t vertex) {
      const Vec3 p = 1e7 * mesh.mesh.vertices[vertex];
      return Point(std::lround(p.x()), std::lround(p.y()), std::lround(p.z()));
    };
    std::map<std::pair<Point, Point>, int> open;
    for (const geometry::Triangle& t : mesh.mesh.triangles) {
      for (std::size_t i = 0; i < 3; ++i) {
        const Point a = key(t[i]), b = key(t[(i + 1) % 3]);
        if (a == b) continue;
        ++open[{a, b}];
        --open[{b, a}];
      }
    }
    for (const auto& [edge, count] : open) ASSERT_EQ(count, 0) << mesh.name;
  }
}

TEST(Models, NumbersChooseColoursAndNothingElse) {
  std::set<std::array<std::uint8_t, 4>> paints;
  const imaging::TexturedMesh first = make_model(Model::kCar, 0);
  for (std::uint64_t number = 0; number < 40; ++number) {
    const imaging::TexturedMesh car = make_model(Model::kCar, number);
    EXPECT_EQ(car.mesh.vertices.size(), first.mesh.vertices.size());
    EXPECT_EQ(car.colors, make_model(Model::kCar, number).colors);
    paints.insert(car.colors.front());
  }
  EXPECT_GT(paints.size(), 6U);
  const imaging::TexturedMesh red = make_model(Model::kBox, 0, imaging::Rgb8{255, 0, 0});
  for (const auto& colour : red.colors) {
    EXPECT_GT(colour[0], 100);
    EXPECT_EQ(colour[1], 0);
  }
}

TEST(Models, HaveNames) {
  for (const std::string& name : model_names()) {
    const auto model = model_named(name);
    ASSERT_TRUE(model.has_value()) << name;
    EXPECT_EQ(make_model(*model).name, name);
  }
  EXPECT_FALSE(model_named("Box").has_value());
}

}  // namespace
}  // namespace tileflight::scene::models_test
