#include "tileflight/world/scene/models.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>
#include <vector>

#include "tileflight/core/base/random_numbers.h"
#include "tileflight/core/base/srgb.h"
#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::scene {

namespace {

/// A ring of points in a plane x = constant, for lofted shapes; counter-clockwise seen from +x.
using Ring = std::vector<geometry::Vec3>;

/// Builds a mesh of flat, coloured faces whose fronts (counter-clockwise) face outwards. Colours are sRGB; they are
/// stored linear, as TexturedMesh wants them, and shaded a little by the face's slope, as if under an even sky: tiles'
/// textures hold their light, so that faces of one colour would look cut out of paper beside them.
class ModelBuilder {
 public:
  void triangle(const geometry::Vec3& a, const geometry::Vec3& b, const geometry::Vec3& c, const imaging::Rgb8& colour);
  void quad(const geometry::Vec3& a, const geometry::Vec3& b, const geometry::Vec3& c, const geometry::Vec3& d,
            const imaging::Rgb8& colour);
  /// Sides between two rings of as many points, in the same order; `from` is the one with the smaller coordinate along
  /// the rings' axis.
  void loft(const Ring& from, const Ring& to, const imaging::Rgb8& colour);
  /// A convex ring as a face, seen as its points turn.
  void face(const Ring& ring, const imaging::Rgb8& colour);
  /// Frustum between two level rectangles: centres, and half sizes along x and y.
  void frustum(const geometry::Vec3& bottom, const geometry::Vec2& bottom_half, const geometry::Vec3& top,
               const geometry::Vec2& top_half, const imaging::Rgb8& colour);
  /// Frustum of a cone with its axis from `from` to `to`; radius 0 makes a tip. With end faces.
  void cone(const geometry::Vec3& from, double from_radius, const geometry::Vec3& to, double to_radius, int sides,
            const imaging::Rgb8& colour);
  void ellipsoid(const geometry::Vec3& center, const geometry::Vec3& radii, int segments, const imaging::Rgb8& colour);

  /// The mesh so far, which is taken.
  imaging::TexturedMesh take();

 private:
  imaging::TexturedMesh mesh_;
};

using geometry::Vec2;
using geometry::Vec3;
using imaging::Rgb8;

/// Light of an even sky and a ground of half its brightness on a face: half of the sphere that it sees is sky for a
/// wall, all for a roof.
double even_light(const Vec3& normal) { return 0.75 + 0.25 * normal.z(); }

std::array<std::uint8_t, 4> stored(const Rgb8& colour, double light) {
  std::array<std::uint8_t, 4> linear{0, 0, 0, 255};
  for (std::size_t c = 0; c < 3; ++c) {
    const double value = light * base::linear_from_srgb(colour[c] / 255.0);
    linear[c] = static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(value, 0.0, 1.0)));
  }
  return linear;
}

Ring circle(const Vec3& center, const Vec3& x, const Vec3& y, double radius, int sides) {
  Ring ring;
  for (int i = 0; i < sides; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / sides;
    ring.push_back(center + radius * (std::cos(angle) * x + std::sin(angle) * y));
  }
  return ring;
}

Ring rectangle(const Vec3& center, const Vec2& half) {
  return {center + Vec3(-half.x(), -half.y(), 0), center + Vec3(half.x(), -half.y(), 0),
          center + Vec3(half.x(), half.y(), 0), center + Vec3(-half.x(), half.y(), 0)};
}

Ring reversed(Ring ring) {
  std::ranges::reverse(ring);
  return ring;
}

void ModelBuilder::triangle(const Vec3& a, const Vec3& b, const Vec3& c, const Rgb8& colour) {
  const Vec3 normal = (b - a).cross(c - a);
  if (normal.norm() < 1e-12) return;  // the tip of a cone
  const auto first = static_cast<std::uint32_t>(mesh_.mesh.vertices.size());
  const auto linear = stored(colour, even_light(normal.normalized()));
  for (const Vec3& corner : {a, b, c}) {
    mesh_.mesh.vertices.push_back(corner);
    mesh_.colors.push_back(linear);
  }
  mesh_.mesh.triangles.push_back({first, first + 1, first + 2});
}

