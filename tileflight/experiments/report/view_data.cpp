#include "tileflight/experiments/report/view_data.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>
#include <span>
#include <string>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/drawing/html.h"
#include "tileflight/core/drawing/number_format.h"
#include "tileflight/core/drawing/page_image.h"
#include "tileflight/core/drawing/top_view.h"
#include "tileflight/core/geometry/json_numbers.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/experiments/report/figures.h"
#include "tileflight/experiments/report/frame_pairs.h"
#include "tileflight/experiments/report/page_script.h"

namespace tileflight::report {

using base::base64;
using drawing::downscale;
using drawing::element;
using drawing::empty_element;
using drawing::Html;
using drawing::number_at;
using drawing::text;

namespace {

constexpr const char* kWithoutScript =
    "The interactive view needs a browser with JavaScript and WebGL 2. The figures on this page show the same place, "
    "maps and paths.";

/// Content of the script element: a CDATA section for XML, whose markers are comments in the script.
std::string script_text() { return "//<![CDATA[\n" + std::string(page_script()) + "\n//]]>"; }

std::string bytes_of_hex(const std::string& hex) {
  std::string bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2)
    bytes += static_cast<char>(std::stoi(hex.substr(i, 2), nullptr, 16));
  return bytes;
}

}  // namespace

Html view_section(const RunFolder& run, const ViewBudget& budget) {
  if (page_script().empty()) return {};
  const std::string data = view_data(run, budget);
  if (data.empty()) return {};
  return element("p", {{"class", "note"}, {"id", "view-note"}, {"role", "status"}}, text(kWithoutScript)) +
         element("div", {{"id", "view-host"}, {"data-state", "waiting"}}, Html()) +
         element("script", {{"type", "application/octet-stream"}, {"id", "view-data"}}, text(base64(data)));
}

Html view_script() { return page_script().empty() ? Html() : element("script", Html::trusted(script_text())); }

std::string content_policy() {
  const std::string script =
      page_script().empty() ? ""
                            : "; script-src 'sha256-" + base64(bytes_of_hex(base::sha256_hex(script_text()))) + "'";
  return "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'" + script;
}

Html page_head(const std::string& name) {
  const std::string style = drawing::style_sheet() + std::string(view_style());
  return element("head",
                 empty_element("meta", {{"charset", "utf-8"}}) +
                     empty_element("meta", {{"name", "viewport"}, {"content", "width=device-width, initial-scale=1"}}) +
                     empty_element("meta", {{"http-equiv", "Content-Security-Policy"}, {"content", content_policy()}}) +
                     element("title", text(name + " \u2013 tileflight")) + element("style", Html::trusted(style)));
}

namespace {

/// Binary blocks of numbers with a header, for the page's view (read by web/src/data.ts): the header's length in bytes
/// as 32 bits, the header as JSON (UTF-8), blanks up to a multiple of four, and the blocks, each aligned to a multiple
/// of four from there. All numbers are little-endian.
class DataBlocks {
 public:
  /// Appends a block. Returns its position for the header: {"at", "bytes"}.
  template <class Number>
  nlohmann::json add(std::span<const Number> numbers) {
    return add_bytes({reinterpret_cast<const char*>(numbers.data()), numbers.size_bytes()});
  }
  nlohmann::json add_bytes(std::string_view bytes);

  /// Header and blocks as one zlib stream (RFC 1950). Deterministic.
  std::string compress(const nlohmann::json& header) const;

 private:
  std::string bytes_;
};

static_assert(std::endian::native == std::endian::little, "blocks are written as they lie in memory");

void fill_up_to_four(std::string& bytes, char filling) { bytes.resize((bytes.size() + 3) / 4 * 4, filling); }

nlohmann::json DataBlocks::add_bytes(std::string_view bytes) {
  fill_up_to_four(bytes_, '\0');
  const nlohmann::json place{{"at", bytes_.size()}, {"bytes", bytes.size()}};
  bytes_ += bytes;
  return place;
}

std::string DataBlocks::compress(const nlohmann::json& header) const {
  // Names come from files: invalid UTF-8 is replaced.
  const std::string words = header.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  const auto length = static_cast<std::uint32_t>(words.size());
  std::string plain(reinterpret_cast<const char*>(&length), sizeof(length));
  plain += words;
  fill_up_to_four(plain, ' ');
  plain += bytes_;
  uLongf size = compressBound(static_cast<uLong>(plain.size()));
  std::string packed(size, '\0');
  const int result = compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
                               reinterpret_cast<const Bytef*>(plain.data()), static_cast<uLong>(plain.size()), 6);
  assert(result == Z_OK);
  static_cast<void>(result);
  packed.resize(size);
  return packed;
}

