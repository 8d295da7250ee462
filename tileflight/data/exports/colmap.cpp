// COLMAP's text format: https://colmap.github.io/format.html#text-format, models of
// https://colmap.github.io/cameras.html.
#include "tileflight/data/exports/colmap.h"

#include <algorithm>
#include <optional>
#include <variant>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/dataset/frame_list.h"
#include "tileflight/data/exports/export_dataset.h"
#include "tileflight/data/exports/layout_writers.h"

namespace tileflight::exports {

namespace {

using geometry::Vec2;

constexpr double kPixelCentre = 0.5;  ///< centre of COLMAP's first pixel; ours is at 0

struct ColmapLens {
  std::string model;
  std::vector<double> numbers;
};

std::vector<double> focal(const auto& m) { return {m.fx, m.fy, m.cx + kPixelCentre, m.cy + kPixelCentre}; }

ColmapLens named(const std::string& model, std::vector<double> numbers, std::initializer_list<double> more) {
  numbers.insert(numbers.end(), more);
  return {model, std::move(numbers)};
}

std::optional<ColmapLens> known(const imaging::PinholeRadtan& m) {
  if (m.d == std::array<double, 4>{}) return named("PINHOLE", focal(m), {});
  return named("OPENCV", focal(m), {m.d[0], m.d[1], m.d[2], m.d[3]});
}
std::optional<ColmapLens> known(const imaging::KannalaBrandt& m) {
  return named("OPENCV_FISHEYE", focal(m), {m.k[0], m.k[1], m.k[2], m.k[3]});
}
std::optional<ColmapLens> known(const imaging::FovModel& m) { return named("FOV", focal(m), {m.w}); }
std::optional<ColmapLens> known(const imaging::PinholeRational& m) {
  if (std::any_of(m.d.begin() + 8, m.d.end(), [](double s) { return s != 0.0; })) return std::nullopt;
  return named("FULL_OPENCV", focal(m), {m.d[0], m.d[1], m.d[2], m.d[3], m.d[4], m.d[5], m.d[6], m.d[7]});
}
std::optional<ColmapLens> known(const auto& /*m*/) { return std::nullopt; }

ColmapLens colmap_lens(const imaging::Camera& camera) {
  const std::optional<ColmapLens> lens = std::visit([](const auto& m) { return known(m); }, camera.model());
  if (lens) return *lens;
  throw InputError(
      "camera",
      "COLMAP has no model for this lens: export a pinhole, radtan, equidistant or fov camera, or rectify to "
      "a pinhole first");
}

void append(std::string& text, double value) {
  text += ' ';
  base::append_number(text, value);
}

/// Observations of the points: for each image its pixels, for each point its (image, index in that image's list).
struct Observations {
  struct Pixel {
    Vec2 at;
    std::size_t point = 0;
  };
  std::vector<std::vector<Pixel>> by_image;
  std::vector<std::vector<std::pair<int, std::size_t>>> by_point;
};

Observations project_points(const ColmapModel& model) {
  Observations all;
  all.by_image.resize(model.images.size());
  all.by_point.resize(model.points.size());
  for (std::size_t i = 0; i < model.points.size(); ++i) {
    for (const int k : model.points[i].image_indices) {
      const auto pixel = model.camera.project(model.images[k].T_world_camera.inverse() * model.points[i].position);
      if (!pixel || !model.camera.contains(*pixel)) continue;
      all.by_point[i].emplace_back(k, all.by_image[k].size());
      all.by_image[k].push_back({*pixel, i});
    }
  }
  return all;
}

std::string camera_line(std::size_t id, const imaging::Camera& camera) {
  const ColmapLens lens = colmap_lens(camera);
  std::string text = std::to_string(id) + " " + lens.model + " " + std::to_string(camera.width()) + " " +
                     std::to_string(camera.height());
  for (const double number : lens.numbers) append(text, number);
  return text + "\n";
}

std::string cameras_text(const ColmapModel& model) {
  std::string text = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n" + camera_line(1, model.camera);
  for (std::size_t i = 0; i < model.others.size(); ++i) text += camera_line(i + 2, model.others[i].camera);
  return text;
}

void append_pose(std::string& text, const geometry::SE3& T) {
  const Eigen::Quaterniond& q = T.rotation;
  for (const double value : {q.w(), q.x(), q.y(), q.z()}) append(text, value);
  for (int i = 0; i < 3; ++i) append(text, T.translation[i]);
}

/// The first camera is the rig's frame.
std::string rigs_text(const ColmapModel& model) {
  std::string text =
      "# RIG_ID NUM_SENSORS REF_SENSOR_TYPE REF_SENSOR_ID SENSORS[] as SENSOR_TYPE SENSOR_ID HAS_POSE QW QX QY QZ TX "
      "TY TZ "
      "(rig to sensor)\n1 " +
      std::to_string(model.others.size() + 1) + " CAMERA 1";
  for (std::size_t i = 0; i < model.others.size(); ++i) {
    text += " CAMERA " + std::to_string(i + 2) + " 1";
    append_pose(text, model.others[i].T_camera_first);
  }
  return text + "\n";
}

std::string frames_text(const ColmapModel& model) {
  std::string text =
      "# FRAME_ID RIG_ID RIG_FROM_WORLD[QW QX QY QZ TX TY TZ] NUM_DATA_IDS DATA_IDS[] as SENSOR_TYPE SENSOR_ID "
      "DATA_ID\n";
  for (std::size_t i = 0; i < model.instants.size(); ++i) {
    const ColmapModel::Image& image = model.images[model.instants[i].front()];
    const geometry::SE3 T_camera_first =
        image.camera == 0 ? geometry::SE3() : model.others[image.camera - 1].T_camera_first;
    text += std::to_string(i + 1) + " 1";
    append_pose(text, T_camera_first.inverse() * image.T_world_camera.inverse());
    text += " " + std::to_string(model.instants[i].size());
    for (const std::size_t k : model.instants[i])
      text += " CAMERA " + std::to_string(model.images[k].camera + 1) + " " + std::to_string(k + 1);
    text += "\n";
  }
  return text;
}

std::string images_text(const ColmapModel& model, const Observations& observations) {
  std::string text =
      "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME (world to camera)\n# POINTS2D[] as X Y POINT3D_ID\n";
  for (std::size_t k = 0; k < model.images.size(); ++k) {
    const geometry::SE3 T_camera_world = model.images[k].T_world_camera.inverse();
    text += std::to_string(k + 1);
    append_pose(text, T_camera_world);
    text += " " + std::to_string(model.images[k].camera + 1) + " " + model.images[k].name + "\n";
    for (const Observations::Pixel& pixel : observations.by_image[k]) {
      append(text, pixel.at.x() + kPixelCentre);
      append(text, pixel.at.y() + kPixelCentre);
      text += " " + std::to_string(pixel.point + 1);
    }
    text += "\n";
  }
  return text;
}

std::string points_text(const ColmapModel& model, const Observations& observations) {
  std::string text = "# POINT3D_ID X Y Z R G B ERROR TRACK[] as IMAGE_ID POINT2D_IDX\n";
  for (std::size_t i = 0; i < model.points.size(); ++i) {
    text += std::to_string(i + 1);
    for (int k = 0; k < 3; ++k) append(text, model.points[i].position[k]);
    for (const std::uint8_t value : model.points[i].color) text += " " + std::to_string(value);
    text += " -1";
    for (const auto& [picture, place] : observations.by_point[i])
      text += " " + std::to_string(picture + 1) + " " + std::to_string(place);
    text += "\n";
  }
  return text;
}

}  // namespace

void require_colmap_lens(const imaging::Camera& camera) { colmap_lens(camera); }

void write_colmap(const std::filesystem::path& folder, const ColmapModel& model) {
  const std::string cameras = cameras_text(model);
  const Observations observations = project_points(model);
  base::write_file(folder / "cameras.txt", cameras);
  base::write_file(folder / "images.txt", images_text(model, observations));
  base::write_file(folder / "points3D.txt", points_text(model, observations));
  if (model.others.empty()) return;
  base::write_file(folder / "rigs.txt", rigs_text(model));
  base::write_file(folder / "frames.txt", frames_text(model));
}

namespace {

namespace fs = std::filesystem;

ColmapModel single_model(const dataset::Dataset& dataset) {
  const std::vector<geometry::SE3> poses = find_frame_poses(dataset);
  ColmapModel model;
  model.camera = dataset.calibration.camera;
  for (std::size_t i = 0; i < poses.size(); ++i)
    model.images.push_back({dataset::frame_id(i) + dataset.frames[i].image.extension().string(), poses[i]});
  return model;
}

/// Images of one instant have the same name in their cameras' folders (https://colmap.github.io/rigs.html).
ColmapModel rig_model(const dataset::Rig& rig, const std::vector<dataset::RigInstant>& instants) {
  ColmapModel model;
  std::vector<std::vector<geometry::SE3>> poses;
  for (const dataset::RigCamera& camera : rig.cameras) {
    require_colmap_lens(camera.dataset.calibration.camera);
    poses.push_back(find_frame_poses(camera.dataset));
    if (poses.size() > 1)
      model.others.push_back(
          {camera.dataset.calibration.camera, camera.T_body_camera.inverse() * rig.cameras.front().T_body_camera});
  }
  model.camera = rig.cameras.front().dataset.calibration.camera;
  for (std::size_t k = 0; k < instants.size(); ++k) {
    std::vector<std::size_t>& together = model.instants.emplace_back();
    for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
      const std::optional<std::size_t>& frame = instants[k].frames[c];
      if (!frame) continue;
      const std::string ending = rig.cameras[c].dataset.frames[*frame].image.extension().string();
      together.push_back(model.images.size());
      model.images.push_back({rig.cameras[c].name + "/" + dataset::frame_id(k) + ending, poses[c][*frame], c});
    }
  }
  return model;
}

/// Number of the instant of each of a camera's frames.
std::vector<std::size_t> instants_of(std::size_t camera, const std::vector<dataset::RigInstant>& instants) {
  std::vector<std::size_t> numbers;
  for (std::size_t k = 0; k < instants.size(); ++k) {
    if (instants[k].frames[camera]) numbers.push_back(k);
  }
  return numbers;
}

}  // namespace

/// A COLMAP project with known poses; `colmap point_triangulator` can continue from it.
void write_colmap_folder(const dataset::Rig& rig, const fs::path& folder, std::vector<std::string>& notes,
                         const Progress& progress) {
  const dataset::Dataset& first = rig.cameras.front().dataset;
  require_colmap_lens(first.calibration.camera);
  const bool is_single = rig.cameras.size() == 1;
  const std::vector<dataset::RigInstant> instants =
      is_single ? std::vector<dataset::RigInstant>{} : dataset::rig_instants(rig);
  const ColmapModel model = is_single ? single_model(first) : rig_model(rig, instants);
  fs::create_directories(folder / "sparse" / "0");
  write_colmap(folder / "sparse" / "0", model);
  notes.push_back("the model has poses but no points; run `colmap point_triangulator` to add them");
  if (is_single) return copy_frames(first, folder / "images", dataset::frame_id, progress);
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const std::vector<std::size_t> numbers = instants_of(c, instants);
    copy_frames(
        rig.cameras[c].dataset, folder / "images" / rig.cameras[c].name,
        [&](std::size_t i) { return dataset::frame_id(numbers[i]); }, progress);
  }
}

}  // namespace tileflight::exports