void ModelBuilder::quad(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d, const Rgb8& colour) {
  triangle(a, b, c, colour);
  triangle(a, c, d, colour);
}

void ModelBuilder::loft(const Ring& from, const Ring& to, const Rgb8& colour) {
  for (std::size_t i = 0; i < from.size(); ++i) {
    const std::size_t next = (i + 1) % from.size();
    quad(from[i], from[next], to[next], to[i], colour);
  }
}

void ModelBuilder::face(const Ring& ring, const Rgb8& colour) {
  for (std::size_t i = 1; i + 1 < ring.size(); ++i) triangle(ring[0], ring[i], ring[i + 1], colour);
}

void ModelBuilder::frustum(const Vec3& bottom, const Vec2& bottom_half, const Vec3& top, const Vec2& top_half,
                           const Rgb8& colour) {
  const Ring low = rectangle(bottom, bottom_half), high = rectangle(top, top_half);
  loft(low, high, colour);
  face(high, colour);
  face(reversed(low), colour);
}

void ModelBuilder::cone(const Vec3& from, double from_radius, const Vec3& to, double to_radius, int sides,
                        const Rgb8& colour) {
  const Vec3 axis = (to - from).normalized(), x = axis.unitOrthogonal(), y = axis.cross(x);
  const Ring start = circle(from, x, y, from_radius, sides), end = circle(to, x, y, to_radius, sides);
  loft(start, end, colour);
  face(end, colour);
  face(reversed(start), colour);
}

void ModelBuilder::ellipsoid(const Vec3& center, const Vec3& radii, int segments, const Rgb8& colour) {
  const auto ring_at = [&](int k) {
    const double polar = std::numbers::pi * (1.0 - static_cast<double>(k) / segments);
    Ring ring = circle(Vec3(0, 0, std::cos(polar)), Vec3::UnitX(), Vec3::UnitY(), std::sin(polar), 2 * segments);
    for (Vec3& point : ring) point = center + radii.cwiseProduct(point);
    return ring;
  };
  for (int k = 0; k < segments; ++k) loft(ring_at(k), ring_at(k + 1), colour);
}

imaging::TexturedMesh ModelBuilder::take() { return std::exchange(mesh_, {}); }

using geometry::Vec2;
using geometry::Vec3;
using imaging::Rgb8;

constexpr Rgb8 kGlass{38, 46, 54}, kTyre{28, 28, 30}, kRim{150, 152, 155}, kTrim{45, 46, 48}, kLamp{240, 240, 228},
    kTailLamp{170, 20, 22};
constexpr Rgb8 kShape{200, 200, 196};

template <std::size_t N>
const Rgb8& chosen(const std::array<Rgb8, N>& colours, std::uint64_t number, std::uint64_t what) {
  return colours[base::splitmix64_hash(3 * number + what) % N];
}

/// Paints of cars, by how often they are seen.
Rgb8 paint(std::uint64_t number) {
  static constexpr std::array<Rgb8, 12> kPaints{{{235, 235, 232},
                                                 {235, 235, 232},
                                                 {226, 227, 229},
                                                 {30, 31, 34},
                                                 {34, 36, 40},
                                                 {120, 124, 129},
                                                 {142, 146, 150},
                                                 {176, 180, 184},
                                                 {28, 52, 104},
                                                 {44, 92, 150},
                                                 {150, 24, 26},
                                                 {88, 92, 70}}};
  return chosen(kPaints, number, 0);
}

/// A level outline, front to back, at a height.
struct Profile {
  double x, z, half_width;
};