using geometry::Box3;
using geometry::Vec3;
using nlohmann::json;

constexpr double kMaxUint16 = 65535.0;
constexpr std::uint16_t kUnknown_mm = 65535;
/// Lenses with a wider field of view are drawn as a pyramid of this width.
constexpr double kWidestHalf_deg = 40.0;
/// Map points farther outside the place than this share of its diagonal are not shown.
constexpr double kReach = 0.5;

/// Positions quantized to 16 bits within the points' bounds.
json add_positions(DataBlocks& blocks, const std::vector<Vec3>& points) {
  Box3 box;
  for (const Vec3& p : points) box.extend(p);
  const Vec3 step = (box.sizes() / kMaxUint16).cwiseMax(1e-9);
  std::vector<std::uint16_t> steps;
  steps.reserve(3 * points.size());
  for (const Vec3& p : points) {
    for (int axis = 0; axis < 3; ++axis)
      steps.push_back(static_cast<std::uint16_t>(std::lround((p[axis] - box.min()[axis]) / step[axis])));
  }
  json place = blocks.add(std::span<const std::uint16_t>(steps));
  place["low_m"] = geometry::json_numbers(box.min());
  place["step_m"] = geometry::json_numbers(step);
  return place;
}

/// JPEG at the best quality that fits; scaled down by half if even the lowest does not.
std::string jpeg_within(imaging::RgbImage image, std::size_t most_bytes) {
  for (;;) {
    for (const int quality : {85, 75, 60, 45}) {
      std::string jpeg = std::string(base::as_text(imaging::encode_jpeg(image, quality)));
      if (jpeg.size() <= most_bytes || image.width <= 16) return jpeg;
    }
    image = downscale(image, image.width / 2);
  }
}

json place_layer(DataBlocks& blocks, const RunFolder& run, const ViewBudget& budget) {
  if (run.meshes.empty()) return nullptr;
  const simplification::PlaceModel model = simplification::read_place_model(run.meshes, budget.place);
  const imaging::TexturedMesh& mesh = model.mesh;
  std::vector<std::uint16_t> uv;
  for (const Eigen::Vector2f& at : mesh.uv) {
    for (const float value : {at.x(), at.y()})
      uv.push_back(static_cast<std::uint16_t>(std::lround(std::clamp<double>(value, 0.0, 1.0) * kMaxUint16)));
  }
  const std::span corners(mesh.mesh.triangles.front().data(), 3 * mesh.mesh.triangles.size());
  return {{"triangles", mesh.mesh.triangles.size()},
          {"source_triangles", model.source_triangles},
          {"positions", add_positions(blocks, mesh.mesh.vertices)},
          {"uv", blocks.add(std::span<const std::uint16_t>(uv))},
          {"indices", blocks.add(std::span<const std::uint32_t>(corners))},
          {"texture", blocks.add_bytes(jpeg_within(*mesh.texture, budget.max_texture_bytes))}};
}

/// Cells of a grid by their indices along each axis; the first one has the corner `origin`.
struct Cells {
  Vec3 origin_m;
  double size_m;
  std::set<std::array<std::uint16_t, 3>> at;
};

Cells cells_of(const std::vector<Vec3>& centers, double size_m) {
  Box3 box;
  for (const Vec3& p : centers) box.extend(p);
  Cells cells{box.min() - Vec3::Constant(size_m / 2), size_m, {}};
  for (const Vec3& p : centers) {
    std::array<std::uint16_t, 3> cell{};
    for (int axis = 0; axis < 3; ++axis) {
      const double number = std::floor((p[axis] - cells.origin_m[axis]) / size_m);
      cell[static_cast<std::size_t>(axis)] = static_cast<std::uint16_t>(std::clamp(number, 0.0, kMaxUint16));
    }
    cells.at.insert(cell);
  }
  return cells;
}

json cells_layer(DataBlocks& blocks, const RunFolder& run, const ViewBudget& budget) {
  if (!run.voxel_centers || run.voxel_centers->empty()) return nullptr;
  Cells cells = cells_of(run.voxel_centers->positions, run.voxel_m);
  while (cells.at.size() > budget.max_cells) cells = cells_of(run.voxel_centers->positions, 2 * cells.size_m);
  std::vector<std::uint16_t> numbers;
  for (const auto& cell : cells.at) numbers.insert(numbers.end(), cell.begin(), cell.end());
  return {{"size_m", cells.size_m},
          {"origin_m", geometry::json_numbers(cells.origin_m)},
          {"cells", blocks.add(std::span<const std::uint16_t>(numbers))}};
}

/// At most `count` evenly chosen indices below `size`, including the first and the last.
std::vector<std::size_t> choose_evenly(std::size_t size, std::size_t count) {
  const std::size_t chosen = std::min(size, count);
  std::vector<std::size_t> result;
  for (std::size_t i = 0; i < chosen; ++i) result.push_back(chosen == 1 ? 0 : i * (size - 1) / (chosen - 1));
  return result;
}

json add_lengths(DataBlocks& blocks, const geometry::PointCloud& map, const std::string& name,
                 const std::vector<std::size_t>& shown) {
  const auto found = map.scalars.find(name);
  if (found == map.scalars.end()) return nullptr;
  std::vector<std::uint16_t> lengths_mm;
  for (const std::size_t i : shown) {
    const double length_mm = 1000.0 * static_cast<double>(found->second[i]);
    lengths_mm.push_back(std::isfinite(length_mm)
                             ? static_cast<std::uint16_t>(std::clamp(std::round(length_mm), 0.0, kMaxUint16 - 1))
                             : kUnknown_mm);
  }
  return blocks.add(std::span<const std::uint16_t>(lengths_mm));
}

json add_colors(DataBlocks& blocks, const geometry::PointCloud& map, const std::vector<std::size_t>& shown) {
  if (map.colors.empty()) return nullptr;
  std::vector<std::uint8_t> colors;
  for (const std::size_t i : shown) colors.insert(colors.end(), map.colors[i].begin(), map.colors[i].end());
  return blocks.add(std::span<const std::uint8_t>(colors));
}

json map_layer(DataBlocks& blocks, const FlightRun& flight, const Box3& reach, const ViewBudget& budget) {
  if (!flight.errors) return nullptr;
  std::vector<std::size_t> inside;
  for (std::size_t i = 0; i < flight.errors->size(); ++i) {
    if (reach.contains(flight.errors->positions[i])) inside.push_back(i);
  }
  if (inside.empty()) return nullptr;
  std::vector<std::size_t> shown;
  for (const std::size_t i : choose_evenly(inside.size(), budget.max_map_points)) shown.push_back(inside[i]);
  std::vector<Vec3> positions;
  for (const std::size_t i : shown) positions.push_back(flight.errors->positions[i]);
  return {{"points", flight.errors->size()},
          {"shown", shown.size()},
          {"positions", add_positions(blocks, positions)},
          {"surface_mm", add_lengths(blocks, *flight.errors, "surface_distance", shown)},
          {"voxel_mm", add_lengths(blocks, *flight.errors, "voxel_distance", shown)},
          {"colors", add_colors(blocks, *flight.errors, shown)}};
}

/// Eight numbers per pose: seconds from the start, position, rotation as a quaternion x y z w.
json path_layer(DataBlocks& blocks, const std::optional<geometry::Trajectory>& path, double start_s,
                const ViewBudget& budget) {
  if (!path || path->empty()) return nullptr;
  std::vector<float> numbers;
  for (const std::size_t i : choose_evenly(path->size(), budget.max_poses)) {
    const geometry::StampedPose& pose = path->poses[i];
    const Vec3& p = pose.T_local_camera.translation;
    const Eigen::Quaterniond& q = pose.T_local_camera.rotation;
    for (const double value : {pose.time_s - start_s, p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()})
      numbers.push_back(static_cast<float>(value));
  }
  return blocks.add(std::span<const float>(numbers));
}

std::vector<imaging::RgbImage> small_pictures(const std::vector<FrameFile>& files, int width_px) {
  std::vector<imaging::RgbImage> pictures;
  for (const FrameFile& file : files) pictures.push_back(downscale(imaging::read_rgb(file.image), width_px));
  return pictures;
}