/// Left and right edges of a body whose outline in the vertical plane is `profile`, clockwise seen from the left (+y).
void add_body(ModelBuilder& model, const std::vector<Profile>& profile, const Rgb8& colour) {
  Ring left, right;
  for (const Profile& at : profile) {
    left.emplace_back(at.x, at.half_width, at.z);
    right.emplace_back(at.x, -at.half_width, at.z);
  }
  for (std::size_t i = 0; i < profile.size(); ++i) {
    const std::size_t next = (i + 1) % profile.size();
    model.quad(left[i], left[next], right[next], right[i], colour);
  }
  // The outline is not convex, but sees its middle from everywhere.
  for (const bool is_left : {true, false}) {
    const Ring& side = is_left ? left : right;
    Vec3 middle = Vec3::Zero();
    for (const Vec3& point : side) middle += point / static_cast<double>(side.size());
    middle.y() = side.front().y();
    for (std::size_t i = 0; i < side.size(); ++i) {
      const Vec3 &a = side[i], &b = side[(i + 1) % side.size()];
      is_left ? model.triangle(middle, b, a, colour) : model.triangle(middle, a, b, colour);
    }
  }
}

void add_wheel(ModelBuilder& model, double x, double side, double track_half, double radius) {
  const double y = side * track_half, half = 0.11;
  model.cone({x, y - half, radius}, radius, {x, y + half, radius}, radius, 20, kTyre);
  const double face = y + side * (half + 0.004);
  const Vec3 in(x, y, radius), out(x, face, radius);
  model.cone(side > 0 ? in : out, 0.62 * radius, side > 0 ? out : in, 0.62 * radius, 12, kRim);
}

/// A cabin: two rectangles, front to back and across.
struct Cabin {
  double bottom_front, bottom_back, bottom_half, bottom_z;
  double top_front, top_back, top_half, top_z;
};

/// A pane within the quadrilateral a b c d (counter-clockwise seen from outside), a little outside of it.
void add_pane(ModelBuilder& model, const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d, double from, double to) {
  constexpr double kLow = 0.10, kHigh = 0.88, kOff_m = 0.008;
  const Vec3 off = kOff_m * (b - a).cross(d - a).normalized();
  const auto at = [&](double u, double v) -> Vec3 {
    return (1 - u) * ((1 - v) * a + v * d) + u * ((1 - v) * b + v * c) + off;
  };
  model.quad(at(from, kLow), at(to, kLow), at(to, kHigh), at(from, kHigh), kGlass);
}

void add_cabin(ModelBuilder& model, const Cabin& c, const Rgb8& colour, int side_panes) {
  const Vec3 fl(c.bottom_front, c.bottom_half, c.bottom_z), fr(c.bottom_front, -c.bottom_half, c.bottom_z);
  const Vec3 bl(c.bottom_back, c.bottom_half, c.bottom_z), br(c.bottom_back, -c.bottom_half, c.bottom_z);
  const Vec3 tfl(c.top_front, c.top_half, c.top_z), tfr(c.top_front, -c.top_half, c.top_z);
  const Vec3 tbl(c.top_back, c.top_half, c.top_z), tbr(c.top_back, -c.top_half, c.top_z);
  model.loft({br, fr, fl, bl}, {tbr, tfr, tfl, tbl}, colour);
  model.face({tbr, tfr, tfl, tbl}, colour);
  add_pane(model, fr, fl, tfl, tfr, 0.06, 0.94);
  add_pane(model, bl, br, tbr, tbl, 0.08, 0.92);
  for (int i = 0; i < side_panes; ++i) {
    const double from = (i + 0.06) / side_panes, to = (i + 0.94) / side_panes;
    add_pane(model, fl, bl, tbl, tfl, from, to);
    add_pane(model, br, fr, tfr, tbr, 1.0 - to, 1.0 - from);
  }
}

void add_lamps(ModelBuilder& model, double x, double half_width, double z) {
  const double direction = x > 0 ? 1.0 : -1.0, at = x + 0.012 * direction;
  for (const double side : {-1.0, 1.0}) {
    const double y0 = side * (half_width - 0.42), y1 = side * (half_width - 0.06);
    const double low = direction > 0 ? std::min(y0, y1) : std::max(y0, y1);
    const double high = direction > 0 ? std::max(y0, y1) : std::min(y0, y1);
    model.quad({at, low, z - 0.07}, {at, high, z - 0.07}, {at, high, z + 0.07}, {at, low, z + 0.07},
               direction > 0 ? kLamp : kTailLamp);
  }
}