/// JPEGs at one common quality, the best that fits; if none does, fewer images at the lowest quality.
std::vector<std::string> jpegs_within(const std::vector<imaging::RgbImage>& pictures, std::size_t most_bytes) {
  std::vector<std::string> jpegs;
  for (const int quality : {75, 60, 45, 30}) {
    jpegs.clear();
    std::size_t bytes = 0;
    for (const imaging::RgbImage& picture : pictures) {
      jpegs.emplace_back(base::as_text(imaging::encode_jpeg(picture, quality)));
      bytes += jpegs.back().size();
    }
    if (bytes <= most_bytes) break;
  }
  return jpegs;
}

/// The images of one of `cameras`, which share the budget.
json frames_layer(DataBlocks& blocks, const std::vector<FrameFile>& all, double start_s, const ViewBudget& budget,
                  std::size_t cameras) {
  const std::size_t most_bytes = budget.max_frame_bytes / cameras;
  std::vector<FrameFile> files;
  for (const std::size_t i : choose_evenly(all.size(), (budget.max_frames + cameras - 1) / cameras))
    files.push_back(all[i]);
  const std::vector<std::string> jpegs = jpegs_within(small_pictures(files, budget.frame_width_px), most_bytes);
  json frames = json::array();
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < jpegs.size() && bytes + jpegs[i].size() <= most_bytes; ++i) {
    json frame = blocks.add_bytes(jpegs[i]);
    frame["time_s"] = files[i].time_s - start_s;
    frames.push_back(frame);
    bytes += jpegs[i].size();
  }
  return frames;
}

json other_camera_layers(DataBlocks& blocks, const FlightRun& flight, double start_s, const ViewBudget& budget) {
  json cameras = json::array();
  for (const CameraFrames& camera : flight.other_cameras)
    cameras.push_back(
        {{"name", camera.name},
         {"frames", frames_layer(blocks, camera.frames, start_s, budget, 1 + flight.other_cameras.size())}});
  return cameras;
}

/// The earliest time in all of a flight's data.
double start_of(const FlightRun& flight) {
  double start_s = std::numeric_limits<double>::infinity();
  if (!flight.frames.empty()) start_s = flight.frames.front().time_s;
  for (const auto* path : {&flight.estimate, &flight.truth}) {
    if (*path && !(*path)->empty()) start_s = std::min(start_s, (*path)->poses.front().time_s);
  }
  return std::isfinite(start_s) ? start_s : 0.0;
}

/// Half the image's width and height at a distance of one metre.
std::pair<double, double> half_image_extent(const json& flight) {
  const double half_deg = std::min(kWidestHalf_deg, number_at(flight, "/fov_deg").value_or(70.0) / 2);
  const double half_width = std::tan(half_deg * std::numbers::pi / 180);
  const double width = number_at(flight, "/resolution/0").value_or(16),
               height = number_at(flight, "/resolution/1").value_or(9);
  return {half_width, half_width * height / std::max(width, 1.0)};
}

json flight_layers(DataBlocks& blocks, const FlightRun& flight, double start_s, const Box3& reach,
                   const ViewBudget& budget) {
  const auto [half_width, half_height] = half_image_extent(flight.values);
  return {{"key", flight.key},
          {"label", flight.label},
          {"start_s", start_s},
          {"map", map_layer(blocks, flight, reach, budget)},
          {"estimate", path_layer(blocks, flight.estimate, start_s, budget)},
          {"truth", path_layer(blocks, flight.truth, start_s, budget)},
          {"half_width", half_width},
          {"half_height", half_height},
          {"frames", frames_layer(blocks, flight.frames, start_s, budget, 1 + flight.other_cameras.size())},
          {"camera", flight.camera},
          {"other_cameras", other_camera_layers(blocks, flight, start_s, budget)},
          {"pictures", flight.frames.size()}};
}

/// The place's extent: that of the cells, else of the maps without their farthest points, else of the paths.
Box3 extent_of_view(const RunFolder& run) {
  Box3 box;
  if (run.voxel_centers) {
    for (const Vec3& p : run.voxel_centers->positions) box.extend(p);
  }
  for (const FlightRun& flight : run.flights) {
    if (!box.isEmpty() || !flight.errors || flight.errors->empty()) continue;
    const drawing::GroundExtent ground = drawing::fit_extent(flight.errors->positions, 0.05, 0.02);
    std::vector<double> heights;
    for (const Vec3& p : flight.errors->positions) heights.push_back(p.z());
    const auto middle = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 2);
    std::nth_element(heights.begin(), middle, heights.end());
    box.extend(Vec3(ground.west, ground.south, *middle));
    box.extend(Vec3(ground.east, ground.north, *middle));
  }
  for (const FlightRun& flight : run.flights) {
    if (!box.isEmpty() || !flight.truth) continue;
    for (const geometry::StampedPose& pose : flight.truth->poses) box.extend(pose.T_local_camera.translation);
  }
  return box;
}

/// Bounds of most points within `reach`: along each axis without the outermost `trimmed` share.
Box3 trimmed_bounds(const std::vector<Vec3>& points, const Box3& reach, double trimmed) {
  Box3 box;
  std::array<std::vector<double>, 3> values;
  for (const Vec3& p : points) {
    if (!reach.contains(p)) continue;
    for (int axis = 0; axis < 3; ++axis) values[static_cast<std::size_t>(axis)].push_back(p[axis]);
  }
  if (values[0].empty()) return box;
  Vec3 low, high;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double>& along = values[static_cast<std::size_t>(axis)];
    const auto at = [&along](double share) {
      const auto place = static_cast<std::ptrdiff_t>(std::lround(share * static_cast<double>(along.size() - 1)));
      std::nth_element(along.begin(), along.begin() + place, along.end());
      return along[static_cast<std::size_t>(place)];
    };
    low[axis] = at(trimmed);
    high[axis] = at(1.0 - trimmed);
  }
  return {low, high};
}

std::vector<Vec3> trajectory_positions(const geometry::Trajectory& path) {
  std::vector<Vec3> positions;
  for (const geometry::StampedPose& pose : path.poses) positions.push_back(pose.T_local_camera.translation);
  return positions;
}

/// Content of the initial view: the place, both maps without outliers, and the paths.
Box3 initial_view_box(const RunFolder& run, const Box3& extent, const Box3& reach) {
  constexpr double kOutliers = 0.02;  // share on each side
  Box3 shown = extent;
  const auto add = [&shown](const Box3& box) {
    if (!box.isEmpty()) shown.extend(box);
  };
  for (const FlightRun& flight : run.flights) {
    if (flight.errors) add(trimmed_bounds(flight.errors->positions, reach, kOutliers));
    for (const auto* path : {&flight.estimate, &flight.truth}) {
      if (*path) add(trimmed_bounds(trajectory_positions(**path), reach, 0.0));
    }
  }
  return shown;
}

json attribution_of(const json& results) {
  json lines = json::array();
  const json::json_pointer place("/provenance/attribution");
  if (!results.contains(place) || !results.at(place).is_array()) return lines;
  for (const json& line : results.at(place)) {
    if (line.is_string()) lines.push_back(line);
  }
  return lines;
}

json error_colors() {
  json colors = json::array();
  for (int i = 0; i <= 4; ++i) {
    const drawing::Rgba8 c = drawing::value_color(i / 4.0);
    colors.push_back({c[0], c[1], c[2]});
  }
  return colors;
}

}  // namespace

std::string view_data(const RunFolder& run, const ViewBudget& budget) {
  const Box3 extent = extent_of_view(run);
  if (extent.isEmpty()) return "";
  const Vec3 beside = Vec3::Constant(kReach * extent.diagonal().norm() + 1.0);
  const Box3 reach(extent.min() - beside, extent.max() + beside);
  const bool common_clock = run.results.contains("reproduction") && run.results["reproduction"].is_object();
  double earliest_s = std::numeric_limits<double>::infinity();
  for (const FlightRun& flight : run.flights) earliest_s = std::min(earliest_s, start_of(flight));
  const Box3 shown = initial_view_box(run, extent, reach);
  DataBlocks blocks;
  json header{{"low_m", geometry::json_numbers(extent.min())},
              {"high_m", geometry::json_numbers(extent.max())},
              {"shown_low_m", geometry::json_numbers(shown.min())},
              {"shown_high_m", geometry::json_numbers(shown.max())},
              {"error_limit_m", color_limit(run)},
              {"error_colors", error_colors()},
              {"common_clock", common_clock},
              {"attribution", attribution_of(run.results)},
              {"place", place_layer(blocks, run, budget)},
              {"cells", cells_layer(blocks, run, budget)},
              {"flights", json::array()}};
  for (const FlightRun& flight : run.flights) {
    const double start_s = common_clock ? earliest_s : start_of(flight);
    header["flights"].push_back(flight_layers(blocks, flight, start_s, reach, budget));
  }
  return blocks.compress(header);
}

}  // namespace tileflight::report