/// A saloon of 4.4 by 1.8 by 1.45 m.
void add_car(ModelBuilder& model, const Rgb8& colour) {
  add_body(model,
           {{2.20, 0.34, 0.80},
            {2.20, 0.60, 0.84},
            {2.05, 0.76, 0.85},
            {1.00, 0.93, 0.86},
            {-1.55, 0.98, 0.86},
            {-2.05, 0.93, 0.84},
            {-2.20, 0.66, 0.83},
            {-2.20, 0.34, 0.80},
            {-1.95, 0.20, 0.78},
            {1.95, 0.20, 0.78}},
           colour);
  model.frustum({2.14, 0, 0.24}, {0.07, 0.78}, {2.14, 0, 0.36}, {0.085, 0.80}, kTrim);
  model.frustum({-2.14, 0, 0.24}, {0.07, 0.78}, {-2.14, 0, 0.36}, {0.085, 0.80}, kTrim);
  add_cabin(model, {1.05, -1.80, 0.82, 0.92, 0.20, -1.15, 0.60, 1.45}, colour, 2);
  add_lamps(model, 2.20, 0.84, 0.60);
  add_lamps(model, -2.20, 0.83, 0.68);
  for (const double x : {-1.32, 1.36}) {
    for (const double side : {-1.0, 1.0}) add_wheel(model, x, side, 0.79, 0.32);
  }
  for (const double side : {-1.0, 1.0})
    model.frustum({0.85, side * 0.93, 0.95}, {0.07, 0.08}, {0.85, side * 0.93, 1.06}, {0.06, 0.07}, colour);
}

/// A delivery van of 5.4 by 2.0 by 2.35 m.
void add_van(ModelBuilder& model, const Rgb8& colour) {
  add_body(model,
           {{2.70, 0.36, 0.92},
            {2.70, 0.85, 0.95},
            {2.45, 1.12, 0.97},
            {-2.65, 1.15, 0.98},
            {-2.70, 0.36, 0.98},
            {-2.50, 0.26, 0.92},
            {2.50, 0.26, 0.92}},
           colour);
  model.frustum({-0.62, 0, 1.14}, {2.03, 0.98}, {-0.66, 0, 2.35}, {1.97, 0.90}, colour);
  add_cabin(model, {2.35, 1.30, 0.95, 1.12, 1.45, 1.25, 0.88, 2.20}, colour, 1);
  add_lamps(model, 2.70, 0.95, 0.80);
  add_lamps(model, -2.70, 0.98, 0.95);
  for (const double x : {-1.65, 1.75}) {
    for (const double side : {-1.0, 1.0}) add_wheel(model, x, side, 0.88, 0.35);
  }
}

/// Builds a person of 1.75 m in the middle of a step.
void add_person(ModelBuilder& model, std::uint64_t number, const std::optional<Rgb8>& clothes) {
  static constexpr std::array<Rgb8, 8> kShirts{{{200, 40, 40},
                                                {40, 80, 160},
                                                {240, 240, 236},
                                                {40, 42, 46},
                                                {230, 190, 60},
                                                {70, 120, 70},
                                                {120, 124, 130},
                                                {230, 120, 40}}};
  static constexpr std::array<Rgb8, 4> kTrousers{{{42, 52, 78}, {36, 36, 38}, {96, 84, 66}, {70, 72, 76}}};
  static constexpr std::array<Rgb8, 4> kSkins{{{224, 184, 152}, {198, 144, 108}, {140, 92, 64}, {92, 60, 44}}};
  static constexpr std::array<Rgb8, 4> kHairs{{{40, 30, 24}, {24, 22, 22}, {110, 84, 52}, {150, 146, 140}}};
  const Rgb8 shirt = clothes.value_or(chosen(kShirts, number, 0));
  const Rgb8 trousers = chosen(kTrousers, number, 1), skin = chosen(kSkins, number, 2);
  const Rgb8 hair = kHairs[base::splitmix64_hash(number + 77) % kHairs.size()];
  for (const double side : {-1.0, 1.0}) {
    const double y = 0.10 * side, ahead = 0.20 * side;  // the left foot is in front
    const Vec3 hip(0, y, 0.88), knee(0.55 * ahead + 0.05, y, 0.47), ankle(ahead, y, 0.09);
    model.cone(knee, 0.062, hip, 0.088, 8, trousers);
    model.cone(ankle, 0.045, knee, 0.062, 8, trousers);
    model.frustum({ahead + 0.06, y, 0.0}, {0.13, 0.048}, {ahead + 0.04, y, 0.09}, {0.09, 0.040}, kTyre);
    const Vec3 shoulder(0, 0.215 * side, 1.40), elbow(-0.45 * ahead, 0.25 * side, 1.12);
    const Vec3 hand(0.05 - 0.9 * ahead, 0.24 * side, 0.88);
    model.cone(elbow, 0.042, shoulder, 0.058, 8, shirt);
    model.cone(hand, 0.032, elbow, 0.042, 8, skin);
    model.ellipsoid(hand, {0.045, 0.03, 0.055}, 5, skin);
  }
  model.ellipsoid({0, 0, 0.92}, {0.125, 0.165, 0.13}, 7, trousers);
  model.frustum({0, 0, 0.95}, {0.10, 0.145}, {0, 0, 1.32}, {0.125, 0.205}, shirt);
  model.ellipsoid({0, 0, 1.36}, {0.125, 0.225, 0.12}, 7, shirt);
  model.cone({0, 0, 1.42}, 0.058, {0.01, 0, 1.56}, 0.052, 8, skin);
  model.ellipsoid({0.02, 0, 1.63}, {0.095, 0.078, 0.12}, 8, skin);
  model.ellipsoid({-0.012, 0, 1.665}, {0.098, 0.088, 0.105}, 8, hair);
}

const std::vector<std::pair<std::string, Model>>& named_models() {
  static const std::vector<std::pair<std::string, Model>> kModels{
      {"box", Model::kBox}, {"sphere", Model::kSphere}, {"cylinder", Model::kCylinder}, {"cone", Model::kCone},
      {"car", Model::kCar}, {"van", Model::kVan},       {"person", Model::kPerson}};
  return kModels;
}

}  // namespace

std::optional<Model> model_named(const std::string& name) {
  const auto at = std::ranges::find(named_models(), name, &std::pair<std::string, Model>::first);
  return at == named_models().end() ? std::nullopt : std::optional(at->second);
}

const std::vector<std::string>& model_names() {
  static const std::vector<std::string> kNames = [] {
    std::vector<std::string> names;
    for (const auto& [name, model] : named_models()) names.push_back(name);
    return names;
  }();
  return kNames;
}

imaging::TexturedMesh make_model(Model model, std::uint64_t number, const std::optional<Rgb8>& colour) {
  constexpr int kSides = 32;
  ModelBuilder builder;
  switch (model) {
    case Model::kBox:
      builder.frustum({0, 0, -0.5}, {0.5, 0.5}, {0, 0, 0.5}, {0.5, 0.5}, colour.value_or(kShape));
      break;
    case Model::kSphere:
      builder.ellipsoid(Vec3::Zero(), Vec3::Constant(0.5), kSides / 2, colour.value_or(kShape));
      break;
    case Model::kCylinder:
      builder.cone({0, 0, -0.5}, 0.5, {0, 0, 0.5}, 0.5, kSides, colour.value_or(kShape));
      break;
    case Model::kCone:
      builder.cone({0, 0, -0.5}, 0.5, {0, 0, 0.5}, 0.0, kSides, colour.value_or(kShape));
      break;
    case Model::kCar:
      add_car(builder, colour.value_or(paint(number)));
      break;
    case Model::kVan:
      add_van(builder, colour.value_or(paint(number)));
      break;
    case Model::kPerson:
      add_person(builder, number, colour);
      break;
  }
  imaging::TexturedMesh mesh = builder.take();
  mesh.name = named_models()[static_cast<std::size_t>(model)].first;
  return mesh;
}

}  // namespace tileflight::scene
